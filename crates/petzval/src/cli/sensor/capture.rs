//! `petzval sensor capture`: the calibration series of a sensor, simulated.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use petzval::built_in_assets;
use petzval::lab::emva::{Plan, write_series};
use serde_json::json;

use super::{failure, frames_bar};
use crate::cli::{Failure, print_json};

/// Kind of the frames' files.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// 16-bit TIFF
    Tiff,
    /// 16-bit PNG: a third of the size, slower
    Png,
}

/// Simulate the calibration series of a sensor.
///
/// Pairs of flat and of dark frames at every gain and exposure time, further dark pairs for the dark current, and stacks
/// for the non-uniformity; all of them are listed in captures.toml, which `petzval sensor characterize` reads. The light is
/// weakened at higher gain, so that the longest exposure fills the same share of the range. A series that was interrupted
/// goes on with the same command.
///
/// Without options it is the series of Tseng et al. (2021), which is made for the fit over gains: seven gains, four exposures
/// below saturation, no stacks. With --emva it is what EMVA 1288 release 4.0 Linear asks for, and fills its whole sheet. Every
/// other option changes that series.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Sensor file, or a built-in name such as imx249-fitted (`petzval sensor list`)
    sensor: String,
    /// Folder for the captures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The series of EMVA 1288: one gain, 50 or more equal steps of exposure beyond saturation, a long dark series, and
    /// stacks of 100 frames; photons by the sensor's curve at its peak or at --wavelength, or by --quantum-efficiency
    #[arg(long)]
    emva: bool,
    /// Linear gains [default: those that the sensor offers; 1,1.77,3.16,5.62,10,17.78,31.62 if it can be set to any; with --emva
    /// the one nearest to 1]
    #[arg(long, value_name = "G,G,...", value_delimiter = ',')]
    gains: Vec<f64>,
    /// Exposure times of flat and dark pairs, ms [default: 2.5,5,7.5,10; with --emva steps of 0.5]
    #[arg(long, value_name = "MS,MS,...", value_delimiter = ',')]
    exposures: Option<Vec<f64>>,
    /// Exposure times of dark pairs, ms [default: 2.5 to 30 in steps of 2.5; with --emva ten, the longest by the dark current]
    #[arg(long, value_name = "MS,MS,...", value_delimiter = ',')]
    dark_exposures: Option<Vec<f64>>,
    /// Frames of the flat and the dark stack, at the exposure nearest to half of the range; 0 for none [default: 0; with
    /// --emva 100]
    #[arg(long, value_name = "L")]
    stack: Option<usize>,
    /// Rows and columns of the frames, from the corner of the sensor; the whole sensor if it is left out
    #[arg(long, value_name = "HxW")]
    size: Option<String>,
    /// Signal of the brightest colour at the longest exposure as a share of the range; above 1 saturates [default: 0.6; with
    /// --emva 1.2, and more where a weaker colour is to saturate too]
    #[arg(long, allow_negative_numbers = true)]
    level: Option<f64>,
    /// Quantum efficiency (0..1) of green or clear pixels, by which electrons are told as photons
    #[arg(long, value_name = "QE")]
    quantum_efficiency: Option<f64>,
    /// Wavelength of the light, um; the sensor's curves there give the photons and the response of each colour, unless
    /// --quantum-efficiency states it
    #[arg(long, value_name = "UM")]
    wavelength: Option<f64>,
    /// Kind of the files
    #[arg(long, value_enum, default_value = "tiff")]
    format: Format,
    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Bytes of a series from which on the message names a smaller one.
const LARGE_BYTES: u64 = 500_000_000;
/// Rows and columns of the smaller one.
const SMALLER: (usize, usize) = (300, 480);

/// Says on stderr how large the series will be, before it is written, and what it lacks.
fn told_before(plan: &Plan, frames: usize, bytes: u64) {
    let megabytes = |bytes: u64| (bytes as f64 / 1e6).ceil();
    let most = if plan.format == "tiff" { "" } else { "at most " };
    let (height, width) = SMALLER;
    let smaller = bytes / (plan.height * plan.width) as u64 * (height * width) as u64;
    let instead = match bytes > LARGE_BYTES && smaller < bytes {
        true => format!("; --size {height}x{width} takes {} MB", megabytes(smaller)),
        false => String::new(),
    };
    eprintln!("{frames} frames, {most}{} MB{instead}", megabytes(bytes));
    if plan.quantum_efficiency.is_none() && plan.wavelength_um.is_none() {
        eprintln!(
            "the list states no photons; --quantum-efficiency QE gives them, or --wavelength UM where the sensor file has curves"
        );
    }
}

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let sensor = built_in_assets().sensor(&args.sensor)?;
    let (height, width) = match &args.size {
        None => (sensor.height, sensor.width),
        Some(size) => size
            .split_once(['x', 'X'])
            .and_then(|(h, w)| Some((h.trim().parse().ok()?, w.trim().parse().ok()?)))
            .ok_or_else(|| {
                Failure::input(format!("--size {size}: no size"), "rows x columns, such as 600x960")
            })?,
    };
    let preset = match args.emva {
        true => Plan::emva(&sensor, args.quantum_efficiency, args.wavelength),
        false => {
            let gains = match &sensor.gain_steps[..] {
                [] => Plan::default().gains,
                steps => steps.to_vec(),
            };
            let (quantum_efficiency, wavelength_um) = (args.quantum_efficiency, args.wavelength);
            Plan { gains, quantum_efficiency, wavelength_um, ..Plan::default() }
        }
    };
    let plan = Plan {
        height,
        width,
        gains: if args.gains.is_empty() { preset.gains } else { args.gains.clone() },
        flat_ms: args.exposures.clone().unwrap_or(preset.flat_ms),
        dark_ms: args.dark_exposures.clone().unwrap_or(preset.dark_ms),
        stack: args.stack.unwrap_or(preset.stack),
        level: args.level.unwrap_or(preset.level),
        seed: args.seed,
        format: match args.format {
            Format::Tiff => "tiff".to_owned(),
            Format::Png => "png".to_owned(),
        },
        ..preset
    };
    plan.validate(&sensor).map_err(failure)?;
    if args.out.exists() && !args.out.is_dir() {
        Failure::folder(&args.out)?;
    }
    let points = plan.points(&sensor).map_err(failure)?;
    let frames = points.iter().map(|p| p.names.len()).sum();
    told_before(&plan, frames, plan.bytes(&points));
    let bar = frames_bar(frames, "exposing");
    let written = write_series(&sensor, &plan, &args.out, &|| bar.inc(1)).map_err(failure)?;
    bar.finish_and_clear();
    if args.json {
        return print_json(&json!(written));
    }
    println!("{}", written.list.display());
    if written.kept > 0 {
        eprintln!("{} of {} frames were there already", written.kept, written.frames);
    }
    Ok(ExitCode::SUCCESS)
}
