//! `petzval simulate` over the spectrum: spectral images, built-in scenes, and photographs under a given light.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use indicatif::{ProgressBar, ProgressStyle};
use petzval::built_in_assets;
use petzval::camera::develop::{correct_shading, develop};
use petzval::camera::image::{LinearImage, load_image};
use petzval::camera::render::{Placement, illumination_map};
use petzval::camera::sensor::{
    Capture, Exposure, Noise, NoiseMode, QuantumEfficiency, SensorError, SensorModel, expose,
};
use petzval::camera::spectral::file::{is_spectral, load_spectral};
use petzval::camera::spectral::{
    ColourMatrix, ElectronsError, Illuminant, PixelOptics, SceneKind, SpectralImage, Spectrum, SpectrumTable,
    ThreeBand, apply, band_weights, even_bands, fit_colour_matrix, upsample,
};
use petzval::design::assets::Assets;
use petzval::design::error::DesignError;
use petzval::design::light_path::SHADING_FLOOR;
use petzval::design::optics::PsfPlan;
use petzval::design::spectral_light::render_spectral;
use petzval::optics::lens::Lens;
use petzval::optics::paraxial::first_order;
use serde_json::{Value, json};

use super::{Camera, Failure, Place, camera, output, print_json, stem};

/// Bands of scenes and photographs lie within these wavelengths, um.
const BAND_RANGE_UM: (f64, f64) = (0.40, 0.70);
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
    /// Illuminance of the scene, lux; white is a matt white surface there [default: 500]
    #[arg(long, value_name = "LUX")]
    illuminance_lux: Option<f64>,
    /// Bands over 400..700 nm for scenes and photographs
    #[arg(long, default_value_t = 16, value_name = "N")]
    bands: usize,
    /// Quantum efficiency curves in place of the sensor's own: a file, or a built-in name (imx219, ov5647)
    #[arg(long, value_name = "CURVES")]
    qe: Option<String>,
    /// Transmission of the lens: a number in 0..1, or a CSV file of wavelengths in nm and transmission
    #[arg(long, value_name = "TAU")]
    transmission: Option<String>,
    /// Show the camera's own colours, white-balanced, without the matrix fitted to the ColorChecker
    #[arg(long)]
    no_colour_matrix: bool,
}

/// Whether a request is one over the spectrum.
pub fn wanted(args: &super::Args) -> bool {
    let over = &args.spectral;
    over.illuminant.is_some()
        || over.illuminance_lux.is_some()
        || over.qe.is_some()
        || over.transmission.is_some()
        || args.images.iter().any(|path| scene_name(path).is_some() || is_spectral(path))
}

/// The scene in `scene:NAME`.
pub fn scene_name(path: &Path) -> Option<&str> {
    path.to_str()?.strip_prefix(SCENE)
}

/// Light, optics and sensor that all images share.
struct Light {
    illuminant: Illuminant,
    lux: f64,
    optics: PixelOptics,
    bands_um: Vec<f64>,
    /// The sensor, balanced for the light.
    sensor: SensorModel,
    white: ThreeBand,
    matrix: Option<ColourMatrix>,
}

/// Runs the verb.
pub fn run(args: &super::Args) -> Result<ExitCode, Failure> {
    let assets = built_in_assets();
    let mut camera = camera(args)?;
    if let Some(curves) = &args.spectral.qe {
        let source = assets.text("quantum efficiency", "quantum-efficiency", curves)?;
        let read = QuantumEfficiency::from_toml(&source.text).map_err(DesignError::input(&source.path))?;
        camera.sensor.quantum_efficiency = Some(read);
    }
    let Some((lens, plan)) = camera.traced.take() else {
        return Err(Failure::input(
            "--psfs: measured PSFs are those of three colours, not of every wavelength",
            "name a lens with --lens, or leave the spectral scene, --illuminant, --illuminance-lux, --qe and --transmission",
        ));
    };
    let light = light(args, &camera, &lens, &assets)?;
    // Every image is read before anything is written.
    let scenes: Vec<(String, SpectralImage)> = args
        .images
        .iter()
        .map(|path| Ok((stem(path), scene(args, path, &camera, &light)?)))
        .collect::<Result<_, Failure>>()?;
    Failure::folder(&args.out)?;
    let bar = ProgressBar::new(scenes.iter().map(|(_, s)| s.bands() as u64).sum());
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] band {pos}/{len}, {eta} left") {
        bar.set_style(style);
    }
    let mut written = Vec::new();
    for (frame, (name, scene)) in scenes.iter().enumerate() {
        bar.set_message(name.clone());
        written.push(take(args, &camera, (&lens, &plan), &light, name, scene, frame as u64, &bar)?);
    }
    bar.finish_and_clear();
    if args.json {
        return print_json(&json!(written));
    }
    eprintln!(
        "white under {} lux of {} gives {:.0} electrons in {} at f/{:.2} and {} s",
        light.lux,
        light.illuminant.name,
        light.white.white_e(),
        if light.white.rows.len() > 1 { "a green pixel" } else { "a pixel" },
        light.optics.f_number,
        args.time_s,
    );
    if let Some(matrix) = light.matrix.as_ref().filter(|_| !args.spectral.no_colour_matrix) {
        eprintln!(
            "the colour matrix shows the ColorChecker with a mean dE*ab of {:.1}, at most {:.1}",
            matrix.mean_delta_e, matrix.worst_delta_e
        );
    }
    for w in &written {
        println!("{}\n{}", w["raw"].as_str().unwrap_or(""), w["developed"].as_str().unwrap_or(""));
    }
    Ok(ExitCode::SUCCESS)
}

