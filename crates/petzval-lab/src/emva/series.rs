//! Simulated captures: the calibration series of a sensor, frame by frame as values, or written as the files of a camera.
//!
//! The frames of a [`Plan`] come from [`expose`] with a flat field. As files they are written one by one under a temporary name and
//! renamed, and are listed in `captures.toml` at the end. An interrupted series is continued: a frame depends only on
//! sensor, plan and its own number.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::captures::{CaptureError, Kind, MANIFEST, SERIES, SensorFacts};
use super::compat::manifest::{self, Listed};
use super::plan::{Lit, Plan, PlannedPoint};
use petzval_base::{Cancelled, IoError, sweep_parts, write_whole};
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Capture, Exposure, Noise, NoiseMode, SensorModel, expose};
use petzval_files::raw_file::{Packing, RawFileError, RawFormat, RawFrame, save_raw_alone};

#[derive(Serialize)]
struct Identity<'a> {
    plan: &'a Plan,
    sensor: &'a SensorModel,
}

/// The series of a sensor. Its frames are exposed one at a time, in any order.
#[derive(Debug, Clone)]
pub struct Series {
    plan: Plan,
    lit: Lit,
    points: Vec<PlannedPoint>,
}

/// A frame of a series as a value, with what the list of captures says about it.
#[derive(Debug, Clone, PartialEq)]
pub struct SeriesFrame {
    /// Its name as a file, such as `gain-1/flat-5ms-0.tiff`.
    pub name: String,
    /// Light or none.
    pub kind: Kind,
    /// Linear gain.
    pub linear_gain: f64,
    /// Exposure time, ms.
    pub exposure_ms: f64,
    /// Mean number of photons per pixel; `None` for a dark frame, and if the plan states neither efficiency nor wavelength.
    pub photons: Option<f64>,
    /// Digital numbers, with sensor and exposure.
    pub frame: RawFrame,
}

impl Series {
    /// The series of a plan, once it is known to fit the sensor.
    pub fn new(sensor: &SensorModel, plan: &Plan) -> Result<Self, CaptureError> {
        plan.validate(sensor)?;
        sensor.validate().map_err(petzval_camera::sensor::SensorError::from)?;
        let lit = plan.lit(sensor)?;
        let points = plan.points_lit(&lit.sensor);
        Ok(Self { plan: plan.clone(), lit, points })
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Settings in the order of their frames.
    pub fn points(&self) -> &[PlannedPoint] {
        &self.points
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.points.iter().map(|point| point.names.len()).sum()
    }

    /// Exposes the frame of a number, 0 to [`Series::frames`]; `None` beyond the last. It depends on sensor, plan and number alone.
    pub fn frame(&self, number: usize) -> Option<Result<SeriesFrame, CaptureError>> {
        let mut index = number;
        for point in &self.points {
            match point.names.get(index) {
                Some(name) => return Some(self.exposed(point, index, name)),
                None => index -= point.names.len(),
            }
        }
        None
    }

    fn exposed(&self, point: &PlannedPoint, index: usize, name: &str) -> Result<SeriesFrame, CaptureError> {
        Ok(SeriesFrame {
            name: name.to_owned(),
            kind: point.kind,
            linear_gain: point.linear_gain,
            exposure_ms: point.exposure_ms,
            photons: self.photons(point),
            frame: expose_frame(&self.lit.sensor, &self.plan, point, index)?,
        })
    }

    /// Photons per pixel of a flat point, if they are known.
    fn photons(&self, point: &PlannedPoint) -> Option<f64> {
        self.lit.photons_per_e.filter(|_| point.kind == Kind::Flat).map(|each| each * point.white_e)
    }
}

/// Result of writing a series.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Written {
    /// The list of captures.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub list: PathBuf,
    /// Frames in all.
    pub frames: usize,
    /// Frames that already existed.
    pub kept: usize,
}

