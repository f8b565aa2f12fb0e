//! `simulate`: photographs and scenes through a lens onto a sensor.

mod bench;
mod highlights;
mod output;
mod spectral;

use std::path::{Path, PathBuf};

use petzval_camera::develop::saturated_share;
use petzval_camera::image::LinearImage;
use petzval_camera::isp::LinearIsp;
use petzval_camera::sensor::{Capture, Noise, NoiseMode, Raw, SensorModel};
use petzval_camera::tape::Frames;
use petzval_design::camera::{Camera, to_host};
use petzval_design::error::DesignError;
use petzval_files::load_image;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use self::bench::Bench;
use self::spectral::is_over_spectrum;
use crate::context::Context;
use crate::error::{JobError, make_folder};

pub use output::{PictureAs, RawAs};
pub use spectral::Spectral;

/// How a photograph lands on the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// Scaled to cover the sensor, the rest cut off.
    #[default]
    Fill,
    /// One photograph pixel per sensor pixel, around the axis.
    Centre,
}

/// Photographs and scenes to take. What is left out has the default of the command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Photographs (PNG, JPEG, TIFF), spectral images, or `scene:NAME`.
    pub images: Vec<PathBuf>,
    /// Lens file, or a built-in name.
    pub lens: String,
    /// Measured PSFs in place of the lens: the results of `psf-calibrate`.
    pub psfs: Option<PathBuf>,
    /// Sensor file, or a built-in name.
    pub sensor: String,
    /// How a photograph lands on the sensor.
    pub place: Place,
    /// Photoelectrons that white gives in a green pixel on the axis; 70 % of those with which white saturates the first colour
    /// if none are given, or what the light gives over the spectrum.
    pub white_e: Option<f32>,
    /// Rows and columns in the middle of the sensor that are read; all of them if none are given.
    pub size: Option<(usize, usize)>,
    /// Exposure time, s.
    pub time_s: f32,
    /// Linear analogue gain.
    pub gain: f32,
    /// Leave out all noise.
    pub no_noise: bool,
    /// Seed of the noise.
    pub seed: u64,
    /// The light, for a simulation over the spectrum.
    pub spectral: Spectral,
    /// Format of the raw frame.
    pub raw_format: RawAs,
    /// Format of the developed picture.
    pub picture_format: PictureAs,
    /// Folder for the results.
    pub out: PathBuf,
}

impl Default for Request {
    fn default() -> Self {
        Self {
            images: Vec::new(),
            lens: "cooke-triplet-nominal".to_owned(),
            psfs: None,
            sensor: "imx249-fitted".to_owned(),
            place: Place::Fill,
            white_e: None,
            size: None,
            time_s: 0.005,
            gain: 1.0,
            no_noise: false,
            seed: 1,
            spectral: Spectral::default(),
            raw_format: RawAs::Tiff,
            picture_format: PictureAs::Png,
            out: PathBuf::from("."),
        }
    }
}

/// Facts about what was written of one image, by name; see the command's manual.
pub type Facts = serde_json::Map<String, Value>;

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// Facts about each image, in the order of the request.
    pub images: Vec<Facts>,
}

/// Takes and develops all images, and writes raw frames and pictures.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    for (key, value, max) in [
        ("white_e", request.white_e, 1e7),
        ("time_s", Some(request.time_s), 1e4),
        ("gain", Some(request.gain), 1e3),
    ] {
        if let Some(value) = value.filter(|value| !(*value > 0.0 && *value <= max)) {
            let message = format!("not between 0 and {max}");
            return Err(JobError::setting(key, value, message, "a positive number"));
        }
    }
    // Results are named by their image: two of one name would overwrite each other.
    let mut names = std::collections::BTreeSet::new();
    if let Some(twice) = request.images.iter().find(|path| !names.insert(result_name(path))) {
        return Err(JobError::input(
            format!("{}: another image is called `{}` too", twice.display(), result_name(twice)),
            "results are named by their image; simulate the two into different folders with --out",
        ));
    }
    let images = match is_over_spectrum(request) {
        true => spectral::run(request, context)?,
        false => photographs(request, context)?,
    };
    Ok(Response { images })
}

