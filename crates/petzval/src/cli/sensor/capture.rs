//! `petzval sensor capture`: the calibration series of a sensor, simulated.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use petzval::built_in_assets;
use petzval::camera::emva::{Plan, write_series};
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
/// for the non-uniformity if asked for; all of them are listed in captures.toml, which `petzval sensor characterize`
/// reads. The light is weakened at higher gain, so that the longest exposure fills the same share of the range. A
/// series that was interrupted goes on with the same command.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Sensor file, or a built-in name such as imx249-fitted
    sensor: String,
    /// Folder for the captures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Linear gains [default: those that the sensor offers; 1,1.77,3.16,5.62,10,17.78,31.62 if it can be set to any]
    #[arg(long, value_name = "G,G,...", value_delimiter = ',')]
    gains: Vec<f64>,
    /// Exposure times of flat and dark pairs, ms
    #[arg(long, value_name = "MS,MS,...", value_delimiter = ',', default_values_t = Plan::default().flat_ms)]
    exposures: Vec<f64>,
    /// Exposure times of dark pairs, ms
    #[arg(long, value_name = "MS,MS,...", value_delimiter = ',', default_values_t = Plan::default().dark_ms)]
    dark_exposures: Vec<f64>,
    /// Frames of the flat and the dark stack at the middle exposure; 0 for none
    #[arg(long, default_value_t = 0, value_name = "L")]
    stack: usize,
    /// Rows and columns of the frames, from the corner of the sensor; the whole sensor if it is left out
    #[arg(long, value_name = "HxW")]
    size: Option<String>,
    /// Signal of the brightest colour at the longest exposure as a share of the range; above 1 saturates
    #[arg(long, default_value_t = 0.6)]
    level: f64,
    /// Quantum efficiency (0..1) by which electrons are told as photons; without it the list states no photons
    #[arg(long, value_name = "QE")]
    quantum_efficiency: Option<f64>,
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
    let gains = match (&args.gains[..], &sensor.gain_steps[..]) {
        ([], []) => Plan::default().gains,
        ([], steps) => steps.to_vec(),
        (chosen, _) => chosen.to_vec(),
    };
    let plan = Plan {
        height,
        width,
        gains,
        flat_ms: args.exposures.clone(),
        dark_ms: args.dark_exposures.clone(),
        stack: args.stack,
        level: args.level,
        quantum_efficiency: args.quantum_efficiency,
        seed: args.seed,
        format: match args.format {
            Format::Tiff => "tiff".to_owned(),
            Format::Png => "png".to_owned(),
        },
    };
    plan.validate(&sensor).map_err(failure)?;
    if args.out.exists() && !args.out.is_dir() {
        Failure::folder(&args.out)?;
    }
    let frames = plan.points(&sensor).iter().map(|p| p.names.len()).sum();
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
