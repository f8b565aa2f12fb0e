//! `petzval simulate`: photographs and scenes through a lens onto a sensor.

mod camera;
mod highlights;
mod output;
mod spectral;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use petzval::camera::develop::{clip_highlights, correct_shading, develop, saturated_share};
use petzval::camera::image::LinearImage;
use petzval::camera::render::render;
use petzval::camera::sensor::{Capture, Exposure, Noise, NoiseMode, SensorModel, expose};
use petzval::camera::spectral::{Matrix3, apply};
use petzval::design::camera::SHADING_FLOOR;
use petzval::design::error::DesignError;
use petzval::files::load_image;
use serde_json::{Value, json};

use self::camera::{Camera, camera};
use super::{Failure, print_json};

/// How a photograph lands on the sensor.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Place {
    /// Scaled to cover the sensor, the rest cut off.
    Fill,
    /// One photograph pixel per sensor pixel, around the axis.
    Centre,
}

/// What becomes of the raw frame.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Isp {
    /// Dark level, white balance, bilinear demosaic, shading correction.
    Linear,
}

/// Take photographs and scenes through a lens: scene, raw frame, developed picture.
///
/// For each image NAME three files are written: NAME-raw.tiff, 16 bit, the mosaic in digital numbers;
/// NAME-raw.tiff.toml, which says how it was taken; and NAME-developed.png, 8 bit sRGB.
///
/// Spectral images (.npy, .exr, .tif with a sidecar), the built-in scenes (scene:colorchecker, scene:flat,
/// scene:slanted-edge, scene:siemens-star) and photographs with any of the options "Over the spectrum" are simulated over
/// the spectrum: every band through its own PSF, photons in SI units, electrons by the sensor's quantum efficiency.
///
/// The flat scene is a perfect diffuser. Edge and star are the white and the black patch of a ColorChecker, which reflect 0.89
/// and 0.03 of the light at 550 nm: black is a dark gray.
///
/// Highlights end in neutral white where white light saturates the first colour. What a PNG shows as white is white, or where
/// highlights end, if that is less; the linear light of EXR and NPY always has white at 1.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Photographs (PNG, JPEG, TIFF), spectral images, or scene:NAME
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Lens file, or a built-in name
    #[arg(long, default_value = "cooke-triplet-nominal")]
    lens: String,
    /// Measured PSFs in place of the lens: the results of psf-calibrate (a folder, or its psfs.toml). They bring their own
    /// illumination. Clear pixels see the three planes of a picture, each spread by its PSF, by the sensor's clear_response
    #[arg(long, value_name = "PATH", conflicts_with = "lens")]
    psfs: Option<PathBuf>,
    /// Sensor file, or a built-in name
    #[arg(long, default_value = "imx249-fitted")]
    sensor: String,
    /// Development
    #[arg(long, value_enum, default_value = "linear")]
    isp: Isp,
    /// How a photograph lands on the sensor
    #[arg(long, value_enum, default_value = "fill")]
    place: Place,
    /// Photoelectrons that white gives in a green pixel on the axis. By default 70 % of those with which white saturates the
    /// first colour at this gain, to two digits: 16000 for imx249-fitted. Over the spectrum the light says how many, unless
    /// they are given: then the illuminance follows from them
    #[arg(long, value_name = "E", allow_negative_numbers = true)]
    white_e: Option<f32>,
    /// Read only the middle HEIGHTxWIDTH pixels of the sensor, such as 480x640. They see what they see in a whole frame
    #[arg(long, value_name = "HxW", value_parser = size)]
    size: Option<(usize, usize)>,
    /// Exposure time, s
    #[arg(long, default_value_t = 0.005, value_name = "S", allow_negative_numbers = true)]
    time_s: f32,
    /// Linear analogue gain
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    gain: f32,
    /// Leave out all noise
    #[arg(long)]
    no_noise: bool,
    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    spectral: spectral::SpectralArgs,
    #[command(flatten)]
    formats: output::Formats,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Isp::Linear = args.isp;
    for (name, value, max) in [
        ("--white-e", args.white_e, 1e7),
        ("--time-s", Some(args.time_s), 1e4),
        ("--gain", Some(args.gain), 1e3),
    ] {
        if let Some(value) = value.filter(|value| !(*value > 0.0 && *value <= max)) {
            return Err(Failure::input(
                format!("{name} {value}: not between 0 and {max}"),
                "a positive number",
            ));
        }
    }
    // Results are named by their image: two of one name would overwrite each other.
    let mut names = std::collections::BTreeSet::new();
    if let Some(twice) = args.images.iter().find(|path| !names.insert(stem(path))) {
        return Err(Failure::input(
            format!("{}: another image is called `{}` too", twice.display(), stem(twice)),
            "results are named by their image; simulate the two into different folders with --out",
        ));
    }
    if spectral::wanted(&args) {
        return spectral::run(&args);
    }
    // Every image is read before anything is written.
    let photos: Vec<(String, LinearImage)> = args
        .images
        .iter()
        .map(|path| Ok((stem(path), load_image(path).map_err(DesignError::from)?)))
        .collect::<Result<_, Failure>>()?;
    let camera = camera(&args)?;
    Failure::folder(&args.out)?;
    let bar = progress_bar(photos.len(), "{pos}/{len}");
    let mut written = Vec::new();
    for (frame, (name, photo)) in photos.iter().enumerate() {
        bar.set_message(name.clone());
        let (facts, warning) = take(&args, &camera, name, photo, frame as u64)?;
        warning.into_iter().for_each(|warning| bar.suspend(|| eprintln!("{warning}")));
        written.push(Value::Object(facts));
        bar.inc(1);
    }
    bar.finish_and_clear();
    if args.json {
        return print_json(&json!(written));
    }
    print_paths(&written);
    Ok(ExitCode::SUCCESS)
}