/// Takes photographs in three colours.
fn photographs(request: &Request, context: &Context) -> Result<Vec<Facts>, JobError> {
    // Every image is read before anything is written.
    let photos: Vec<(String, LinearImage)> = (request.images.iter())
        .map(|path| Ok((result_name(path), load_image(path).map_err(DesignError::from)?)))
        .collect::<Result<_, JobError>>()?;
    let bench = Bench::new(request, context)?;
    let white_e = match request.white_e {
        Some(white_e) => white_e,
        None => highlights::default_white_e(request, &bench.sensor)?,
    };
    let camera = bench.camera(request, bench.sensor.clone(), white_e, LinearIsp::default())?;
    make_folder(&request.out)?;
    let mut written = Vec::new();
    for (frame, (name, photo)) in photos.iter().enumerate() {
        context.progress(frame as u64, photos.len() as u64, name);
        let shot = bench.shot(&placed(request, photo, &bench.sensor), frame as u64);
        let frames = camera.take(&[shot.clone()], &noise(request))?;
        let capture = camera.capture(&shot);
        let taken = Taken::new(&frames, capture)?;
        let (facts, warning) = write_shot(request, &camera, name, &taken)?;
        warning.into_iter().for_each(|warning| context.warning(warning));
        written.push(facts);
    }
    context.progress(photos.len() as u64, photos.len() as u64, "");
    Ok(written)
}

/// Name of the results: that of the file or of the scene.
fn result_name(path: &Path) -> String {
    if let Some(scene) = spectral::scene_name(path) {
        return scene.to_owned();
    }
    path.file_stem().map_or_else(|| "image".to_owned(), |s| s.to_string_lossy().into_owned())
}

fn noise(request: &Request) -> Noise {
    let mode = if request.no_noise { NoiseMode::Off } else { NoiseMode::Exact };
    Noise { mode, seed: request.seed }
}

/// A picture laid on the pixels of the sensor.
fn placed(request: &Request, picture: &LinearImage, sensor: &SensorModel) -> LinearImage {
    let (height, width) = (sensor.height, sensor.width);
    if (picture.height, picture.width) == (height, width) {
        return picture.clone();
    }
    match request.place {
        Place::Fill => picture.cover(height, width),
        Place::Centre => picture.centred(height, width),
    }
}

/// One frame and what was developed from it, on the host.
struct Taken {
    raw: Raw,
    developed: LinearImage,
}

impl Taken {
    fn new(frames: &Frames, capture: Capture) -> Result<Self, DesignError> {
        let [_, channels, height, width] = frames.developed.dims();
        let raw = Raw { height, width, dn: to_host(frames.raw.clone())?, capture };
        let data = to_host(frames.developed.clone())?;
        Ok(Self { raw, developed: LinearImage { channels, height, width, data } })
    }

    /// A frame of light that lies on the pixels already.
    fn of_light(
        request: &Request,
        bench: &Bench,
        camera: &Camera,
        light: &LinearImage,
        frame: u64,
    ) -> Result<Self, DesignError> {
        let exposure = camera.body().exposure;
        let capture = Capture { exposure, placement: bench.window.placement, frame };
        Self::new(&camera.take_light(light, capture, &noise(request))?, capture)
    }
}

/// Writes the results of a shot; returns facts about them, and a warning if many pixels are saturated.
fn write_shot(
    request: &Request,
    camera: &Camera,
    name: &str,
    taken: &Taken,
) -> Result<(Facts, Option<String>), JobError> {
    let (sensor, white_e) = (&camera.body().sensor, camera.body().exposure.white_e);
    let share = saturated_share(&taken.raw, sensor);
    let saturation = highlights::Saturation::of(request, sensor, white_e, share)?;
    let display_white = saturation.display_white();
    let formats = (request.raw_format, request.picture_format);
    let picture = (&taken.developed, display_white);
    let mut facts = output::write(formats, &request.out, name, &taken.raw, sensor, picture)?;
    for (key, value) in [
        ("white_e", json!(white_e)),
        ("saturated_share", json!(saturation.share)),
        ("display_white", json!(display_white)),
    ] {
        facts.insert(key.to_owned(), value);
    }
    Ok((facts, saturation.warning(request, sensor, name, white_e)))
}
