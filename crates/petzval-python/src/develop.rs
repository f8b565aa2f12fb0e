//! The automotive ISP: its parameters, its fixed-point form, and its floating-point form with derivatives.

use std::path::PathBuf;

use numpy::ndarray::{Array, Array2, Array3, Array4, ArrayViewD, Dimension, StrideShape};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArray4};
use petzval_camera::develop::{Demosaic, Domain};
use petzval_camera::image::CHANNELS;
use petzval_camera::isp::{
    IspError, IspParameter, IspPreset, IspSettings, RawInput, RgbPicture, SmoothIsp, smooth_picture,
    smooth_pull_back,
};
use petzval_jobs::isp::show::ShownParameter;
use petzval_jobs::isp::{NEUTRAL, NamedIsp, about_frame, develop, isp_by_name, preset_file};
use petzval_jobs::{Context, JobError, json};
use pyo3::prelude::*;
use serde::de::DeserializeOwned;

use crate::arrays::{Like2, Like3, Like4, checked};
use crate::error::{exception, refusal};
use crate::raw_frame::{NAME, PyRawFrame};
use crate::watch::{Watch, watched};

/// Name of the text of an ISP that is in no file.
const INLINE: &str = "ISP (inline)";

/// By which share of its range a value may lie outside: rounding to 32 bits may bring it there.
const ROUNDING: f64 = 1e-6;

/// Settings of the built-in ISP, by the gain of the sensor.
#[pyclass(frozen, name = "Isp", module = "petzval._petzval")]
pub struct PyIsp {
    preset: IspPreset,
}

/// Derivatives by raw frames `[frame, y, x]` and by parameters `[frame, parameter]`.
type Derivatives<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray2<f64>>);

#[pymethods]
impl PyIsp {
    /// The ISP of a preset by name or path; without one every parameter has its default.
    #[staticmethod]
    fn load(py: Python<'_>, name: Option<&str>, watch: Watch<'_>) -> PyResult<Self> {
        let name = name.unwrap_or(NEUTRAL);
        watched(py, &watch, |context| Self::of(&isp_by_name(name, &context.assets, context.cancel())?, name))
    }

    /// The ISP of the text of a preset.
    #[staticmethod]
    fn parse(py: Python<'_>, text: String, watch: Watch<'_>) -> PyResult<Self> {
        watched(py, &watch, |context| {
            let library = context.assets.clone().with_text(INLINE.to_owned(), text);
            Self::of(&isp_by_name(INLINE, &library, context.cancel())?, INLINE)
        })
    }

    /// The preset as text of its file.
    fn toml(&self, py: Python<'_>) -> PyResult<String> {
        preset_file(&self.preset).map_err(|error| exception(py, &error))
    }

    /// Writes the file of the preset: whole, or not at all.
    fn save(&self, py: Python<'_>, path: PathBuf, watch: Watch<'_>) -> PyResult<()> {
        watched(py, &watch, |_| {
            let text = preset_file(&self.preset)?;
            petzval_base::write_whole(&path, text.as_bytes()).map_err(|e| {
                let hint = "name a file in a folder that can be written";
                JobError::system(format!("{}: {e}", path.display()), &e, hint)
            })
        })
    }

    /// What the preset is for.
    fn about(&self) -> &str {
        &self.preset.about
    }

    /// The method of demosaicing, and the values that it takes.
    fn methods(&self, py: Python<'_>) -> PyResult<String> {
        let set = &self.preset.settings;
        json(&(set.demosaic, set.domain)).map_err(|error| exception(py, &error))
    }

    /// The parameters with their values at a gain of the sensor in EV, as JSON.
    fn parameters(&self, py: Python<'_>, gain_ev: f64) -> PyResult<String> {
        let shown = || -> Result<String, JobError> {
            let values = self.values_at(gain_ev)?;
            let all = IspSettings::parameters();
            let all: Vec<_> = all.iter().zip(values).map(|(p, v)| ShownParameter::new(p, v)).collect();
            json(&all)
        };
        shown().map_err(|error| exception(py, &error))
    }

