//! Simulated captures: the calibration series of a sensor, written as a camera would leave it.
//!
//! A plan names gains, exposure times and stacks; its frames come from [`expose`] with a flat field, are written one by
//! one under a temporary name and renamed, and are listed in `captures.toml` at the end. A series that was interrupted
//! goes on where it stopped: a frame depends on nothing but sensor, plan and its own number.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::captures::{CaptureError, Kind, MANIFEST, SensorFacts};
use super::manifest::{self, Listed};
use crate::image::{CHANNELS, LinearImage};
use crate::raw_file::{Packing, RawFileError, RawFormat, RawFrame, save_raw_alone};
use crate::render::Placement;
use crate::sensor::{Capture, Colour, Exposure, Noise, NoiseMode, SensorModel, expose};
use crate::whole_file::write_whole;

/// What a series holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Rows of a frame.
    pub height: usize,
    /// Columns of a frame.
    pub width: usize,
    /// Linear gains.
    pub gains: Vec<f64>,
    /// Exposure times of pairs of flat and of dark frames, ms.
    pub flat_ms: Vec<f64>,
    /// Exposure times of pairs of dark frames alone, ms.
    pub dark_ms: Vec<f64>,
    /// Frames of a flat and of a dark stack at the middle flat exposure of every gain; 0 for none.
    pub stack: usize,
    /// Signal of the brightest colour at the longest flat exposure as a share of the range above black: the light is
    /// weakened with the gain, so that this holds at every gain. Above 1 the series saturates.
    pub level: f64,
    /// Photons that give one electron in a green or clear pixel are `1 / quantum_efficiency`; without it the list states no
    /// photons.
    pub quantum_efficiency: Option<f64>,
    /// Seed of the noise.
    pub seed: u64,
    /// Ending of the frames' names: `tiff` or `png`.
    pub format: String,
}

impl Default for Plan {
    /// The series of Tseng et al. 2021, supplement section 2.3, at the full size of their sensor.
    fn default() -> Self {
        Self {
            height: 1200,
            width: 1920,
            gains: vec![1.0, 1.77, 3.16, 5.62, 10.0, 17.78, 31.62],
            flat_ms: vec![2.5, 5.0, 7.5, 10.0],
            dark_ms: (1..=12).map(|i| 2.5 * f64::from(i)).collect(),
            stack: 0,
            level: 0.6,
            quantum_efficiency: None,
            seed: 1,
            format: "tiff".to_owned(),
        }
    }
}

/// One setting of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedPoint {
    /// Light or none.
    pub kind: Kind,
    /// Linear gain.
    pub linear_gain: f64,
    /// Exposure time, ms.
    pub exposure_ms: f64,
    /// Electrons of a green (or clear) pixel; 0 in the dark.
    pub white_e: f64,
    /// Number of its first frame in the series.
    pub first_frame: u64,
    /// Names of its frames.
    pub names: Vec<String>,
}

/// Name of the file that says which series a folder holds.
const SERIES: &str = "series.toml";

#[derive(Serialize)]
struct Identity<'a> {
    plan: &'a Plan,
    sensor: &'a SensorModel,
}

impl Plan {
    /// Checks the plan against the sensor.
    pub fn validate(&self, sensor: &SensorModel) -> Result<(), CaptureError> {
        let wrong = |what, problem: String| Err(CaptureError::Plan { what, problem });
        if !(2..=sensor.height).contains(&self.height) || !(2..=sensor.width).contains(&self.width) {
            let (h, w) = (sensor.height, sensor.width);
            return wrong("size", format!("{}x{} does not fit on {h}x{w} pixels", self.height, self.width));
        }
        let all = |values: &[f64], low: f64, high: f64| values.iter().all(|v| (low..=high).contains(v));
        if self.gains.is_empty() || !all(&self.gains, 1e-3, 1e4) {
            return wrong("gains", format!("{:?}; give numbers from 0.001 to 10000", self.gains));
        }
        if let Some(no) = self.gains.iter().find(|g| !sensor.gain_steps.is_empty() && !offers(sensor, **g)) {
            return wrong("gains", format!("{no} is none of the sensor's gains {:?}", sensor.gain_steps));
        }
        if self.flat_ms.is_empty() && self.dark_ms.is_empty() {
            return wrong("exposures", "there are none".to_owned());
        }
        if !all(&self.flat_ms, 1e-6, 1e6) || !all(&self.dark_ms, 0.0, 1e6) {
            return wrong("exposures", "exposure times are positive milliseconds, at most 1e6".to_owned());
        }
        for (what, values) in
            [("gains", &self.gains), ("exposures", &self.flat_ms), ("exposures", &self.dark_ms)]
        {
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            if let Some(twice) = sorted.windows(2).find(|w| w[0] == w[1]) {
                return wrong(what, format!("{} is there twice", twice[0]));
            }
        }
        if (1..3).contains(&self.stack) || self.stack > 4096 {
            return wrong("stack", format!("{} frames; a stack has 3 to 4096", self.stack));
        }
        if !(1e-4..=10.0).contains(&self.level) {
            return wrong("level", format!("{} is outside 0.0001..10", self.level));
        }
        if self.quantum_efficiency.is_some_and(|q| !(1e-4..=1.0).contains(&q)) {
            return wrong("quantum efficiency", "it is a share, above 0 and at most 1".to_owned());
        }
        if !["tiff", "png"].contains(&self.format.as_str()) {
            return wrong("format", format!("`{}`; tiff or png", self.format));
        }
        Ok(())
    }