/// Checks the request and prepares what all images share.
fn light(args: &super::Args, camera: &Camera, lens: &Lens, assets: &Assets) -> Result<Light, Failure> {
    let over = &args.spectral;
    let lux = over.illuminance_lux.unwrap_or(500.0);
    if !(lux > 0.0 && lux <= 1e9) {
        return Err(Failure::input(
            format!("--illuminance-lux {lux}: not between 0 and 1e9"),
            "an office has 500 lux",
        ));
    }
    if !(2..=401).contains(&over.bands) {
        return Err(Failure::input(
            format!("--bands {}: not within 2..401", over.bands),
            "16 bands are 20 nm apart",
        ));
    }
    let illuminant = illuminant(over.illuminant.as_deref().unwrap_or("D65"))?;
    let transmission = over.transmission.as_deref().map(transmission).transpose()?;
    let f_number = first_order(&lens.at_wavelength(lens.reference_um)).f_number.abs();
    let optics = PixelOptics {
        pixel_um: camera.sensor.pixel_um,
        f_number,
        time_s: f64::from(args.time_s),
        transmission,
    };
    let bands_um = even_bands(BAND_RANGE_UM.0, BAND_RANGE_UM.1, over.bands);
    let no_curves = |error: ElectronsError| match error {
        ElectronsError::NoCurves(_) | ElectronsError::NoCurve(_) => Failure::input(
            error.to_string(),
            format!(
                "give the curves as [quantum_efficiency] in the sensor file, or with --qe ({} are built in)",
                assets.names("quantum-efficiency").join(", ")
            ),
        ),
        other => Failure::from(DesignError::from(other)),
    };
    let white = ThreeBand::new(&camera.sensor, &optics, &illuminant, lux, &bands_um).map_err(no_curves)?;
    let sensor = white.balanced(&camera.sensor);
    sensor.validate().map_err(|e| DesignError::from(SensorError::from(e)))?;
    let matrix = fit_colour_matrix(&camera.sensor, &illuminant).map_err(DesignError::from)?;
    Ok(Light { illuminant, lux, optics, bands_um, sensor, white, matrix })
}

/// A light by name, or the only curve of a file.
fn illuminant(name: &str) -> Result<Illuminant, Failure> {
    if !Path::new(name).is_file() {
        return Ok(Illuminant::named(name).map_err(DesignError::from)?);
    }
    Ok(Illuminant::from_spectrum(name, curve(name)?).map_err(DesignError::from)?)
}

fn transmission(text: &str) -> Result<Spectrum, Failure> {
    let hint = "a number in 0..1, or a CSV file with a head line `wavelength_nm,transmission`";
    let wrong = |what: String| Failure::input(format!("--transmission {text}: {what}"), hint);
    let curve = match text.parse::<f64>() {
        Ok(tau) => Spectrum::new(vec![0.01, 100.0], vec![tau, tau]).map_err(|e| wrong(e.to_string()))?,
        Err(_) => curve(text)?,
    };
    if curve.value().iter().any(|tau| !(0.0..=1.0).contains(tau)) {
        return Err(wrong("a transmission outside 0..1".to_owned()));
    }
    Ok(curve)
}

/// The first curve of a CSV file.
fn curve(path: &str) -> Result<Spectrum, Failure> {
    let path = PathBuf::from(path);
    let text = std::fs::read_to_string(&path)
        .map_err(|e| Failure::input(format!("{}: {e}", path.display()), "give a CSV file that exists"))?;
    let table = SpectrumTable::parse(&text).map_err(DesignError::input(&path))?;
    let first = table.curves.into_iter().next();
    first
        .map(|(_, curve)| curve)
        .ok_or_else(|| Failure::input(format!("{}: no curve", path.display()), "one column"))
}

