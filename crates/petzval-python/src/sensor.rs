//! Sensors: read, changed, and exposed.

use numpy::ndarray::{Array2, Array3, ArrayViewD, Axis};
use numpy::{AllowTypeChange, IntoPyArray, PyArray2, PyArray3, PyArrayLikeDyn};
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::Placement;
use petzval_camera::sensor::{
    Capture, Exposure, Noise, NoiseMode, Raw, SensorError, SensorModel, expose, expose_with_tape,
};
use petzval_jobs::input::{Input, TomlText};
use petzval_jobs::{JobError, SensorInput, json};
use pyo3::prelude::*;
use serde_json::{Map, Value};

use crate::error::{exception, refusal};
use crate::watch::{Watch, watched};

/// Most pixels of a frame; each takes up to 50 bytes.
pub const MOST_PIXELS: usize = 200_000_000;

/// A sensor.
#[pyclass(frozen, name = "Sensor", module = "petzval._petzval")]
pub struct PySensor {
    pub model: SensorModel,
}

/// How a sensor is exposed: seed and number of the frame, time in s, linear gain, and the sensor's row and column of the first pixel.
#[derive(Clone, Copy, FromPyObject)]
pub struct Settings(u64, u64, f32, f32, usize, usize);

/// Fixed pattern of a window: offset in electrons, response, and dark current in electrons per second.
type Pattern<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>);

/// Digital numbers, and their derivatives by the electrons of light.
type Tracked<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>);

#[pymethods]
impl PySensor {
    /// Reads a sensor by path or built-in name.
    #[staticmethod]
    fn load(py: Python<'_>, name: String, watch: Watch<'_>) -> PyResult<Self> {
        read(py, Input::Name(name), &watch)
    }

    /// Reads the text of a sensor file.
    #[staticmethod]
    fn parse(py: Python<'_>, text: String, watch: Watch<'_>) -> PyResult<Self> {
        read(py, Input::Inline(TomlText { toml: text }), &watch)
    }

    /// The sensor as text of a sensor file.
    fn toml(&self, py: Python<'_>) -> PyResult<String> {
        toml::to_string(&self.model).map_err(|e| exception(py, &JobError::failed(e.to_string())))
    }

    /// Its numbers as JSON, by their keys in the file.
    fn facts(&self, py: Python<'_>) -> PyResult<String> {
        json(&self.model).map_err(|error| exception(py, &error))
    }

    /// The sensor with other values of keys of its file; `values` is JSON.
    fn changed(&self, py: Python<'_>, values: &str, watch: Watch<'_>) -> PyResult<Self> {
        let text = || -> Result<String, JobError> {
            let failed = |message: String| JobError::failed(message);
            let values: Map<String, Value> =
                serde_json::from_str(values).map_err(|e| failed(e.to_string()))?;
            let mut table = toml::Table::try_from(&self.model).map_err(|e| failed(e.to_string()))?;
            for (key, value) in values {
                let refused = |e: toml::ser::Error| {
                    JobError::input(format!("{key}: {e}"), "give numbers, texts, lists or tables")
                };
                let value = toml::Value::try_from(&value).map_err(refused)?;
                table.insert(key, value);
            }
            toml::to_string(&table).map_err(|e| failed(e.to_string()))
        };
        // What a file may not hold, a sensor may not have.
        let toml = text().map_err(|error| exception(py, &error))?;
        read(py, Input::Inline(TomlText { toml }), &watch)
    }

    /// Mean digital number of a saturated pixel, DN.
    fn white_level_dn(&self, linear_gain: f64) -> f64 {
        self.model.white_level_dn(linear_gain)
    }

    /// Photoelectrons that saturate a pixel.
    fn light_capacity_e(&self, time_s: f64, linear_gain: f64) -> f64 {
        self.model.light_capacity_e(time_s, linear_gain)
    }

    /// Electrons of each pixel of the filter array's tile per electron that red, green and blue light gives a green pixel, `[row, column, colour]`.
    fn response<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        let cfa = &self.model.cfa;
        let of = |(row, col, c): (usize, usize, usize)| self.model.response(cfa.colour(row, col))[c];
        Array3::from_shape_fn((cfa.rows(), cfa.cols(), CHANNELS), of).into_pyarray(py)
    }

    /// The fixed pattern of the specimen in a window.
    fn fixed_pattern<'py>(
        &self,
        py: Python<'py>,
        row: usize,
        column: usize,
        height: usize,
        width: usize,
        watch: Watch<'_>,
    ) -> PyResult<Pattern<'py>> {
        let found = watched(py, &watch, |_| {
            check_window(&self.model, row, column, height, width)?;
            Ok(self.model.fixed_pattern(Placement { row, col: column }, height, width))
        })?;
        let picture = |values| picture(py, height, width, values);
        Ok((picture(found.offset_e)?, picture(found.response)?, picture(found.dark_e_per_s)?))
    }

    /// A raw frame, as the converter gives it.
    fn expose<'py>(
        &self,
        py: Python<'py>,
        electrons: PyArrayLikeDyn<'py, f32, AllowTypeChange>,
        settings: Settings,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyArray2<u16>>> {
        let (light, capture) = self.light(py, &electrons.as_array(), settings)?;
        let noise = Noise { mode: NoiseMode::Exact, seed: settings.0 };
        let raw = watched(py, &watch, |_| expose(&light, &self.model, &capture, &noise).map_err(refused))?;
        // Whole numbers from 0 to 2^16 - 1.
        picture(py, raw.height, raw.width, raw.dn.into_iter().map(|dn| dn as u16).collect())
    }

    /// Digital numbers in a mode of noise, and their derivatives by the electrons of light.
    fn expose_with_tape<'py>(
        &self,
        py: Python<'py>,
        electrons: PyArrayLikeDyn<'py, f32, AllowTypeChange>,
        mode: &str,
        settings: Settings,
        watch: Watch<'_>,
    ) -> PyResult<Tracked<'py>> {
        let mode: NoiseMode = serde_json::from_value(mode.into()).map_err(|_| {
            let hint =
                "\"exact\", \"dequantised\", \"half_step\", \"straight_through\", \"gaussian\" or \"off\"";
            refusal(py, "mode", format!("{mode:?}"), "there is no such mode of noise", hint)
        })?;
        let (light, capture) = self.light(py, &electrons.as_array(), settings)?;
        let noise = Noise { mode, seed: settings.0 };
        let (Raw { height, width, dn, .. }, by_light) = watched(py, &watch, |_| {
            expose_with_tape(&light, &self.model, &capture, &noise).map_err(refused)
        })?;
        Ok((picture(py, height, width, dn)?, picture(py, height, width, by_light)?))
    }
}

