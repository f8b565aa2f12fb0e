//! `petzval simulate` over the spectrum: spectral images, built-in scenes, and photographs under a given light.

mod light;
mod request;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use indicatif::ProgressBar;
use petzval::camera::image::LinearImage;
use petzval::camera::spectral::{ColourElectrons, SceneKind, SpectralScene};
use petzval::design::error::DesignError;
use petzval::design::spectral_light::{Bands, render_spectral};
use petzval::files::load_image;
use petzval::files::spectral_file::{is_spectral, load_spectral};
use serde_json::{Value, json};

use self::light::Light;
use self::request::Request;
use super::{
    Args, Camera, Failure, Shot, camera, finish, placed, print_json, print_paths, progress_bar, stem,
    through_lens,
};

/// What the name of a built-in scene begins with.
const SCENE: &str = "scene:";

/// The light, and how finely its spectrum is taken.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Over the spectrum")]
pub struct SpectralArgs {
    /// Light on the scene: D65, A, FL11, LED-B3, ..., daylight:KELVIN, blackbody:KELVIN, or a CSV file of wavelengths in nm and
    /// relative power [default: D65]
    #[arg(long, value_name = "LIGHT")]
    illuminant: Option<String>,
    /// Illuminance of the scene, lux; white is a matt white surface there [default: 500, or as --white-e needs]
    #[arg(long, value_name = "LUX")]
    illuminance_lux: Option<f64>,
    /// Bands for scenes and photographs, over the wavelengths at which light, lens and sensor all have something [default: 16,
    /// more where these would be over 20 nm apart]
    #[arg(long, value_name = "N")]
    bands: Option<usize>,
    /// Quantum efficiency curves in place of the sensor's own: a built-in name (imx219, ov5647), flat:VALUE for one efficiency
    /// at all wavelengths, or a file: CSV with a head line `wavelength_nm,red,green,blue` or `wavelength_nm,clear` and
    /// efficiencies of 0 to 1, or TOML with the keys of [quantum_efficiency] in a sensor file
    #[arg(long, value_name = "CURVES")]
    qe: Option<String>,
    /// Transmission of the lens: a number in 0..1, or a CSV file of wavelengths in nm and transmission
    #[arg(long, value_name = "TAU")]
    transmission: Option<String>,
    /// Take photographs the fast way: red, green and blue through three PSFs, then electrons by a 3x3 matrix
    #[arg(long, conflicts_with = "bands")]
    three_band: bool,
    /// Show the camera's own colours, white-balanced, without the matrix fitted to the ColorChecker
    #[arg(long)]
    no_colour_matrix: bool,
}

/// Whether a request is one over the spectrum.
pub fn wanted(args: &Args) -> bool {
    let over = &args.spectral;
    over.illuminant.is_some()
        || over.illuminance_lux.is_some()
        || over.bands.is_some()
        || over.qe.is_some()
        || over.transmission.is_some()
        || over.three_band
        || over.no_colour_matrix
        || args.images.iter().any(|path| kind(path) != Kind::Photo)
}

/// The scene in `scene:NAME`.
pub fn scene_name(path: &Path) -> Option<&str> {
    path.to_str()?.strip_prefix(SCENE)
}

/// What a name on the command line stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Scene,
    Spectral,
    Photo,
}

fn kind(path: &Path) -> Kind {
    match path {
        path if scene_name(path).is_some() => Kind::Scene,
        path if is_spectral(path) => Kind::Spectral,
        _ => Kind::Photo,
    }
}

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    check(args)?;
    let mut camera = camera(args)?;
    let mut request = Request::new(args, &mut camera)?;
    let mut shared = Light::over_all(args, &request, &camera)?;
    if let Some(white_e) = args.white_e {
        // Electrons are proportional to the illuminance.
        request.lux *= f64::from(white_e) / shared.white.white_e();
        shared = Light::over_all(args, &request, &camera)?;
    }
    // Every image is read before anything is written; only one of them at a time is in memory.
    let mut first = None;
    for path in &args.images {
        first = Some(open(args, path, &request, &camera, &shared)?);
    }
    first = first.filter(|_| args.images.len() == 1);
    if args.images.iter().any(|path| kind(path) != Kind::Spectral) {
        shared.warn(&request, &camera, None);
    }
    Failure::folder(&args.out)?;
    let bar = progress_bar(0, "band {pos}/{len}");
    let mut written = Vec::new();
    let mut last_said = String::new();
    for (frame, path) in args.images.iter().enumerate() {
        let (opened, own) = match first.take() {
            Some(opened) => opened,
            None => open(args, path, &request, &camera, &shared)?,
        };
        let light = own.as_ref().unwrap_or(&shared);
        if let Some(own) = &own {
            bar.suspend(|| own.warn(&request, &camera, Some(path)));
        }
        let name = stem(path);
        bar.set_message(name.clone());
        let electrons = match &opened {
            Opened::Bands(scene) => over_bands(args, &camera, &request, light, scene, &bar),
            Opened::ThreeBands(photo) => in_three_bands(&camera, light, photo),
        }
        .map_err(|error| named(path, error))?;
        let white_e = light.white.white_e();
        let matrix = light.matrix.as_ref().filter(|_| !args.spectral.no_colour_matrix);
        let shot = Shot {
            name: &name,
            frame: frame as u64,
            light: electrons.as_light(&light.sensor, white_e, camera.window.placement),
            white_e: white_e as f32,
            sensor: &light.sensor,
            matrix: matrix.map(|m| &m.matrix),
        };
        let (mut facts, warning) = finish(args, &camera, &shot)?;
        warning.into_iter().for_each(|warning| bar.suspend(|| eprintln!("{warning}")));
        facts.extend(light.facts(args, &request));
        written.push(Value::Object(facts));
        let says = light.says(args, &request);
        if !args.json && says != last_said {
            bar.suspend(|| eprintln!("{says}"));
            last_said = says;
        }
    }
    bar.finish_and_clear();
    if args.json {
        return print_json(&json!(written));
    }
    print_paths(&written);
    Ok(ExitCode::SUCCESS)
}

