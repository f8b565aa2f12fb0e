//! `sensor capture`: the calibration series of a sensor, simulated.

use std::path::PathBuf;

use petzval_base::Cancel;
use petzval_camera::sensor::SensorModel;
use petzval_lab::emva::captures::CaptureError;
use petzval_lab::emva::{Plan, Written, write_series};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder};
use crate::frames;
use crate::input::SensorInput;
use crate::range::check_ranges;
use crate::state_file::{CAPTURES, lock_folder};

pub use petzval_lab::emva::{Series, SeriesFrame};

petzval_base::parameters! {
    /// The calibration series of a sensor: pairs of flat and of dark frames over gains and exposure times, further dark pairs for
    /// the dark current, and stacks for the non-uniformity, all listed in `captures.toml`.
    ///
    /// The same request continues a series that was interrupted. An empty field takes its value from the series that `emva`
    /// chooses.
    pub struct Request {
        /// Linear gains; if empty, those of the series.
        gains: Vec<f64> = Vec::new(), "", 0.001..1e4, Log, "linear gains: 2 doubles the digital numbers";
        /// Exposure times of flat and dark pairs, ms.
        exposures: Option<Vec<f64>> = None, "ms", 1e-6..1e6, Log, "5 ms is 5";
        /// Exposure times of dark pairs, ms.
        dark_exposures: Option<Vec<f64>> = None, "ms", 0.0..1e6, Linear, "5 ms is 5";
        /// Signal of the brightest colour at the longest exposure as a share of the range; above 1 it saturates.
        level: Option<f64> = None, "", 1e-4..10.0, Log, "0.6 stays below saturation; above 1 saturates";
        /// Quantum efficiency of green or clear pixels, 0 to 1, which converts electrons to photons.
        quantum_efficiency: Option<f64> = None, "", 1e-4..1.0, Linear, "a share: 60 % is 0.6";
        /// Wavelength of the light, um; the sensor's curves there give the photons and the response of each colour, unless
        /// `quantum_efficiency` is given.
        wavelength: Option<f64> = None, "um", 0.01..100.0, Log, "in um: 550 nm is 0.55";
    }
    also {
        /// Sensor: a built-in name, the path of a file, or the sensor itself.
        sensor: SensorInput = SensorInput::default();
        /// Folder for the captures.
        out: PathBuf = PathBuf::new();
        /// The series of EMVA 1288 release 4.0 Linear ([`Plan::emva`]) in place of that of Tseng et al. 2021
        /// ([`Plan::default`]).
        emva: bool = false;
        /// Frames of the flat and the dark stack; 0 for none.
        stack: Option<usize> = None;
        /// Rows and columns of the frames, from the corner of the sensor; by default the whole sensor.
        size: Option<[usize; 2]> = None;
        /// Format of the frames.
        format: Format = Format::Tiff;
        /// Seed of the noise.
        seed: u64 = crate::usual::seed();
    }
}

/// Format of the frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// 16-bit TIFF.
    Tiff,
    /// 16-bit PNG: a third of the size, slower.
    Png,
}

/// What was written.
pub type Response = Written;

/// A series of more bytes than this is reported together with a smaller one.
const LARGE_BYTES: u64 = 500_000_000;
/// Rows and columns of the smaller one.
const SMALLER: (usize, usize) = (300, 480);

/// The frames of a series as values, one at a time and in their order: only one of them is in memory. A cancelled job fails before the
/// next frame.
pub struct Frames {
    series: Series,
    next: usize,
    cancel: Cancel,
}

impl Frames {
    /// The series that is exposed.
    pub fn series(&self) -> &Series {
        &self.series
    }

    fn left(&self) -> usize {
        self.series.frames() - self.next
    }
}

impl Iterator for Frames {
    type Item = Result<SeriesFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.left() == 0 {
            return None;
        }
        let frame = match self.cancel.check() {
            Ok(()) => self.series.frame(self.next)?.map_err(JobError::from),
            Err(cancelled) => Err(cancelled.into()),
        };
        // Nothing follows a failure.
        self.next = if frame.is_ok() { self.next + 1 } else { self.series.frames() };
        Some(frame)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.left(), Some(self.left()))
    }
}

impl ExactSizeIterator for Frames {}