impl PySensor {
    /// Electrons as irradiance at an exposure whose white is one electron.
    ///
    /// `[y, x, 3]` are the electrons that red, green and blue light give a green pixel. `[y, x]` are those of each pixel behind its own filter:
    /// a filter that passes the shares `r` of the three colours has `e` electrons of even light `e / (r_R + r_G + r_B)`.
    fn light(
        &self,
        py: Python<'_>,
        electrons: &ArrayViewD<'_, f32>,
        Settings(_, frame, time_s, linear_gain, row, col): Settings,
    ) -> PyResult<(LinearImage, Capture)> {
        let shape = electrons.shape();
        let wrong = |found: String, message: &str, hint: &str| refusal(py, "electrons", found, message, hint);
        let (&[height, width] | &[height, width, CHANNELS]) = shape else {
            let found = format!("of shape {shape:?}");
            return Err(wrong(
                found,
                "has the wrong shape",
                "give [y, x], or [y, x, 3] for red, green and blue light",
            ));
        };
        check_window(&self.model, row, col, height, width).map_err(|error| exception(py, &error))?;
        if let Some((place, value)) =
            electrons.indexed_iter().find(|(_, value)| !value.is_finite() || **value < 0.0)
        {
            let message = if value.is_finite() { "is negative" } else { "is not finite" };
            return Err(wrong(
                value.to_string(),
                message,
                &format!("mean electrons, at row {}, column {}", place[0], place[1]),
            ));
        }
        let mut light = LinearImage::zeros(CHANNELS, height, width);
        let pixel = |i: usize| (i / width, i % width);
        for c in 0..CHANNELS {
            let plane = light.plane_mut(c);
            if electrons.ndim() == CHANNELS {
                plane.iter_mut().zip(electrons.index_axis(Axis(2), c).iter()).for_each(|(v, e)| *v = *e);
                continue;
            }
            for (i, (v, e)) in plane.iter_mut().zip(electrons.iter()).enumerate() {
                let (r, s) = pixel(i);
                let response = self.model.response(self.model.cfa.colour(row + r, col + s));
                *v = (f64::from(*e) / response.iter().sum::<f64>()) as f32;
            }
        }
        let exposure = Exposure { white_e: 1.0, time_s, linear_gain };
        Ok((light, Capture { exposure, placement: Placement { row, col }, frame }))
    }
}

/// A sensor as its job reads it.
fn read(py: Python<'_>, input: SensorInput, watch: &Watch<'_>) -> PyResult<PySensor> {
    let model = watched(py, watch, |context| input.read(&context.assets))?;
    Ok(PySensor { model })
}

/// A picture of a known size.
fn picture<T: numpy::Element>(
    py: Python<'_>,
    height: usize,
    width: usize,
    values: Vec<T>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let found = Array2::from_shape_vec((height, width), values);
    Ok(found.map_err(|e| exception(py, &JobError::failed(e.to_string())))?.into_pyarray(py))
}

/// Fails if a window is empty, too large, or leaves the sensor.
fn check_window(
    sensor: &SensorModel,
    row: usize,
    col: usize,
    height: usize,
    width: usize,
) -> Result<(), JobError> {
    if height == 0 || width == 0 || height.saturating_mul(width) > MOST_PIXELS {
        let (found, hint) = (format!("{height} x {width}"), format!("1 to {MOST_PIXELS} pixels"));
        return Err(JobError::setting("size", found, "is no size of a frame", hint));
    }
    for (name, start, size, whole) in
        [("row", row, height, sensor.height), ("column", col, width, sensor.width)]
    {
        if start.checked_add(size).is_none_or(|end| end > whole) {
            let hint = format!(
                "the sensor has {} x {} pixels, the window {height} x {width}",
                sensor.height, sensor.width
            );
            return Err(JobError::setting(name, start, "the window leaves the sensor", hint));
        }
    }
    Ok(())
}

/// The error of a setting by its name in Python.
fn refused(error: SensorError) -> JobError {
    match error {
        SensorError::Exposure { what, value, need } => {
            JobError::setting(what, value, "cannot be set", format!("it must be {need}"))
        }
        SensorError::GainStep { value, nearest } => {
            let hint = format!("the nearest of its steps is {nearest}");
            JobError::setting("linear_gain", value, "the sensor does not offer this gain", hint)
        }
        other => JobError::input(other.to_string(), ""),
    }
}