/// The radiance of one image on the pixels of the sensor.
fn scene(args: &super::Args, path: &Path, camera: &Camera, light: &Light) -> Result<SpectralImage, Failure> {
    let (height, width) = (camera.sensor.height, camera.sensor.width);
    let placed = |picture: &LinearImage| match args.place {
        Place::Fill => picture.cover(height, width),
        Place::Centre => picture.centred(height, width),
    };
    if let Some(name) = scene_name(path) {
        let kind = SceneKind::named(name).ok_or_else(|| {
            let known = SceneKind::ALL.map(SceneKind::name).join(", scene:");
            Failure::input(format!("no scene called `{name}`"), format!("there are scene:{known}"))
        })?;
        return Ok(kind.draw(height, width).under(&light.illuminant, light.lux, &light.bands_um));
    }
    if !is_spectral(path) {
        let photo = placed(&load_image(path).map_err(DesignError::from)?);
        return Ok(upsample(&photo, &light.illuminant, light.lux, &light.bands_um));
    }
    let image = load_spectral(path).map_err(DesignError::from)?;
    let mut data = Vec::with_capacity(image.bands() * height * width);
    for first in (0..image.bands()).step_by(3) {
        let (planes, bands) = image.three_bands(first);
        let planes = placed(&planes);
        for (k, _) in bands.into_iter().enumerate().filter(|(k, band)| *band == first + k) {
            data.extend_from_slice(planes.plane(k));
        }
    }
    Ok(SpectralImage { wavelength_um: image.wavelength_um, height, width, data })
}

/// Takes one image and writes its raw frame and its developed picture.
fn take(
    args: &super::Args,
    camera: &Camera,
    (lens, plan): (&Lens, &PsfPlan),
    light: &Light,
    name: &str,
    scene: &SpectralImage,
    frame: u64,
    bar: &ProgressBar,
) -> Result<Value, Failure> {
    let (height, width) = (camera.sensor.height, camera.sensor.width);
    let placement = Placement { row: 0, col: 0 };
    let weights =
        band_weights(&camera.sensor, &light.optics, &scene.wavelength_um).map_err(DesignError::from)?;
    let done = |_band: usize| bar.inc(1);
    let electrons = render_spectral(lens, plan, &camera.geometry, scene, &weights, placement, &done)?;
    let white_e = light.white.white_e();
    let seen = electrons.as_light(&light.sensor, white_e, placement);
    let exposure = Exposure { white_e: white_e as f32, time_s: args.time_s, linear_gain: args.gain };
    let capture = Capture { exposure, placement, frame };
    let mode = if args.no_noise { NoiseMode::Off } else { NoiseMode::Exact };
    let raw = expose(&seen, &light.sensor, &capture, &Noise { mode, seed: args.seed })
        .map_err(DesignError::from)?;

    // Development balances white for the light, corrects the shading and turns camera colours into those of a display.
    let layout = camera.bank.layout();
    let map =
        illumination_map(&camera.geometry, &layout, &camera.bank.illumination, placement, height, width)
            .map_err(DesignError::from)?;
    let developed = develop(&raw, &light.sensor).map_err(DesignError::from)?;
    let mut developed = correct_shading(&developed, &map, SHADING_FLOOR).map_err(DesignError::from)?;
    let matrix = light.matrix.as_ref().filter(|_| !args.spectral.no_colour_matrix);
    if let Some(matrix) = matrix {
        let n = height * width;
        for i in 0..n {
            let camera_rgb = [0, 1, 2].map(|c| f64::from(developed.data[c * n + i]));
            for (c, value) in apply(&matrix.matrix, camera_rgb).into_iter().enumerate() {
                developed.data[c * n + i] = value as f32;
            }
        }
    }

    let white_of: serde_json::Map<String, Value> = light
        .white
        .rows
        .iter()
        .map(|(colour, row)| (colour.letter().to_string(), json!(row.iter().sum::<f64>())))
        .collect();
    let mut facts = output::write(&args.formats, &args.out, name, &raw, &light.sensor, &developed)?;
    let under = json!({
        "illuminant": light.illuminant.name,
        "illuminance_lux": light.lux,
        "f_number": light.optics.f_number,
        "time_s": args.time_s,
        "bands_um": scene.wavelength_um,
        "white_e": white_e,
        "white_e_by_colour": white_of,
        "relative_qe": light.sensor.relative_qe,
        "colour_matrix": matrix.map(|m| json!({
            "linear_srgb_from_camera": m.matrix,
            "mean_delta_e_1976": m.mean_delta_e,
            "worst_delta_e_1976": m.worst_delta_e,
        })),
    });
    if let Value::Object(under) = under {
        facts.extend(under);
    }
    Ok(json!(facts))
}