    /// The values of the parameters at a gain of the sensor in EV.
    fn values<'py>(&self, py: Python<'py>, gain_ev: f64) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let values = self.values_at(gain_ev).map_err(|error| exception(py, &error))?;
        Ok(values.into_pyarray(py))
    }

    /// Places of the parameters that names stand for: a parameter, all numbers of an array, all of a stage, or `all`.
    fn places(&self, py: Python<'_>, names: Vec<String>) -> PyResult<Vec<usize>> {
        self.named().all_places(&names).map_err(|error| exception(py, &error))
    }

    /// The ISP with some values at every gain, and perhaps with other methods.
    fn changed(
        &self,
        py: Python<'_>,
        numbers: Vec<(String, f64)>,
        demosaic: Option<String>,
        domain: Option<String>,
    ) -> PyResult<Self> {
        let changed = || -> Result<Self, JobError> {
            let mut preset = self.preset.clone();
            // The checks, and their hints, are those of the command.
            let written: Vec<String> =
                numbers.iter().map(|(name, value)| format!("{name}={value}")).collect();
            self.named().set(&written)?;
            let (parameters, mut values) = (IspSettings::parameters(), preset.settings.values());
            for (name, number) in &numbers {
                if let Some(i) = parameters.iter().position(|p| p.name == *name) {
                    values[i] = *number;
                }
                for knot in &mut preset.knot {
                    knot.set.remove(name);
                }
            }
            preset.knot.retain(|knot| !knot.set.is_empty());
            preset.settings = preset.settings.with_values(&values).map_err(|e| refused(&e))?;
            if let Some(name) = demosaic {
                preset.settings.demosaic = method("demosaic", &name, &Demosaic::ALL.map(Demosaic::name))?;
            }
            if let Some(name) = domain {
                preset.settings.domain = method::<Domain>("domain", &name, &["linear", "stabilised"])?;
            }
            Ok(Self { preset })
        };
        changed().map_err(|error| exception(py, &error))
    }

    /// The ISP with the values that it has at a gain of the sensor in EV, at every gain.
    fn at_gain(&self, py: Python<'_>, gain_ev: f64) -> PyResult<Self> {
        let settings =
            finite_gain(gain_ev).and_then(|()| self.preset.at_gain(gain_ev).map_err(|e| refused(&e)));
        let settings = settings.map_err(|error| exception(py, &error))?;
        Ok(Self { preset: IspPreset { about: self.preset.about.clone(), settings, knot: Vec::new() } })
    }

    /// Develops a frame by the fixed-point form, to `[y, x, 3]`: 8 bits as `uint8`, 10 and 16 as `uint16`.
    fn develop<'py>(
        &self,
        py: Python<'py>,
        frame: &PyRawFrame,
        bits: Option<u32>,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let bits = bits.unwrap_or(develop::Request::default().bits);
        let picture = watched(py, &watch, |_| {
            let mut named = self.named();
            named.set_bits(bits);
            let values = named.values(frame.input.about.gain_ev)?;
            let picture = named.isp().develop(&frame.input, &values).map_err(|e| refused(&e))?;
            Ok(interleaved(&picture))
        })?;
        let shape = (frame.input.height, frame.input.width, CHANNELS);
        if bits == 8 {
            let narrow = picture.into_iter().map(|v| v as u8).collect();
            return Ok(array(py, shape, narrow)?.into_pyarray(py).into_any());
        }
        Ok(array(py, shape, picture)?.into_pyarray(py).into_any())
    }

    /// Develops linear digital numbers `[frame, y, x]` by the floating-point form with values `[frame, parameter]`, to `[frame, 3, y, x]`.
    fn smooth<'py>(
        &self,
        py: Python<'py>,
        frame: &PyRawFrame,
        raw: Like3<'_>,
        values: Like2<'_>,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyArray4<f32>>> {
        let batch = self.batch(py, frame, &raw, &values)?;
        let pictures = watched(py, &watch, |context| batch.develop(context))?;
        let shape = (batch.frames, CHANNELS, batch.frame.height, batch.frame.width);
        let pictures: Array4<f32> = array(py, shape, pictures)?;
        Ok(pictures.into_pyarray(py))
    }

    /// Derivatives of a loss that has the derivatives `cotangent` by what [`Self::smooth`] returns.
    fn pull_back<'py>(
        &self,
        py: Python<'py>,
        frame: &PyRawFrame,
        raw: Like3<'_>,
        values: Like2<'_>,
        cotangent: Like4<'_>,
        watch: Watch<'_>,
    ) -> PyResult<Derivatives<'py>> {
        let batch = self.batch(py, frame, &raw, &values)?;
        let Batch { frames, frame: RawInput { height, width, .. }, .. } = batch;
        let cotangent = checked_f32(
            py,
            "cotangent",
            cotangent.as_array().into_dyn(),
            &[frames, CHANNELS, height, width],
        )?;
        let (by_raw, by_values) = watched(py, &watch, |context| batch.pull_back(&cotangent, context))?;
        let by_raw: Array3<f32> = array(py, (frames, height, width), by_raw)?;
        let by_values: Array2<f64> = array(py, (frames, IspSettings::parameters().len()), by_values)?;
        Ok((by_raw.into_pyarray(py), by_values.into_pyarray(py)))
    }
}