    /// The points in the order of their frames.
    pub fn points(&self, sensor: &SensorModel) -> Vec<PlannedPoint> {
        let longest = self.flat_ms.iter().fold(0.0_f64, |a, b| a.max(*b));
        let mut points = Vec::new();
        let mut frames = 0;
        for gain in &self.gains {
            let white_e = |ms: f64| self.level * self.full_range_e(sensor, *gain) * ms / longest;
            let mut add = |kind, ms: f64, count: usize| {
                let (name, white_e) = match kind {
                    Kind::Flat => ("flat", white_e(ms)),
                    Kind::Dark => ("dark", 0.0),
                };
                let stack = if count > 2 { "-stack" } else { "" };
                let names =
                    (0..count).map(|i| format!("gain-{gain}/{name}-{ms}ms{stack}-{i}.{}", self.format));
                let names = names.collect();
                points.push(PlannedPoint {
                    kind,
                    linear_gain: *gain,
                    exposure_ms: ms,
                    white_e,
                    first_frame: frames,
                    names,
                });
                frames += count as u64;
            };
            self.flat_ms.iter().for_each(|ms| add(Kind::Flat, *ms, 2));
            let mut dark: Vec<f64> = self.flat_ms.iter().chain(&self.dark_ms).copied().collect();
            dark.sort_by(f64::total_cmp);
            dark.dedup();
            dark.iter().for_each(|ms| add(Kind::Dark, *ms, 2));
            if let (true, Some(middle)) = (self.stack > 0, self.flat_ms.get(self.flat_ms.len() / 2)) {
                add(Kind::Flat, *middle, self.stack);
                add(Kind::Dark, *middle, self.stack);
            }
        }
        points
    }

    /// Electrons of a green (or clear) pixel with which the brightest colour reaches the end of the range: of the
    /// converter, or the full well if that comes first.
    fn full_range_e(&self, sensor: &SensorModel, linear_gain: f64) -> f64 {
        let response = |c: &Colour| sensor.response(*c).iter().sum::<f64>();
        let brightest = sensor.cfa.colours().iter().map(response).fold(1e-9, f64::max);
        let converter = (sensor.max_dn() - sensor.black_level_dn) / (sensor.gain_dn_per_e * linear_gain);
        converter.min(sensor.full_well_e) / brightest
    }
}

fn offers(sensor: &SensorModel, gain: f64) -> bool {
    sensor.gain_steps.iter().any(|step| (step - gain).abs() <= 1e-6 * step)
}

/// What came of writing a series.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Written {
    /// The list of captures.
    pub list: PathBuf,
    /// Frames in all.
    pub frames: usize,
    /// Frames that were there already.
    pub kept: usize,
}