/// Options that fit neither a run over the spectrum nor each other.
fn check(args: &Args) -> Result<(), Failure> {
    for name in args.images.iter().filter_map(|path| scene_name(path)) {
        scene(name)?;
    }
    let first = |wanted: Kind| args.images.iter().find(|path| kind(path) == wanted);
    if let (Some(bands), Some(file)) = (args.spectral.bands, first(Kind::Spectral)) {
        return Err(Failure::input(
            format!("--bands {bands}: {} has bands of its own", file.display()),
            "leave --bands out, or simulate scenes and photographs apart from spectral images",
        ));
    }
    if let (Some(white_e), Some(file)) = (args.white_e, first(Kind::Spectral)) {
        return Err(Failure::input(
            format!("--white-e {white_e}: {} has radiances of its own", file.display()),
            "leave --white-e out; --time-s and --gain set the exposure",
        ));
    }
    if let (Some(white_e), Some(lux)) = (args.white_e, args.spectral.illuminance_lux) {
        return Err(Failure::input(
            format!(
                "--white-e {white_e}: --illuminance-lux {lux} says already how many electrons white gives"
            ),
            "leave one of the two out",
        ));
    }
    let spectral = first(Kind::Scene).or_else(|| first(Kind::Spectral));
    if let Some(path) = spectral.filter(|_| args.spectral.three_band) {
        return Err(Failure::input(
            format!("--three-band: {} is no photograph of three bands", path.display()),
            "leave --three-band out, or give photographs",
        ));
    }
    if let Some(bands) = args.spectral.bands.filter(|bands| !(2..=401).contains(bands)) {
        return Err(Failure::input(
            format!("--bands {bands}: not within 2..401"),
            "16 bands are 20 nm apart over 400..700 nm",
        ));
    }
    Ok(())
}

/// The built-in scene of a name.
fn scene(name: &str) -> Result<SceneKind, Failure> {
    SceneKind::named(name).ok_or_else(|| {
        let known = SceneKind::ALL.map(SceneKind::name).join(", scene:");
        Failure::input(format!("no scene called `{name}`"), format!("there are scene:{known}"))
    })
}

/// What is taken: a scene over its bands, or a photograph on the sensor in three.
enum Opened {
    Bands(SpectralScene),
    ThreeBands(LinearImage),
}

/// What an image holds, and its light if its bands are its own.
fn open(
    args: &Args,
    path: &Path,
    request: &Request,
    camera: &Camera,
    shared: &Light,
) -> Result<(Opened, Option<Light>), Failure> {
    let (illuminant, lux, band_um) = (&request.illuminant, request.lux, &shared.band_um);
    if let Some(name) = scene_name(path) {
        let drawn = scene(name)?.draw(camera.sensor.height, camera.sensor.width);
        return Ok((Opened::Bands(SpectralScene::surfaces(drawn, illuminant, lux, band_um)), None));
    }
    if kind(path) == Kind::Spectral {
        let image = load_spectral(path).map_err(DesignError::from)?;
        let light = Light::in_file(args, request, camera, path, &image.wavelength_um)?;
        return Ok((Opened::Bands(SpectralScene::image(image)), Some(light)));
    }
    let photo = placed(args, &load_image(path).map_err(DesignError::from)?, &camera.sensor);
    let opened = match args.spectral.three_band {
        true => Opened::ThreeBands(photo),
        false => Opened::Bands(SpectralScene::print(photo, illuminant, lux, band_um)),
    };
    Ok((opened, None))
}

/// Electrons of a scene whose bands go through the lens one by one.
fn over_bands(
    args: &Args,
    camera: &Camera,
    request: &Request,
    light: &Light,
    scene: &SpectralScene,
    bar: &ProgressBar,
) -> Result<ColourElectrons, DesignError> {
    let bands = Bands {
        um: &scene.band_um,
        weights: &light.weights,
        planes: &|three| placed(args, &scene.planes(three), &camera.sensor),
    };
    bar.set_length(bands.seen().len() as u64);
    bar.set_position(0);
    let done = |_band: usize| bar.inc(1);
    render_spectral(&request.lens, &request.plan, &camera.geometry, &bands, camera.window, &done)
}

/// Electrons of a photograph whose three planes go through the lens: the matrix is the integral over the spectrum, only the
/// PSFs are those of three wavelengths.
fn in_three_bands(
    camera: &Camera,
    light: &Light,
    photo: &LinearImage,
) -> Result<ColourElectrons, DesignError> {
    Ok(ColourElectrons::of_rgb(&through_lens(camera, photo)?, &light.white))
}

/// A failure with the name of the scene in which it arose.
fn named(path: &Path, error: DesignError) -> Failure {
    if !error.is_input() {
        return error.into();
    }
    let hint = "the lens is traced at the wavelength of each band to which the sensor answers: check the focus, and the bands of the scene";
    Failure::input(format!("{}: {error}", path.display()), hint)
}

/// A file that is named on the command line, as text.
fn read(path: &str) -> Result<(PathBuf, String), Failure> {
    let path = PathBuf::from(path);
    let text = std::fs::read_to_string(&path)
        .map_err(|e| Failure::input(format!("{}: {e}", path.display()), "give a CSV file that exists"))?;
    Ok((path, text))
}