impl PyIsp {
    /// The built-in ISP behind a name. Others have no floating-point form, and no file of their own to save.
    fn of(named: &NamedIsp, name: &str) -> Result<Self, JobError> {
        let preset = named.preset().cloned().ok_or_else(|| {
            let hint = "give a preset; petzval.jobs.run(\"isp-develop\", {\"isp\": PATH, ..}) develops with other ISPs";
            JobError::setting("preset", name, "stands for an external ISP or a proxy", hint)
        })?;
        Ok(Self { preset })
    }

    fn named(&self) -> NamedIsp {
        NamedIsp::of_preset(self.preset.clone())
    }

    fn values_at(&self, gain_ev: f64) -> Result<Vec<f64>, JobError> {
        finite_gain(gain_ev)?;
        self.named().values(gain_ev)
    }

    /// Frames and values, checked.
    fn batch(
        &self,
        py: Python<'_>,
        frame: &PyRawFrame,
        raw: &Like3<'_>,
        values: &Like2<'_>,
    ) -> PyResult<Batch> {
        let (frames, height, width) = raw.as_array().dim();
        let raw = checked_f32(py, NAME, raw.as_array().into_dyn(), &[frames, height, width])?;
        let parameters = IspSettings::parameters();
        let values = checked(py, "parameters", values.as_array().into_dyn(), &[frames, parameters.len()])?;
        let batch = || -> Result<Batch, IspError> {
            let frame = RawInput { height, width, dn: vec![0; height * width], ..frame.input.clone() };
            frame.validate()?;
            for row in values.chunks_exact(parameters.len()) {
                check_rounded(&parameters, row)?;
            }
            Ok(Batch {
                isp: SmoothIsp { settings: self.preset.settings.clone() },
                frame,
                frames,
                raw,
                values,
            })
        };
        batch().map_err(|error| exception(py, &refused(&error)))
    }
}

/// Frames of one camera with the values of the parameters for each.
struct Batch {
    isp: SmoothIsp,
    /// Size and calibration of the frames.
    frame: RawInput,
    frames: usize,
    raw: Vec<f32>,
    values: Vec<f64>,
}

impl Batch {
    /// Numbers and values of a frame.
    fn of_frame(&self, i: usize) -> (&[f32], &[f64]) {
        let (pixels, count) = (self.frame.height * self.frame.width, self.values.len() / self.frames);
        (&self.raw[i * pixels..][..pixels], &self.values[i * count..][..count])
    }

