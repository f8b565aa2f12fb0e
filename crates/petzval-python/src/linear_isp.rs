//! Linear development of the frames of a sensor, with derivatives.

use burn::prelude::*;
use burn::tensor::TensorData;
use numpy::ndarray::{Array3, Array4};
use numpy::{
    AllowTypeChange, IntoPyArray, PyArray3, PyArray4, PyArrayLike2, PyArrayLike3, PyArrayLike4,
    PyUntypedArrayMethods,
};
use petzval_camera::develop::{Demosaic, Domain, LinearIsp};
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Capture, Exposure, Raw, SensorError, SensorModel};
use petzval_camera::tape::linear_isp_op;
use petzval_jobs::{JobError, SensorInput, simulate};
use pyo3::prelude::*;
use serde::Deserialize;

use crate::develop::{array, checked_f32, method, on_host};
use crate::error::exception;
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

    /// Develops a frame `[y, x]` with relative illumination `[3, y, x]` to linear light `[3, y, x]`, by the readable reference.
    fn develop<'py>(
        &self,
        py: Python<'py>,
        raw: PyArrayLike2<'_, f32, AllowTypeChange>,
        illumination: PyArrayLike3<'_, f32, AllowTypeChange>,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let (height, width) = raw.as_array().dim();
        let dn = checked_f32(py, NAME, raw.as_array().into_dyn(), &[height, width])?;
        let light =
            checked_f32(py, "illumination", illumination.as_array().into_dyn(), &[CHANNELS, height, width])?;
        let picture = watched(py, &watch, |_| {
            let raw = Raw { height, width, dn, capture: self.capture };
            let illumination = LinearImage { channels: CHANNELS, height, width, data: light };
            self.isp.develop(&raw, &illumination, &self.sensor).map_err(|e| refused(&e))
        })?;
        let picture: Array3<f32> = array(py, (CHANNELS, height, width), picture.data)?;
        Ok(picture.into_pyarray(py))
    }

    /// Develops frames `[frame, y, x]` with relative illumination `[frame, 3, y, x]` to `[frame, 3, y, x]`, as an operation of the tape.
    fn on_tape<'py>(
        &self,
        py: Python<'py>,
        raw: PyArrayLike3<'_, f32, AllowTypeChange>,
        illumination: PyArrayLike4<'_, f32, AllowTypeChange>,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyArray4<f32>>> {
        let batch = Batch::new(py, &raw, &illumination)?;
        let [frames, _, height, width] = batch.shape;
        let pictures = watched(py, &watch, |_| {
            let (raw, illumination) = batch.tensors(&Device::flex());
            on_host(self.of_tensors(raw, illumination)?)
        })?;
        let pictures: Array4<f32> = array(py, (frames, CHANNELS, height, width), pictures)?;
        Ok(pictures.into_pyarray(py))
    }

    /// Derivatives of a loss that has the derivatives `cotangent` by what [`Self::on_tape`] returns.
    fn pull_back<'py>(
        &self,
        py: Python<'py>,
        raw: PyArrayLike3<'_, f32, AllowTypeChange>,
        illumination: PyArrayLike4<'_, f32, AllowTypeChange>,
        cotangent: PyArrayLike4<'_, f32, AllowTypeChange>,
        watch: Watch<'_>,
    ) -> PyResult<Derivatives<'py>> {
        let batch = Batch::new(py, &raw, &illumination)?;
        let [frames, _, height, width] = batch.shape;
        let shape = [frames, CHANNELS, height, width];
        let cotangent = checked_f32(py, "cotangent", cotangent.as_array().into_dyn(), &shape)?;
        let (by_raw, by_light) = watched(py, &watch, |_| {
            let demosaic = self.isp.interpolation.demosaic;
            if !demosaic.is_differentiable() {
                let hint = "bilinear, malvar and menon have one";
                return Err(JobError::setting("demosaic", demosaic.name(), "has no gradient", hint));
            }
            let device = Device::flex().autodiff();
            let (raw, illumination) = batch.tensors(&device);
            let (raw, illumination) = (raw.require_grad(), illumination.require_grad());
            let weights = Tensor::<4>::from_data(TensorData::new(cotangent, shape), &device);
            let loss = self.of_tensors(raw.clone(), illumination.clone())? * weights;
            let gradients = loss.sum().backward();
            let none = || JobError::failed("the development has no gradient");
            Ok((
                on_host(raw.grad(&gradients).ok_or_else(none)?)?,
                on_host(illumination.grad(&gradients).ok_or_else(none)?)?,
            ))
        })?;
        let by_raw: Array3<f32> = array(py, (frames, height, width), by_raw)?;
        let by_light: Array4<f32> = array(py, (frames, CHANNELS, height, width), by_light)?;
        Ok((by_raw.into_pyarray(py), by_light.into_pyarray(py)))
    }
}

impl PyLinearIsp {
    fn of_tensors(&self, raw: Tensor<4>, illumination: Tensor<4>) -> Result<Tensor<4>, JobError> {
        let captures = vec![self.capture; raw.dims()[0]];
        linear_isp_op(raw, illumination, &self.isp, &self.sensor, &captures).map_err(|e| refused(&e))
    }
}

/// Frames and their relative illumination, checked.
struct Batch {
    /// Of the frames.
    shape: [usize; 4],
    raw: Vec<f32>,
    illumination: Vec<f32>,
}

impl Batch {
    fn new(
        py: Python<'_>,
        raw: &PyArrayLike3<'_, f32, AllowTypeChange>,
        illumination: &PyArrayLike4<'_, f32, AllowTypeChange>,
    ) -> PyResult<Self> {
        let (frames, height, width) = raw.as_array().dim();
        if raw.len() == 0 {
            let error = JobError::setting(NAME, "[]", "is empty", "give at least one frame");
            return Err(exception(py, &error));
        }
        let dn = checked_f32(py, NAME, raw.as_array().into_dyn(), &[frames, height, width])?;
        let light = [frames, CHANNELS, height, width];
        let illumination = checked_f32(py, "illumination", illumination.as_array().into_dyn(), &light)?;
        Ok(Self { shape: [frames, 1, height, width], raw: dn, illumination })
    }

    fn tensors(&self, device: &Device) -> (Tensor<4>, Tensor<4>) {
        let [frames, _, height, width] = self.shape;
        let light = TensorData::new(self.illumination.clone(), [frames, CHANNELS, height, width]);
        (
            Tensor::from_data(TensorData::new(self.raw.clone(), self.shape), device),
            Tensor::from_data(light, device),
        )
    }
}

fn refused(error: &SensorError) -> JobError {
    JobError::input(error.to_string(), "")
}
