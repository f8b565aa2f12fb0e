//! Raw frames as an ISP takes them: from a file, or from an array with what is known of it.

use std::path::PathBuf;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use petzval_base::FileError;
use petzval_camera::isp::{FrameData, RawInput};
use petzval_camera::sensor::{CfaPattern, Exposure};
use petzval_files::raw_file::{FrameCalibration, RawFrame, RawInfo, Sidecar};
use petzval_jobs::isp::{FrameOptions, RawInMemory, frame_in_memory, frames_like, read_frame};
use petzval_jobs::{Context, JobError, json, simulate};
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};

use crate::arrays::Like2;
use crate::error::{exception, refusal};
use crate::watch::{Watch, watched};

/// What errors call a frame in memory.
pub const NAME: &str = "raw";

/// A raw frame, or what is known of frames that come later; then it has no pixels.
#[pyclass(frozen, name = "RawFrame", module = "petzval._petzval")]
pub struct PyRawFrame {
    pub input: RawInput,
}

/// What is known of a frame in memory, as Python states it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct About {
    info: RawInfo,
    calibration: FrameCalibration,
    options: FrameOptions,
    /// Electrons of white in a green pixel, which a sensor makes levels and noise of.
    white_e: Option<f32>,
}

/// A frame as Python sees it.
#[derive(Serialize)]
struct Facts<'a> {
    height: usize,
    width: usize,
    bits: u32,
    cfa: CfaPattern,
    about: &'a FrameData,
}

impl About {
    fn parse(text: &str) -> Result<Self, JobError> {
        serde_json::from_str(text).map_err(|e| JobError::input(format!("about the raw frame: {e}"), ""))
    }

    /// Checks the numbers, and adds what a named sensor says.
    fn completed(mut self, context: &Context) -> Result<Self, JobError> {
        // What a sidecar or a calibration may not say, an array may not have.
        let empty = RawFrame { height: 0, width: 0, dn: Vec::new(), info: self.info };
        self.info = Sidecar::from_toml(&Sidecar::of(&empty).to_toml()).map_err(|e| refused(&e))?.info;
        let calibration = FrameCalibration::from_toml(&self.calibration.to_toml());
        self.calibration = calibration.map_err(|e| refused(&e))?;
        let Some(sensor) = &self.options.sensor else {
            return match self.white_e {
                None => Ok(self),
                Some(white_e) => {
                    let message = "the electrons of white mean nothing without a sensor";
                    Err(JobError::setting("white_e", white_e, message, "name a sensor, or give white_dn"))
                }
            };
        };
        let sensor = sensor.read(&context.assets)?;
        self.info.bits = self.info.bits.or(Some(sensor.bits));
        self.info.cfa = self.info.cfa.or(Some(sensor.cfa));
        if let Some(white_e) = self.white_e {
            let usual = simulate::Request::default();
            let exposure = Exposure {
                white_e,
                time_s: self.info.exposure_s.map_or(usual.time_s, |time_s| time_s as f32),
                linear_gain: self.info.linear_gain.map_or(usual.gain, |gain| gain as f32),
            };
            let about = FrameData::of_sensor(&sensor, &exposure)
                .map_err(|e| JobError::setting("white_e", white_e, e.to_string(), "in electrons, above 0"))?;
            self.calibration.black_dn = self.calibration.black_dn.or(Some(about.black_dn));
            self.calibration.white_dn = self.calibration.white_dn.or(Some(about.white_dn));
        }
        Ok(self)
    }
}

/// The error of a text that no user sees.
fn refused(error: &FileError) -> JobError {
    JobError::input(format!("{}: {}", error.key, error.message), error.hint.clone().unwrap_or_default())
}

#[pymethods]
impl PyRawFrame {
    /// Reads a raw file with its sidecar; `options` is JSON.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, options: &str, watch: Watch<'_>) -> PyResult<Self> {
        let input = watched(py, &watch, |context| {
            let options: FrameOptions =
                serde_json::from_str(options).map_err(|e| JobError::input(e.to_string(), ""))?;
            read_frame(&path, &options, context)
        })?;
        Ok(Self { input })
    }

    /// A frame of digital numbers `[y, x]`; `about` is JSON.
    #[staticmethod]
    fn of_numbers(py: Python<'_>, dn: Like2<'_>, about: &str, watch: Watch<'_>) -> PyResult<Self> {
        let (view, mut numbers) = (dn.as_array(), Vec::new());
        for ((row, col), value) in view.indexed_iter() {
            let rounded = value.round();
            // Not a number is in no range.
            if !(0.0..=f64::from(u32::MAX)).contains(&rounded) {
                let message = format!("is no digital number, at row {row}, column {col}");
                let hint = "numbers from 0 to 2^bits - 1; fractions are rounded";
                return Err(refusal(py, NAME, value, message, hint));
            }
            numbers.push(rounded as u32);
        }
        let (height, width) = view.dim();
        let input = watched(py, &watch, |context| {
            let About { info, calibration, options, .. } = About::parse(about)?.completed(context)?;
            let frame = RawFrame { height, width, dn: numbers, info };
            let raw = RawInMemory { name: NAME, frame: &frame, calibration: Some(&calibration) };
            frame_in_memory(raw, &options, context)
        })?;
        Ok(Self { input })
    }

    /// What is known of frames that come later; `about` is JSON.
    #[staticmethod]
    fn like(py: Python<'_>, about: &str, watch: Watch<'_>) -> PyResult<Self> {
        let input = watched(py, &watch, |context| {
            let About { info, calibration, options, .. } = About::parse(about)?.completed(context)?;
            for (key, is_set) in
                [("auto_balance", options.auto_balance), ("auto_exposure", options.auto_exposure)]
            {
                if is_set {
                    let message = "is estimated from the numbers of one frame, and there are none here";
                    return Err(JobError::setting(key, true, message, "give response or white_dn"));
                }
            }
            let frame = RawFrame { height: 0, width: 0, dn: Vec::new(), info };
            let raw = RawInMemory { name: NAME, frame: &frame, calibration: Some(&calibration) };
            frames_like(raw, &options, context)
        })?;
        Ok(Self { input })
    }

    /// What is known of the frame, for frames that come later.
    fn without_pixels(&self) -> Self {
        let RawInput { bits, cfa, ref about, .. } = self.input;
        Self { input: RawInput { height: 0, width: 0, dn: Vec::new(), bits, cfa, about: about.clone() } }
    }

    /// Digital numbers proportional to light, `[y, x]`.
    fn linear_dn<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let dn = Array2::from_shape_vec((self.input.height, self.input.width), self.input.linear_dn());
        Ok(dn.map_err(|e| exception(py, &JobError::failed(e.to_string())))?.into_pyarray(py))
    }

    /// Its size and what is known of it, as JSON.
    fn facts(&self, py: Python<'_>) -> PyResult<String> {
        let RawInput { height, width, bits, cfa, ref about, .. } = self.input;
        json(&Facts { height, width, bits, cfa, about }).map_err(|error| exception(py, &error))
    }
}
