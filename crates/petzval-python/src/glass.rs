//! Glasses of the catalogues.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1};
use petzval_jobs::glass::{context_with, named};
use petzval_optics::glass::Glass;
use pyo3::prelude::*;

use crate::arrays::{Like1, finite};
use crate::error::refusal;
use crate::watch::{Watch, watched};

/// A glass.
#[pyclass(frozen, name = "Glass", module = "petzval._petzval")]
pub struct PyGlass(Arc<Glass>);

#[pymethods]
impl PyGlass {
    /// The glass of a name, or of `MAKER:NAME`.
    #[new]
    fn new(py: Python<'_>, name: String, glasses: Vec<PathBuf>, watch: Watch<'_>) -> PyResult<Self> {
        watched(py, &watch, |context| named(&name, &context_with(context.clone(), &glasses)?.assets))
            .map(Self)
    }

    /// Index at wavelengths in um, relative to air and at the temperature of the catalogue.
    fn index<'py>(&self, py: Python<'py>, wavelengths_um: Like1<'_>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let um = self.wavelengths(py, &wavelengths_um)?;
        Ok(um.into_iter().map(|um| self.0.index(um)).collect::<Vec<f64>>().into_pyarray(py))
    }

    /// Internal transmittance of a path in mm; NaN where the catalogue does not state it.
    fn transmission<'py>(
        &self,
        py: Python<'py>,
        wavelengths_um: Like1<'_>,
        path_mm: f64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        if !(path_mm.is_finite() && path_mm >= 0.0) {
            return Err(refusal(py, "path_mm", path_mm, "is no path", "in mm, 0 or more"));
        }
        let um = self.wavelengths(py, &wavelengths_um)?;
        let through = |um| self.0.internal_transmission(um, path_mm).unwrap_or(f64::NAN);
        Ok(um.into_iter().map(through).collect::<Vec<f64>>().into_pyarray(py))
    }
}

impl PyGlass {
    /// Wavelengths at which the formula holds.
    fn wavelengths(&self, py: Python<'_>, um: &Like1<'_>) -> PyResult<Vec<f64>> {
        let um = finite(py, "wavelengths_um", um)?;
        let glass = &self.0;
        let wrong = um.iter().find(|um| **um <= 0.0 || glass.is_outside_range(**um));
        let Some(wrong) = wrong else { return Ok(um) };
        let [least, most] = glass.known_range_um().unwrap_or([0.0, f64::INFINITY]);
        let message = format!("the formula of {} does not hold there", glass.name);
        let hint = format!("in um, {least} to {most}; 550 nm is 0.55");
        Err(refusal(py, "wavelengths_um", wrong, message, hint))
    }
}
