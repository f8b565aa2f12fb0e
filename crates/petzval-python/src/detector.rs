//! Detectors: pictures in, boxes out.

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use petzval_jobs::detect::{ObjectFinder, Source};
use petzval_jobs::{Context, JobError, usual};
use pyo3::prelude::*;

use crate::error::{exception, refusal};
use crate::pictures::Picture;
use crate::watch::{Watch, watched};

/// A detector with its weights.
#[pyclass(frozen, name = "Detector", module = "petzval._petzval")]
pub struct PyDetector(ObjectFinder);

/// Boxes `[object, 4]`, names of classes, scores.
type Found<'py> = (Bound<'py, PyArray2<f32>>, Vec<String>, Bound<'py, PyArray1<f32>>);

#[pymethods]
impl PyDetector {
    /// Opens a detector; `detect` is a request of the job `detect`.
    #[new]
    fn new(
        py: Python<'_>,
        detect: &str,
        device: Option<String>,
        accept_changed: Vec<String>,
        watch: Watch<'_>,
    ) -> PyResult<Self> {
        let device = device.unwrap_or_else(usual::device);
        let open = |context: &Context| -> Result<ObjectFinder, JobError> {
            let detect: petzval_jobs::detect::Request = crate::requests::request("detect", detect)?;
            let source: Source = detect.detector;
            ObjectFinder::open(&source, &device, &accept_changed, context)
        };
        watched(py, &watch, open).map(Self)
    }

    /// Names of its classes.
    fn classes(&self) -> Vec<String> {
        self.0.classes().to_vec()
    }

    /// The objects of at least a score in a picture, best first.
    fn find<'py>(
        &self,
        py: Python<'py>,
        picture: Picture<'_>,
        least_score: f32,
        watch: Watch<'_>,
    ) -> PyResult<Found<'py>> {
        if !(0.0..=1.0).contains(&least_score) {
            return Err(refusal(py, "least_score", least_score, "is no score", "between 0 and 1"));
        }
        let given = picture.given(py)?;
        let found = watched(py, &watch, |context| self.0.find(&given.light(context)?, least_score))?;
        let boxes = found.iter().flat_map(|object| object.bbox).collect();
        let boxes = Array2::from_shape_vec((found.len(), 4), boxes)
            .map_err(|e| exception(py, &JobError::failed(e.to_string())))?;
        let scores: Vec<f32> = found.iter().map(|object| object.score).collect();
        let classes = found.into_iter().map(|object| object.class).collect();
        Ok((boxes.into_pyarray(py), classes, scores.into_pyarray(py)))
    }
}