/// Writes the series into a folder, which is created if necessary. Calls `written` after every frame; its error ends the work, which
/// goes on from there the next time. The same sensor
/// and plan give the same bits, on any number of threads and after any interruption.
pub fn write_series(
    sensor: &SensorModel,
    plan: &Plan,
    folder: &Path,
    written: &(dyn Fn() -> Result<(), Cancelled> + Sync),
) -> Result<Written, CaptureError> {
    // Write a file that identifies the series, so that another series is not mixed into the folder.
    let series = Series::new(sensor, plan)?;
    let unwritable = |e: toml::ser::Error| CaptureError::Plan { what: "series", problem: e.to_string() };
    let identity = toml::to_string(&Identity { plan, sensor }).map_err(unwritable)?;
    check_folder(folder, &identity)?;
    std::fs::create_dir_all(folder).map_err(IoError::at(folder))?;
    sweep_parts(folder);
    let identified = folder.join(SERIES);
    write_whole(&identified, identity.as_bytes()).map_err(IoError::at(&identified))?;

    // Expose and write the missing frames, in parallel.
    for gain in &plan.gains {
        let below = folder.join(format!("gain-{gain}"));
        std::fs::create_dir_all(&below).map_err(IoError::at(&below))?;
    }
    let frames: Vec<(&PlannedPoint, usize)> =
        series.points.iter().flat_map(|p| (0..p.names.len()).map(move |i| (p, i))).collect();
    let kept: Vec<bool> = frames
        .par_iter()
        .map(|(point, i)| {
            let path = folder.join(&point.names[*i]);
            let there = path.is_file();
            if !there {
                write_frame(&expose_frame(&series.lit.sensor, plan, point, *i)?, &path)?;
            }
            written()?;
            Ok(there)
        })
        .collect::<Result<_, CaptureError>>()?;

    // Write the list of captures last: a folder without it is not complete.
    let list = folder.join(MANIFEST);
    let facts = SensorFacts {
        name: sensor.name.clone(),
        bits: sensor.bits,
        pixel_um: Some(sensor.pixel_um),
        cfa: sensor.cfa,
        black_level_dn: Some(sensor.black_level_dn),
        full_well_e: Some(sensor.full_well_e),
        f_number: None,
        wavelength_um: plan.wavelength_um,
        temperature_c: None,
    };
    let listed = series.points.iter().map(|p| Listed {
        kind: p.kind,
        linear_gain: p.linear_gain,
        exposure_ms: p.exposure_ms,
        photons: series.photons(p),
        frames: p.names.clone(),
    });
    let listed: Vec<Listed> = listed.collect();
    let text = manifest::write(&facts, &listed).map_err(unwritable)?;
    write_whole(&list, text.as_bytes()).map_err(IoError::at(&list))?;
    Ok(Written { list, frames: frames.len(), kept: kept.iter().filter(|k| **k).count() })
}

/// A series is written into a folder without captures, or into one that holds the beginning of the same series.
fn check_folder(folder: &Path, identity: &str) -> Result<(), CaptureError> {
    let path = folder.join(SERIES);
    match petzval_base::read_text(&path) {
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

/// Exposes a frame of a point. `sensor` is the sensor under the light of the plan.
fn expose_frame(
    sensor: &SensorModel,
    plan: &Plan,
    point: &PlannedPoint,
    index: usize,
) -> Result<RawFrame, CaptureError> {
    // Dark frames have no light, but the exposure still needs a white level.
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
    Ok(RawFrame::from_raw(&raw, sensor))
}

/// Writes a frame without a sidecar: the list of captures has its data.
fn write_frame(frame: &RawFrame, path: &Path) -> Result<(), CaptureError> {
    let format = RawFormat::of_name(path, Packing::U16le).unwrap_or(RawFormat::Tiff);
    save_raw_alone(frame, path, format).map_err(|error| match error {
        RawFileError::Io { path, source } => IoError { path, source }.into(),
        other => other.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor_and_plan() -> (SensorModel, Plan) {
        let sensor = petzval_files::parse_sensor(include_str!(
            "../../../petzval-data/data/sensors/imx249-fitted.toml"
        ))
        .unwrap();
        let (gains, flat_ms, dark_ms) = (vec![1.0], vec![5.0], Vec::new());
        (sensor, Plan { height: 4, width: 4, gains, flat_ms, dark_ms, ..Plan::default() })
    }

    #[test]
    fn frames_as_values_are_those_of_the_files() {
        let folder = tempfile::tempdir().unwrap();
        let (sensor, plan) = sensor_and_plan();
        let plan = Plan { quantum_efficiency: Some(0.5), ..plan };
        write_series(&sensor, &plan, folder.path(), &|| Ok(())).unwrap();
        let series = Series::new(&sensor, &plan).unwrap();
        assert_eq!(series.frames(), 4);
        let kinds: Vec<Kind> = (0..4)
            .map(|number| {
                let frame = series.frame(number).unwrap().unwrap();
                let file = petzval_files::raw_file::load_raw(&folder.path().join(&frame.name)).unwrap();
                assert_eq!(frame.frame.dn, file.dn, "{}", frame.name);
                assert_eq!(frame.photons.is_some(), frame.kind == Kind::Flat);
                frame.kind
            })
            .collect();
        assert_eq!(kinds, [Kind::Flat, Kind::Flat, Kind::Dark, Kind::Dark]);
        assert!(series.frame(4).is_none());
        assert!(Series::new(&sensor, &Plan { gains: Vec::new(), ..plan }).is_err());
    }

    #[test]
    fn a_list_that_cannot_be_written_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let (sensor, plan) = sensor_and_plan();
        std::fs::create_dir(folder.path().join(SERIES)).unwrap();
        let error = write_series(&sensor, &plan, folder.path(), &|| Ok(())).unwrap_err();
        assert!(matches!(error, CaptureError::Io { .. }), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
