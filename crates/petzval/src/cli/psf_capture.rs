//! `petzval psf-capture`: simulates captures of a pinhole in a laboratory.

use std::path::{Path, PathBuf};

use crate::base::pasted;
use crate::cli::code::Code;
use crate::jobs::psf_capture::{self, Axis, Focus};

use super::choice::choice;
use super::defaults::{numbers, word, words};
use super::failure::Failure;
use super::plain::shown;
use super::terminal::{Terminal, print_json};

/// Simulate captures of a pinhole: frames and their manifest, ready for psf-calibrate.
///
/// A pinhole lit by a white diode of 4900 K is placed at field radii along the vertical, horizontal and diagonal of the
/// sensor; fields beyond the sensor are left out. The camera turns towards the source. At each position frames are
/// taken at several exposure times with the sensor's noise; only a window around the source is written. The source is
/// adjusted so that the brightest pixel of all positions, behind its own colour filter, is at --peak of the range at
/// the longest time. A folder that holds captures is not changed.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    lens: String,
    /// Folder for the captures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Sensor file, or a built-in name
    #[arg(long, default_value = word(psf_capture::Request::default().sensor))]
    sensor: String,
    /// Distance of the pinhole from the lens, mm
    #[arg(long, default_value_t = psf_capture::Request::default().distance_mm)]
    distance_mm: f64,
    /// Diameter of the pinhole, um; its image may be at most a pixel wide
    #[arg(long, default_value_t = psf_capture::Request::default().pinhole_um, allow_negative_numbers = true)]
    pinhole_um: f64,
    /// Focus of the lens
    #[arg(long, value_parser = choice::<Focus>(), default_value = word(psf_capture::Request::default().focus))]
    focus: Focus,
    /// Fields from the axis to --radius-mm
    #[arg(long, default_value_t = psf_capture::Request::default().fields)]
    fields: usize,
    /// Image radius of the last field, mm
    #[arg(long, default_value_t = psf_capture::Request::default().radius_mm)]
    radius_mm: f64,
    /// Directions in which the source is moved
    #[arg(
        long,
        value_parser = choice::<Axis>(),
        value_name = "AXIS,AXIS,...",
        value_delimiter = ',',
        default_value = words(&psf_capture::Request::default().axes)
    )]
    axes: Vec<Axis>,
    /// Exposure times, ms, the shortest first
    #[arg(long, value_name = "MS,MS,...", value_delimiter = ',', default_value = numbers(&psf_capture::Request::default().exposures_ms))]
    exposures_ms: Vec<f64>,
    /// Frames of each exposure time
    #[arg(long, default_value_t = psf_capture::Request::default().frames)]
    frames: usize,
    /// Dark frames of each exposure time and place
    #[arg(long, default_value_t = psf_capture::Request::default().dark_frames)]
    dark_frames: usize,
    /// Brightest pixel at the longest exposure, relative to the range of the converter or the full well, whichever is
    /// less; above 1 it clips
    #[arg(long, default_value_t = psf_capture::Request::default().peak)]
    peak: f64,
    /// Pixels a side of the window that is written
    #[arg(long, default_value_t = psf_capture::Request::default().window)]
    window: usize,
    /// Seed of the noise and of the error of alignment (up to half a pixel)
    #[arg(long, default_value_t = psf_capture::Request::default().seed)]
    seed: u64,
    /// Print the captures as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = psf_capture::Request {
        lens: args.lens.into(),
        out: args.out,
        sensor: args.sensor.into(),
        distance_mm: args.distance_mm,
        pinhole_um: args.pinhole_um,
        focus: args.focus,
        fields: args.fields,
        radius_mm: args.radius_mm,
        axes: args.axes,
        exposures_ms: args.exposures_ms,
        frames: args.frames,
        dark_frames: args.dark_frames,
        peak: args.peak,
        window: args.window,
        seed: args.seed,
    };
    let response = psf_capture::run(&request, &terminal.context())?;
    noteln!(
        "{} positions, {} frames in {}; measure them with `petzval psf-calibrate {} --lens {}`",
        response.captures.positions.len(),
        response.frames,
        shown(&request.out),
        pasted(&request.out),
        pasted(Path::new(&request.lens.to_string()))
    );
    if args.json { print_json(&response.captures) } else { Ok(Code::SUCCESS) }
}