    /// The pictures, one frame after the other: the operations of each use all threads.
    fn develop(&self, context: &Context) -> Result<Vec<f32>, JobError> {
        let mut pictures = Vec::new();
        for i in 0..self.frames {
            context.check(|| "stopped before all frames were developed")?;
            let (raw, values) = self.of_frame(i);
            pictures.extend(smooth_picture(&self.isp, raw, &self.frame, values).map_err(|e| refused(&e))?);
        }
        Ok(pictures)
    }

    /// Derivatives by numbers and values, one tape after the other: a tape keeps the planes of every stage.
    fn pull_back(&self, cotangent: &[f32], context: &Context) -> Result<(Vec<f32>, Vec<f64>), JobError> {
        let size = CHANNELS * self.frame.height * self.frame.width;
        let (mut by_raw, mut by_values) = (Vec::new(), Vec::new());
        for i in 0..self.frames {
            context.check(|| "stopped before all frames were developed")?;
            let ((raw, values), of_picture) = (self.of_frame(i), &cotangent[i * size..][..size]);
            let found = smooth_pull_back(&self.isp, raw, &self.frame, values, of_picture);
            let (of_raw, of_values) = found.map_err(|e| refused(&e))?;
            by_raw.extend(of_raw);
            by_values.extend(of_values);
        }
        Ok((by_raw, by_values))
    }
}

/// An array of numbers in the order of memory.
pub fn array<T, D: Dimension>(
    py: Python<'_>,
    shape: impl Into<StrideShape<D>>,
    values: Vec<T>,
) -> PyResult<Array<T, D>> {
    Array::from_shape_vec(shape, values).map_err(|e| exception(py, &JobError::failed(e.to_string())))
}

/// The numbers of an array of a known shape, all of them finite.
pub fn checked_f32(
    py: Python<'_>,
    name: &'static str,
    values: ArrayViewD<'_, f32>,
    shape: &[usize],
) -> PyResult<Vec<f32>> {
    if values.shape() != shape {
        let (found, hint) = (format!("of shape {:?}", values.shape()), format!("give {shape:?}"));
        return Err(refusal(py, name, found, "has the wrong shape", hint));
    }
    if let Some(wrong) = values.iter().find(|v| !v.is_finite()) {
        return Err(refusal(py, name, wrong, "is not finite", ""));
    }
    Ok(values.iter().copied().collect())
}

/// Red, green and blue of each pixel together.
fn interleaved(picture: &RgbPicture) -> Vec<u16> {
    let pixels = picture.height * picture.width;
    (0..pixels).flat_map(|i| [0, 1, 2].map(|c| picture.data[c * pixels + i])).collect()
}

/// A method by its name.
pub fn method<T: DeserializeOwned>(key: &'static str, name: &str, known: &[&str]) -> Result<T, JobError> {
    serde_json::from_value(name.into())
        .map_err(|_| JobError::setting(key, name, "no such method", known.join(", ")))
}

/// The error of an ISP, about a frame without a file.
fn refused(error: &IspError) -> JobError {
    about_frame(NAME.as_ref())(error.clone())
}

fn finite_gain(gain_ev: f64) -> Result<(), JobError> {
    if gain_ev.is_finite() {
        return Ok(());
    }
    Err(JobError::setting("gain_ev", gain_ev, "is not finite", "stops above the lowest gain of the sensor"))
}

/// Checks the values of parameters that may have been rounded to 32 bits.
fn check_rounded(parameters: &[IspParameter], values: &[f64]) -> Result<(), IspError> {
    for (IspParameter { name, about }, value) in parameters.iter().zip(values) {
        let (min, max) = (about.min, about.max);
        let slack = ROUNDING * (max - min);
        if !(min - slack..=max + slack).contains(value) {
            return Err(IspError::Parameter { name: name.clone(), value: *value, min, max });
        }
    }
    Ok(())
}
