//! The camera of a simulation: PSFs on a sensor.

use std::path::Path;

use petzval::built_in_assets;
use petzval::camera::develop::develop;
use petzval::camera::image::{CHANNELS, LinearImage};
use petzval::camera::psf::PsfBank;
use petzval::camera::render::{Placement, RenderGeometry, Window, illumination_map, kernel_radius};
use petzval::camera::sensor::{Capture, Exposure, Noise, NoiseMode, SensorModel, expose};
use petzval::design::error::DesignError;
use petzval::design::optics::PsfPlan;
use petzval::jobs::JobError;
use petzval::lab::psf_calibration::PsfCalibrationError;
use petzval::lab::psf_calibration::manifest::MANIFEST_FILE;
use petzval::lab::psf_calibration::psf_file::{AXES_FILE, load_psfs};
use petzval::optics::lens::Lens;
use petzval::optics::psf::PsfOptions;
use petzval::optics::pupil::Quadrature;

use super::highlights::capacity_e;
use super::{Args, Failure};

/// Most pixels of a simulated frame: the largest sensors have 150 million, and each pixel takes about 100 bytes.
const MOST_PIXELS: usize = 200_000_000;

/// Everything that all photographs share.
pub struct Camera {
    pub geometry: RenderGeometry,
    pub bank: PsfBank,
    pub sensor: SensorModel,
    /// The pixels that are read.
    pub window: Window,
    /// Light that the PSFs need from outside the window, pixels.
    pub border: usize,
    /// Relative illumination of the window's pixels in three colours.
    pub illumination: LinearImage,
    /// The lens and how its PSFs are traced; none behind measured PSFs.
    pub traced: Option<(Lens, PsfPlan)>,
}

/// The camera that a command asks for.
pub fn camera(args: &Args) -> Result<Camera, Failure> {
    let assets = built_in_assets();
    let sensor = assets.sensor(&args.sensor)?;
    if sensor.height.saturating_mul(sensor.width) > MOST_PIXELS {
        return Err(Failure::input(
            format!("{}: a frame of {}x{} pixels", args.sensor, sensor.height, sensor.width),
            format!("`height` times `width` of the sensor may be at most {MOST_PIXELS}"),
        ));
    }
    rehearse(args, &sensor)?;
    let window = window(args, &sensor)?;
    let geometry = RenderGeometry {
        sensor_height: sensor.height,
        sensor_width: sensor.width,
        pixel_um: sensor.pixel_um,
        patches: (7, 7),
    };
    let (bank, traced) = match &args.psfs {
        Some(path) => (measured(path)?, None),
        None => {
            let lens = assets.lens(&args.lens)?.lens;
            let plan = plan(&sensor)?;
            (plan.bank(&lens)?, Some((lens, plan)))
        }
    };
    let border = kernel_radius(&geometry, &bank.layout()).map_err(DesignError::from)?;
    let Window { placement, height, width } = window;
    let illumination =
        illumination_map(&geometry, &bank.layout(), &bank.illumination, placement, height, width)
            .map_err(DesignError::from)?;
    Ok(Camera { geometry, bank, sensor, window, border, illumination, traced })
}

/// The pixels that are read: all, or those of --size in the middle.
fn window(args: &Args, sensor: &SensorModel) -> Result<Window, Failure> {
    let whole = (sensor.height, sensor.width);
    let (height, width) = args.size.unwrap_or(whole);
    let tile = (sensor.cfa.rows(), sensor.cfa.cols());
    let is_too_small = height < tile.0.max(2) || width < tile.1.max(2);
    Window::middle(whole, tile, height, width).filter(|_| !is_too_small).ok_or_else(|| {
        Failure::input(
            format!("--size {height}x{width}: no part of the sensor that can be developed"),
            format!("rows x columns, from a tile of the filter array to {}x{}", whole.0, whole.1),
        )
    })
}

/// The PSFs that --psfs names; of captures, says how PSFs come from them.
fn measured(path: &Path) -> Result<PsfBank, Failure> {
    let (results, list) = (path.join("psf-calibration"), path.join(MANIFEST_FILE));
    if list.is_file() && !path.join(AXES_FILE).is_file() {
        let hint = match results.join(AXES_FILE).is_file() {
            true => format!("the PSFs that were measured from them are in {}", results.display()),
            false => {
                format!(
                    "run `petzval psf-calibrate {}` first, then give {}",
                    path.display(),
                    results.display()
                )
            }
        };
        return Err(Failure::input(format!("--psfs {}: these are captures, not PSFs", path.display()), hint));
    }
    load_psfs(path).map_err(|error| match error {
        PsfCalibrationError::Io { path, error } if error.kind() == std::io::ErrorKind::NotFound => {
            Failure::input(
                format!("--psfs: {}: {error}", path.display()),
                "give a folder of results of `petzval psf-calibrate`, or its psfs.toml",
            )
        }
        other => JobError::from(other).into(),
    })
}

/// Takes and develops one dark tile of the filter array: what the sensor refuses, it refuses before a lens is traced and a
/// folder is made.
fn rehearse(args: &Args, sensor: &SensorModel) -> Result<(), Failure> {
    let side = |tile: usize, whole: usize| tile.max(2).min(whole);
    let (height, width) = (side(sensor.cfa.rows(), sensor.height), side(sensor.cfa.cols(), sensor.width));
    let exposure = Exposure { white_e: 1.0, time_s: args.time_s, linear_gain: args.gain };
    let capture = Capture { exposure, placement: Placement { row: 0, col: 0 }, frame: 0 };
    let dark = LinearImage::zeros(CHANNELS, height, width);
    let raw = expose(&dark, sensor, &capture, &Noise { mode: NoiseMode::Off, seed: 0 })
        .map_err(DesignError::from)?;
    develop(&raw, sensor).map_err(DesignError::from)?;
    capacity_e(args, sensor).map(|_| ())
}

/// PSFs at 13 fields from the centre of a sensor to its corner, in three colours.
fn plan(sensor: &SensorModel) -> Result<PsfPlan, Failure> {
    let corner_mm = 0.5e-3 * sensor.pixel_um * (sensor.height as f64).hypot(sensor.width as f64);
    let quadrature = Quadrature::grid(128).map_err(DesignError::from)?;
    Ok(PsfPlan::new(13, corner_mm, [0.62, 0.55, 0.486], PsfOptions::default(), quadrature))
}
