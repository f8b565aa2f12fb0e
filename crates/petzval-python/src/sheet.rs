//! Sensors measured from captures.

use std::path::PathBuf;

use petzval_jobs::sensor::characterize::{Characterization, Request, characterization, keep, sensor_toml};
use petzval_jobs::{JobError, json};
use petzval_report::sensor_sheet;
use pyo3::prelude::*;

use crate::requests::request;
use crate::watch::{Watch, watched};

/// Every number of a sensor that captures determine.
#[pyclass(frozen, name = "Sheet", module = "petzval._petzval")]
pub struct PySheet {
    request: Request,
    found: Characterization,
}

/// Linear gain and colour, figures in words, plots as SVG.
type Front = (f64, &'static str, Vec<(String, String)>, Vec<String>);

#[pymethods]
impl PySheet {
    /// Measures by a request of `sensor-characterize`; writes nothing.
    #[new]
    fn new(py: Python<'_>, characterize: &str, watch: Watch<'_>) -> PyResult<Self> {
        watched(py, &watch, |context| {
            let request: Request = request("sensor-characterize", characterize)?;
            let found = characterization(&request, context)?;
            Ok(Self { request, found })
        })
    }

    /// All figures as JSON.
    fn characterization(&self, py: Python<'_>, watch: Watch<'_>) -> PyResult<String> {
        watched(py, &watch, |_| json(&self.found))
    }

    /// What stands in front of the page: linear gain and colour, figures in words, plots as SVG; none without flat frames.
    fn front(&self, py: Python<'_>, watch: Watch<'_>) -> PyResult<Option<Front>> {
        watched(py, &watch, |_| {
            let front = sensor_sheet::front(&self.found);
            Ok(front.map(|f| (f.linear_gain, f.colour.name(), f.figures, f.plots)))
        })
    }

    /// The page and its pictures: names and texts.
    fn pages(&self, py: Python<'_>, watch: Watch<'_>) -> PyResult<Vec<(String, String)>> {
        watched(py, &watch, |_| Ok(sensor_sheet::files(&self.found)))
    }

    /// The text of a sensor file.
    fn sensor_toml(&self, py: Python<'_>, watch: Watch<'_>) -> PyResult<String> {
        watched(py, &watch, |_| sensor_file(&self.found))
    }

    /// Writes every file of the job into a folder; returns their paths.
    fn save(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        overwrite: bool,
        watch: Watch<'_>,
    ) -> PyResult<Vec<PathBuf>> {
        watched(py, &watch, |context| {
            keep(&self.found, self.request.values, &folder, &context.clone().overwriting(overwrite))
        })
    }
}

fn sensor_file(found: &Characterization) -> Result<String, JobError> {
    sensor_toml(found).map_err(|why| {
        let hint = "capture flat frames at several levels of light, two of each";
        JobError::input(format!("no sensor follows from these captures: K is not resolved: {why}"), hint)
    })
}
