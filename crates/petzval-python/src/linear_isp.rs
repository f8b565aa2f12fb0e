//! Linear development of the frames of a sensor, with derivatives.

use numpy::ndarray::{Array3, Array4};
use numpy::{IntoPyArray, PyArray3, PyArray4, PyUntypedArrayMethods};
use petzval_camera::develop::{Demosaic, Domain, LinearIsp};
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Capture, Exposure, Raw, SensorError, SensorModel};
use petzval_camera::tape::linear_isp_pull_back;
use petzval_jobs::{JobError, SensorInput, simulate};
use pyo3::prelude::*;
use rayon::prelude::*;
use serde::Deserialize;

use crate::arrays::{Like3, Like4};
use crate::develop::{array, checked_f32, method};
use crate::error::refusal;
use crate::raw_frame::NAME;
use crate::watch::{Watch, watched};

/// Linear development of the frames that a sensor takes at one exposure and place.
#[pyclass(frozen, name = "LinearIsp", module = "petzval._petzval")]
pub struct PyLinearIsp {
    isp: LinearIsp,
    sensor: SensorModel,
    capture: Capture,
}

/// What it is made of; what is left out has Petzval's default.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Plan {
    sensor: SensorInput,
    white_e: f32,
    exposure_s: Option<f32>,
    linear_gain: Option<f32>,
    row: usize,
    col: usize,
    demosaic: Option<String>,
    domain: Option<String>,
    shading_floor: Option<f32>,
    colour_matrix: Option<[[f64; 3]; 3]>,
}

/// Derivatives by raw frames `[frame, y, x]` and by relative illumination `[frame, 3, y, x]`.
type Derivatives<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray4<f32>>);

impl Plan {
    fn exposure(&self) -> Exposure {
        let usual = simulate::Request::default();
        Exposure {
            white_e: self.white_e,
            time_s: self.exposure_s.unwrap_or(usual.time_s),
            linear_gain: self.linear_gain.unwrap_or(usual.gain),
        }
    }

    fn isp(&self) -> Result<LinearIsp, JobError> {
        let mut isp = LinearIsp { colour_matrix: self.colour_matrix, ..LinearIsp::default() };
        if let Some(name) = &self.demosaic {
            isp.interpolation.demosaic = method("demosaic", name, &Demosaic::ALL.map(Demosaic::name))?;
        }
        if let Some(name) = &self.domain {
            isp.interpolation.domain = method::<Domain>("domain", name, &["linear", "stabilised"])?;
        }
        if let Some(floor) = self.shading_floor {
            if !(floor > 0.0 && floor <= 1.0) {
                let hint = "a relative illumination above 0 and at most 1";
                return Err(JobError::setting("shading_floor", floor, "out of range", hint));
            }
            isp.shading_floor = floor;
        }
        Ok(isp)
    }
}

#[pymethods]
impl PyLinearIsp {
    /// Reads the sensor; `plan` is JSON.
    #[new]
    fn new(py: Python<'_>, plan: &str, watch: Watch<'_>) -> PyResult<Self> {
        watched(py, &watch, |context| {
            let plan: Plan = serde_json::from_str(plan).map_err(|e| JobError::input(e.to_string(), ""))?;
            let (exposure, isp) = (plan.exposure(), plan.isp()?);
            let sensor = plan.sensor.read(&context.assets)?;
            exposure.validate().map_err(|e| refused(&e))?;
            isp.interpolation.demosaic.check_array(sensor.cfa).map_err(|e| refused(&e))?;
            let placement = Placement { row: plan.row, col: plan.col };
            Ok(Self { isp, sensor, capture: Capture { exposure, placement, frame: 0 } })
        })
    }

    /// Develops frames `[frame, y, x]` with relative illumination `[frame, 3, y, x]` to linear light `[frame, 3, y, x]`.
    fn develop<'py>(
        &self,
        py: Python<'py>,
        raw: Like3<'_>,
        illumination: Like4<'_>,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyArray4<f32>>> {
        let batch = self.batch(py, &raw, &illumination)?;
        let pictures = watched(py, &watch, |_| {
            let of_frame = |(raw, light): &(Raw, LinearImage)| {
                self.isp.develop(raw, light, &self.sensor).map(|p| p.data)
            };
            batch.par_iter().map(of_frame).collect::<Result<Vec<_>, _>>().map_err(|e| refused(&e))
        })?;
        let (frames, height, width) = raw.as_array().dim();
        let pictures: Array4<f32> = array(py, (frames, CHANNELS, height, width), pictures.concat())?;
        Ok(pictures.into_pyarray(py))
    }

    /// Derivatives of a loss that has the derivatives `cotangent` by what [`Self::develop`] returns.
    fn pull_back<'py>(
        &self,
        py: Python<'py>,
        raw: Like3<'_>,
        illumination: Like4<'_>,
        cotangent: Like4<'_>,
        watch: Watch<'_>,
    ) -> PyResult<Derivatives<'py>> {
        let batch = self.batch(py, &raw, &illumination)?;
        let (frames, height, width) = raw.as_array().dim();
        let shape = [frames, CHANNELS, height, width];
        let cotangent = checked_f32(py, "cotangent", cotangent.as_array().into_dyn(), &shape)?;
        let found = watched(py, &watch, |_| {
            let of_frame = |((raw, light), of_picture): (&(Raw, LinearImage), &[f32])| {
                let d_picture = LinearImage { data: of_picture.to_vec(), ..*light };
                linear_isp_pull_back(raw, light, &d_picture, &self.isp, &self.sensor)
            };
            let of_pictures = cotangent.par_chunks(CHANNELS * height * width);
            let all: Result<Vec<_>, _> = batch.par_iter().zip(of_pictures).map(of_frame).collect();
            all.map_err(|e| refused(&e))
        })?;
        let (by_raw, by_light): (Vec<_>, Vec<_>) =
            found.into_iter().map(|(raw, light)| (raw, light.data)).unzip();
        let by_raw: Array3<f32> = array(py, (frames, height, width), by_raw.concat())?;
        let by_light: Array4<f32> = array(py, (frames, CHANNELS, height, width), by_light.concat())?;
        Ok((by_raw.into_pyarray(py), by_light.into_pyarray(py)))
    }
}

impl PyLinearIsp {
    /// Frames with their relative illumination, checked.
    fn batch(
        &self,
        py: Python<'_>,
        raw: &Like3<'_>,
        illumination: &Like4<'_>,
    ) -> PyResult<Vec<(Raw, LinearImage)>> {
        let (frames, height, width) = raw.as_array().dim();
        if raw.len() == 0 {
            return Err(refusal(py, NAME, "[]", "is empty", "give at least one frame"));
        }
        let dn = checked_f32(py, NAME, raw.as_array().into_dyn(), &[frames, height, width])?;
        let light = [frames, CHANNELS, height, width];
        let light = checked_f32(py, "illumination", illumination.as_array().into_dyn(), &light)?;
        let of_frame = |(dn, light): (&[f32], &[f32])| {
            let raw = Raw { height, width, dn: dn.to_vec(), capture: self.capture };
            (raw, LinearImage { channels: CHANNELS, height, width, data: light.to_vec() })
        };
        let pixels = height * width;
        Ok(dn.chunks_exact(pixels).zip(light.chunks_exact(CHANNELS * pixels)).map(of_frame).collect())
    }
}

fn refused(error: &SensorError) -> JobError {
    JobError::input(error.to_string(), "")
}