/// Prints where raw frames and developed pictures are.
fn print_paths(written: &[Value]) {
    for w in written {
        println!("{}\n{}", w["raw"].as_str().unwrap_or(""), w["developed"].as_str().unwrap_or(""));
    }
}

/// A bar on stderr; `count` is what stands behind it.
fn progress_bar(length: usize, count: &str) -> ProgressBar {
    let bar = ProgressBar::new(length as u64);
    if let Ok(style) = ProgressStyle::with_template(&format!("{{msg}} [{{bar:30}}] {count}, {{eta}} left")) {
        bar.set_style(style);
    }
    bar
}

/// Name of the results: that of the file or of the scene.
fn stem(path: &Path) -> String {
    if let Some(scene) = spectral::scene_name(path) {
        return scene.to_owned();
    }
    path.file_stem().map_or_else(|| "image".to_owned(), |s| s.to_string_lossy().into_owned())
}

/// A picture laid on the pixels of the sensor.
fn placed(args: &Args, picture: &LinearImage, sensor: &SensorModel) -> LinearImage {
    let (height, width) = (sensor.height, sensor.width);
    if (picture.height, picture.width) == (height, width) {
        return picture.clone();
    }
    match args.place {
        Place::Fill => picture.cover(height, width),
        Place::Centre => picture.centred(height, width),
    }
}

/// Rows and columns of `480x640`.
fn size(text: &str) -> Result<(usize, usize), String> {
    let wrong = || "rows and columns are given as HEIGHTxWIDTH, such as 480x640".to_owned();
    let (height, width) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let number = |text: &str| text.trim().parse().map_err(|_| wrong());
    Ok((number(height)?, number(width)?))
}

/// A picture on the whole sensor as the lens images it on the pixels that are read, in three colours: spread by the PSFs,
/// dimmed off the axis.
fn through_lens(camera: &Camera, picture: &LinearImage) -> Result<LinearImage, DesignError> {
    let scene = camera.window.scene(picture, camera.border);
    let mut light = render(&camera.geometry, &camera.bank, &scene, camera.window.placement)?;
    light.data.iter_mut().zip(&camera.illumination.data).for_each(|(l, m)| *l *= m);
    Ok(light)
}

/// Takes one photograph and writes its raw frame and its developed picture.
fn take(
    args: &Args,
    camera: &Camera,
    name: &str,
    photo: &LinearImage,
    frame: u64,
) -> Result<Finished, Failure> {
    let light = through_lens(camera, &placed(args, photo, &camera.sensor))?;
    let white_e = match args.white_e {
        Some(white_e) => white_e,
        None => highlights::default_white_e(args, &camera.sensor)?,
    };
    finish(args, camera, &Shot { name, frame, light, white_e, sensor: &camera.sensor, matrix: None })
}

/// What was written of a shot, for the JSON, and what to warn of.
type Finished = (serde_json::Map<String, Value>, Option<String>);

/// One picture in front of the sensor.
struct Shot<'a> {
    name: &'a str,
    /// Number of the frame, which keys its noise.
    frame: u64,
    /// Light on each pixel, 1 = white.
    light: LinearImage,
    white_e: f32,
    /// The sensor, balanced for the light.
    sensor: &'a SensorModel,
    /// Linear sRGB from camera colours.
    matrix: Option<&'a Matrix3>,
}

/// Exposes and develops a shot and writes the results; says where they are.
fn finish(args: &Args, camera: &Camera, shot: &Shot) -> Result<Finished, Failure> {
    let exposure = Exposure { white_e: shot.white_e, time_s: args.time_s, linear_gain: args.gain };
    let capture = Capture { exposure, placement: camera.window.placement, frame: shot.frame };
    let mode = if args.no_noise { NoiseMode::Off } else { NoiseMode::Exact };
    let raw = expose(&shot.light, shot.sensor, &capture, &Noise { mode, seed: args.seed })
        .map_err(DesignError::from)?;
    // Development balances white, ends highlights where the first colour saturates, corrects the shading and turns camera colours
    // into those of a display.
    let clipped = clip_highlights(&raw, shot.sensor).map_err(DesignError::from)?;
    let developed = develop(&clipped, shot.sensor).map_err(DesignError::from)?;
    let mut developed =
        correct_shading(&developed, &camera.illumination, SHADING_FLOOR).map_err(DesignError::from)?;
    let saturation = highlights::Saturation::of(args, shot, saturated_share(&raw, shot.sensor))?;
    let highest = saturation.highest as f32;
    developed.data.iter_mut().for_each(|value| *value = value.min(highest));
    if let Some(matrix) = shot.matrix {
        let n = developed.height * developed.width;
        for i in 0..n {
            let camera_rgb = [0, 1, 2].map(|c| f64::from(developed.data[c * n + i]));
            for (c, value) in apply(matrix, camera_rgb).into_iter().enumerate() {
                developed.data[c * n + i] = value as f32;
            }
        }
    }
    let display_white = saturation.display_white();
    let mut facts =
        output::write(&args.formats, &args.out, shot.name, &raw, shot.sensor, (&developed, display_white))?;
    for (key, value) in [
        ("white_e", json!(shot.white_e)),
        ("saturated_share", json!(saturation.share)),
        ("display_white", json!(display_white)),
    ] {
        facts.insert(key.to_owned(), value);
    }
    Ok((facts, saturation.warning(args, shot)))
}