/// Writes the series into a folder, which is made if need be. `told` hears of every frame. Same sensor and plan: same bits,
/// on any number of threads, in one go or in several.
pub fn write_series(
    sensor: &SensorModel,
    plan: &Plan,
    folder: &Path,
    told: &(dyn Fn() + Sync),
) -> Result<Written, CaptureError> {
    plan.validate(sensor)?;
    sensor.validate().map_err(crate::sensor::SensorError::from)?;
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| CaptureError::Io { path, source }
    };
    let unwritable = |e: toml::ser::Error| CaptureError::Plan { what: "series", problem: e.to_string() };
    let identity = toml::to_string(&Identity { plan, sensor }).map_err(unwritable)?;
    check_folder(folder, &identity)?;
    std::fs::create_dir_all(folder).map_err(io(folder))?;
    let series = folder.join(SERIES);
    write_whole(&series, identity.as_bytes()).map_err(io(&series))?;

    let points = plan.points(sensor);
    for gain in &plan.gains {
        let below = folder.join(format!("gain-{gain}"));
        std::fs::create_dir_all(&below).map_err(io(&below))?;
    }
    let frames: Vec<(&PlannedPoint, usize)> =
        points.iter().flat_map(|p| (0..p.names.len()).map(move |i| (p, i))).collect();
    let kept: Vec<bool> = frames
        .par_iter()
        .map(|(point, i)| {
            let path = folder.join(&point.names[*i]);
            let there = path.is_file();
            if !there {
                write_frame(sensor, plan, point, *i, &path)?;
            }
            told();
            Ok(there)
        })
        .collect::<Result<_, CaptureError>>()?;

    let list = folder.join(MANIFEST);
    let facts = SensorFacts {
        name: sensor.name.clone(),
        bits: sensor.bits,
        pixel_um: Some(sensor.pixel_um),
        cfa: sensor.cfa,
        black_level_dn: Some(sensor.black_level_dn),
        full_well_e: Some(sensor.full_well_e),
        f_number: None,
        wavelength_um: None,
        temperature_c: None,
    };
    let listed: Vec<Listed> = points
        .iter()
        .map(|p| Listed {
            kind: p.kind,
            linear_gain: p.linear_gain,
            exposure_ms: p.exposure_ms,
            photons: plan.quantum_efficiency.filter(|_| p.kind == Kind::Flat).map(|q| p.white_e / q),
            frames: p.names.clone(),
        })
        .collect();
    let text = manifest::write(&facts, &listed).map_err(unwritable)?;
    write_whole(&list, text.as_bytes()).map_err(io(&list))?;
    Ok(Written { list, frames: frames.len(), kept: kept.iter().filter(|k| **k).count() })
}

/// A folder may hold the beginning of this very series, or no captures at all.
fn check_folder(folder: &Path, identity: &str) -> Result<(), CaptureError> {
    let path = folder.join(SERIES);
    match std::fs::read_to_string(&path) {
        Ok(there) if there == identity => Ok(()),
        Ok(there) => {
            let line = there.lines().zip(identity.lines()).find(|(a, b)| a != b);
            let what = line.map_or("it ends elsewhere".to_owned(), |(a, b)| format!("`{a}`, not `{b}`"));
            Err(CaptureError::OtherSeries { path, what })
        }
        Err(_) if folder.join(MANIFEST).exists() => {
            let what = format!("{MANIFEST} without {SERIES}");
            Err(CaptureError::OtherSeries { path: folder.join(MANIFEST), what })
        }
        Err(_) => Ok(()),
    }
}

fn write_frame(
    sensor: &SensorModel,
    plan: &Plan,
    point: &PlannedPoint,
    index: usize,
    path: &Path,
) -> Result<(), CaptureError> {
    // In the dark the light is zero; the exposure still needs a white.
    let light = if point.kind == Kind::Flat { 1.0 } else { 0.0 };
    let exposure = Exposure {
        white_e: if point.kind == Kind::Flat { point.white_e as f32 } else { 1.0 },
        time_s: (1e-3 * point.exposure_ms) as f32,
        linear_gain: point.linear_gain as f32,
    };
    let capture =
        Capture { exposure, placement: Placement::default(), frame: point.first_frame + index as u64 };
    let scene = LinearImage::filled(CHANNELS, plan.height, plan.width, light);
    let raw = expose(&scene, sensor, &capture, &Noise { mode: NoiseMode::Exact, seed: plan.seed })?;
    // The list of captures says what a sidecar would.
    let format = RawFormat::of_name(path, Packing::U16le).unwrap_or(RawFormat::Tiff);
    save_raw_alone(&RawFrame::from_raw(&raw, sensor), path, format).map_err(|error| match error {
        RawFileError::Io { path, source } => CaptureError::Io { path, source },
        other => other.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_that_cannot_be_written_leaves_nothing_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let sensor =
            SensorModel::from_toml(include_str!("../../../../data/sensors/imx249-fitted.toml")).unwrap();
        let (gains, flat_ms, dark_ms) = (vec![1.0], vec![5.0], Vec::new());
        let plan = Plan { height: 4, width: 4, gains, flat_ms, dark_ms, ..Plan::default() };
        std::fs::create_dir(folder.path().join(SERIES)).unwrap();
        let error = write_series(&sensor, &plan, folder.path(), &|| ()).unwrap_err();
        assert!(matches!(error, CaptureError::Io { .. }), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
