//! `petzval sensor capture`: simulates the calibration series of a sensor.

use std::path::PathBuf;

use crate::jobs::sensor::capture;

use crate::cli::choice::choice;
use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::terminal::{Terminal, print_response};

/// Simulate a calibration series.
///
/// The series has pairs of flat and of dark frames at every gain and exposure time, further dark pairs for the dark
/// current, and stacks for the non-uniformity. captures.toml lists all frames for `petzval sensor characterize`. The
/// light is weakened at higher gain, so that the longest exposure fills the same share of the range. The same command
/// continues an interrupted series.
///
/// Without options it is the series of Tseng et al. (2021) for the fit over gains: seven gains, four exposures below
/// saturation, no stacks. With --emva it is the series that EMVA 1288 release 4.0 Linear prescribes, which gives all
/// figures of the standard.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Sensor file, or a built-in name such as imx249-fitted (`petzval sensor list`)
    sensor: String,
    /// Folder for the captures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Simulate the series of EMVA 1288: one gain, 50 or more equal steps of exposure to beyond saturation, a long dark
    /// series, and stacks of 100 frames. Photons follow from the sensor's curve at its peak or at --wavelength, or from
    /// --quantum-efficiency
    #[arg(long)]
    emva: bool,
    /// Linear gains [default: the gain steps of the sensor, or 1,1.77,3.16,5.62,10,17.78,31.62 if it has none; with
    /// --emva the one nearest to 1]
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
    /// Rows and columns of the frames, from the corner of the sensor [default: the whole sensor]
    #[arg(long, value_name = "HxW")]
    size: Option<String>,
    /// Signal of the brightest colour at the longest exposure as a share of the range; above 1 saturates [default: 0.6;
    /// with --emva 1.2, or more so that a weaker colour saturates too]
    #[arg(long, allow_negative_numbers = true)]
    level: Option<f64>,
    /// Quantum efficiency (0..1) of green or clear pixels, which converts electrons to photons
    #[arg(long, value_name = "QE")]
    quantum_efficiency: Option<f64>,
    /// Wavelength of the light, um. The sensor's curves at this wavelength give the photons and the response of each
    /// colour, unless --quantum-efficiency is given
    #[arg(long, value_name = "UM")]
    wavelength: Option<f64>,
    /// Format of the frames
    #[arg(long, value_parser = choice::<capture::Format>(), default_value = word(capture::Request::default().format))]
    format: capture::Format,
    /// Seed of the noise
    #[arg(long, default_value_t = capture::Request::default().seed)]
    seed: u64,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Rows and columns of a text such as `600x960`.
fn rows_and_columns(size: &str) -> Result<[usize; 2], Failure> {
    let parse =
        |(rows, columns): (&str, &str)| Some([rows.trim().parse().ok()?, columns.trim().parse().ok()?]);
    size.split_once(['x', 'X']).and_then(parse).ok_or_else(|| {
        Failure::input(format!("--size {size}: not a size"), "rows x columns, such as 600x960")
    })
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = capture::Request {
        size: args.size.as_deref().map(rows_and_columns).transpose()?,
        sensor: args.sensor.into(),
        out: args.out,
        emva: args.emva,
        gains: args.gains,
        exposures: args.exposures,
        dark_exposures: args.dark_exposures,
        stack: args.stack,
        level: args.level,
        quantum_efficiency: args.quantum_efficiency,
        wavelength: args.wavelength,
        format: args.format,
        seed: args.seed,
    };
    let written = capture::run(&request, &terminal.context())?;
    print_response(args.json, &written, || {
        outln!("{}", shown(&written.list));
        if written.kept > 0 {
            noteln!("{} of {} frames already existed", written.kept, written.frames);
        }
    })
}