/// Exposes the series frame by frame; writes nothing. The folder of the request is not used.
pub fn frames(request: &Request, context: &Context) -> Result<Frames> {
    let (sensor, plan) = prepared(request, context)?;
    Ok(Frames { series: Series::new(&sensor, &plan)?, next: 0, cancel: context.cancel().clone() })
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit {
    out_in: Some(""),
    ..AsUnit::seeded(|request, seed| request.seed = seed, |request, folder| request.out = folder.to_owned())
};

/// Exposes and writes the frames that the folder does not hold yet, and lists all of them.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let (sensor, plan) = prepared(request, context)?;
    if request.out.exists() && !request.out.is_dir() {
        make_folder(&request.out)?;
    }
    let points = plan.points(&sensor)?;
    let total = points.iter().map(|p| p.names.len()).sum();
    note_size(&plan, total, plan.bytes(&points), context);
    if plan.quantum_efficiency.is_none() && plan.wavelength_um.is_none() {
        context.note(
            "the list states no photons; --quantum-efficiency QE gives them, or --wavelength UM where the sensor file has curves",
        );
    }
    // Nothing is made before the whole series is known to be possible.
    Series::new(&sensor, &plan)?;
    make_folder(&request.out)?;
    let _lock = lock_folder(&request.out, CAPTURES)?;
    let frames = frames::Frames::new(context, total);
    // The frames that are whole stay, and the same request goes on from them.
    let written = write_series(&sensor, &plan, &request.out, &|| frames.add("exposing"));
    let written = written.map_err(|error| match error {
        CaptureError::Stopped(_) => {
            let stopped = context.stopped(format!("stopped; the frames in {} stay", request.out.display()));
            stopped.keeping(&request.out).going_on_with(request).into()
        }
        other => JobError::from(other),
    })?;
    context.wrote(&written.list, "list of captures");
    Ok(written)
}

/// The sensor and the plan of its series, once every number is in its range and the sensor has every setting.
fn prepared(request: &Request, context: &Context) -> Result<(SensorModel, Plan)> {
    check_ranges(request)?;
    let sensor = request.sensor.read(&context.assets)?;
    let plan = request.plan(&sensor);
    plan.validate(&sensor)?;
    Ok((sensor, plan))
}

impl Request {
    /// The series: that of the standard or of the paper, with what the request changes.
    fn plan(&self, sensor: &SensorModel) -> Plan {
        let (quantum_efficiency, wavelength_um) = (self.quantum_efficiency, self.wavelength);
        let preset = if self.emva {
            Plan::emva(sensor, quantum_efficiency, wavelength_um)
        } else {
            let gains = match &sensor.gain_steps[..] {
                [] => Plan::default().gains,
                steps => steps.to_vec(),
            };
            Plan { gains, quantum_efficiency, wavelength_um, ..Plan::default() }
        };
        let [height, width] = self.size.unwrap_or([sensor.height, sensor.width]);
        Plan {
            height,
            width,
            gains: if self.gains.is_empty() { preset.gains } else { self.gains.clone() },
            flat_ms: self.exposures.clone().unwrap_or(preset.flat_ms),
            dark_ms: self.dark_exposures.clone().unwrap_or(preset.dark_ms),
            stack: self.stack.unwrap_or(preset.stack),
            level: self.level.unwrap_or(preset.level),
            seed: self.seed,
            format: match self.format {
                Format::Tiff => "tiff".to_owned(),
                Format::Png => "png".to_owned(),
            },
            ..preset
        }
    }
}

/// Notes how large the series will be, and the size of a smaller one if it is large.
fn note_size(plan: &Plan, frames: usize, bytes: u64, context: &Context) {
    let megabytes = |bytes: u64| (bytes as f64 / 1e6).ceil();
    let most = if plan.format == "tiff" { "" } else { "at most " };
    let (height, width) = SMALLER;
    let smaller = bytes / (plan.height * plan.width) as u64 * (height * width) as u64;
    let instead = if bytes > LARGE_BYTES && smaller < bytes {
        format!("; --size {height}x{width} takes {} MB", megabytes(smaller))
    } else {
        String::new()
    };
    context.note(format!("{frames} frames, {most}{} MB{instead}", megabytes(bytes)));
}
