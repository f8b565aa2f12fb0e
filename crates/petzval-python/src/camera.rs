//! Simulated cameras: pictures in, frames out.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyArray3};
use petzval_camera::image::LinearImage;
use petzval_files::raw_file::shortest;
use petzval_jobs::glass::context_with;
use petzval_jobs::simulate::{Frame, InMemory, Photographer, Request, frames_of, is_over_spectrum};
use petzval_jobs::{Context, JobError, json};
use pyo3::prelude::*;
use serde::Serialize;

use crate::error::exception;
use crate::pictures::{Given, Picture, array, picture_array};
use crate::requests::request;
use crate::watch::{Watch, watched};

/// A frame with what was developed from it.
#[pyclass(frozen, name = "Frame", module = "petzval._petzval")]
pub struct PyFrame(Frame);

/// What Python reads of a frame: numbers as they were given, and not as 32 bits hold them.
#[derive(Serialize)]
struct Facts<'a> {
    name: &'a str,
    sensor: &'a str,
    bits: u32,
    cfa: String,
    pixel_um: f64,
    black_level_dn: f64,
    white_e: f64,
    time_s: f64,
    linear_gain: f64,
    display_white: f64,
    saturated_share: f64,
}

/// A camera, whose PSFs are traced once.
#[pyclass(frozen, name = "Camera", module = "petzval._petzval")]
pub struct PyCamera {
    glasses: Vec<PathBuf>,
    opened: Mutex<Option<Arc<Photographer>>>,
}

#[pymethods]
impl PyCamera {
    #[new]
    fn new(glasses: Vec<PathBuf>) -> Self {
        Self { glasses, opened: Mutex::new(None) }
    }

    /// Takes every image of a request of `simulate`. Photographs in memory have names that the request lists.
    fn take(
        &self,
        py: Python<'_>,
        simulate: &str,
        photos: Vec<(String, Picture<'_>)>,
        watch: Watch<'_>,
    ) -> PyResult<Vec<PyFrame>> {
        let mut lights = Vec::new();
        for (name, picture) in &photos {
            if let Given::Light(light) = picture.given(py)? {
                lights.push((name.as_str(), light));
            }
        }
        let frames = watched(py, &watch, |context| {
            let request: Request = request("simulate", simulate)?;
            let photos: Vec<(&str, &LinearImage)> =
                lights.iter().map(|(name, light)| (*name, light)).collect();
            let memory = InMemory { photos: &photos, psfs: None };
            let context = &context_with(context.clone(), &self.glasses)?;
            if is_over_spectrum(&request) {
                return frames_of(&request, memory, context);
            }
            self.opened(&request, memory, context)?.frames(&request, memory, context)
        })?;
        Ok(frames.into_iter().map(PyFrame).collect())
    }
}

impl PyCamera {
    /// The camera of a request, opened now or by an earlier call.
    fn opened(
        &self,
        request: &Request,
        memory: InMemory<'_>,
        context: &Context,
    ) -> Result<Arc<Photographer>, JobError> {
        let kept = || self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        let earlier = kept().clone();
        if let Some(camera) = earlier.filter(|camera| camera.fits(request)) {
            return Ok(camera);
        }
        // The lock is free while rays are traced: a thread of the pool that waits for it could be the one that traces.
        let camera = Arc::new(Photographer::open(request, memory, context)?);
        if camera.outlasts_its_call() {
            *kept() = Some(camera.clone());
        }
        Ok(camera)
    }
}

#[pymethods]
impl PyFrame {
    /// Facts as JSON.
    fn facts(&self, py: Python<'_>) -> PyResult<String> {
        let Frame { name, taken, sensor, white_e, display_white, saturated_share, .. } = &self.0;
        let exposure = taken.raw.capture.exposure;
        let facts = Facts {
            name,
            sensor: &sensor.name,
            bits: sensor.bits,
            cfa: self.0.raw().info.cfa.map_or_else(String::new, |cfa| cfa.to_string()),
            pixel_um: sensor.pixel_um,
            black_level_dn: sensor.black_level_dn,
            white_e: shortest(*white_e),
            time_s: shortest(exposure.time_s),
            linear_gain: shortest(exposure.linear_gain),
            display_white: shortest(*display_white),
            saturated_share: *saturated_share,
        };
        json(&facts).map_err(|error| exception(py, &error))
    }

    /// Light on the pixels, `[y, x, 3]`.
    fn irradiance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        picture_array(py, self.0.taken.irradiance.clone())
    }

    /// Light of each pixel relative to the axis, `[y, x, 3]`.
    fn illumination<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        picture_array(py, self.0.taken.illumination.clone())
    }

    /// Whole digital numbers, `[y, x]`.
    fn raw<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u16>>> {
        let frame = self.0.raw();
        let numbers = Array2::from_shape_vec((frame.height, frame.width), frame.dn);
        Ok(numbers.map_err(|e| exception(py, &JobError::failed(e.to_string())))?.into_pyarray(py))
    }

    /// The developed picture in linear light before any restoration, `[y, x, 3]`.
    fn developed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let taken = &self.0.taken;
        picture_array(py, taken.unrestored.as_ref().unwrap_or(&taken.developed).clone())
    }

    /// The restored picture in linear light, `[y, x, 3]`, if the camera restores.
    fn restored<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        let taken = &self.0.taken;
        taken.unrestored.as_ref().map(|_| picture_array(py, taken.developed.clone())).transpose()
    }

    /// The picture of the ISP, sRGB-encoded, `[y, x, 3]`, if there is one.
    fn by_isp<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<u8>>>> {
        let of = |picture: &petzval_camera::isp::RgbPicture| {
            // Its PNG has 8 bits, too.
            let data = picture.encoded().into_iter().map(byte).collect();
            array(py, [picture.height, picture.width], data)
        };
        self.0.by_isp.as_ref().map(of).transpose()
    }

    /// The developed or restored picture as a display shows it, sRGB-encoded, `[y, x, 3]`.
    fn shown<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let encoded = self.0.encoded();
        array(py, [encoded.height, encoded.width], encoded.data.into_iter().map(byte).collect())
    }

    /// Writes the files of `simulate` into a folder; returns facts about them as JSON. `formats` is a request with `raw_format` and
    /// `picture_format`.
    fn save(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        formats: &str,
        overwrite: bool,
        watch: Watch<'_>,
    ) -> PyResult<String> {
        watched(py, &watch, |context| {
            let formats: Request = request("simulate", formats)?;
            let formats = (formats.raw_format, formats.picture_format);
            json(&self.0.write(formats, &folder, &context.clone().overwriting(overwrite))?)
        })
    }
}

/// A value of 0 to 1 in 8 bits, as PNG files have it.
fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}
