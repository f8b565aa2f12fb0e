//! Finished runs: their figures, lenses and cameras.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use numpy::{PyArray3, PyReadonlyArray2, PyUntypedArrayMethods};
use petzval_design::error::DesignError;
use petzval_design::report::run_report::{camera_lens, read_metrics};
use petzval_design::run::picture_names::file_name;
use petzval_design::run::{Metrics, RunFolder, RunRecord};
use petzval_files::raw_file::{RawFrame, RawInfo, load_raw};
use petzval_jobs::apply::{Cameras, Finished, Place, Taking};
use petzval_jobs::run_figures::{check_camera, events, figures};
use petzval_jobs::{Context, JobError, json, usual};
use pyo3::prelude::*;
use serde::Serialize;

use crate::error::exception;
use crate::lens::PyLens;
use crate::pictures::{Picture, picture_array};
use crate::watch::{Watch, watched};

/// The folder of a run, and the files or folders of it that may have been changed.
#[pyclass(frozen, name = "Run", module = "petzval._petzval")]
pub struct PyRun {
    folder: RunFolder,
    accept_changed: Vec<String>,
}

/// What Python reads of a run.
#[derive(Serialize)]
struct Facts {
    name: String,
    seed: u64,
    /// Every camera of the experiment, and those that are finished.
    cameras: Vec<String>,
    finished: Vec<String>,
    /// When and with which version it was made; none in folders of early versions.
    record: Option<serde_json::Value>,
    report: PathBuf,
}

/// A file among the pictures of a run.
#[derive(Serialize)]
struct Shown {
    path: PathBuf,
    index: Option<usize>,
    camera: Option<String>,
    state: Option<&'static str>,
}

/// States of a held-out picture.
const STATES: [&str; 3] = ["truth", "developed", "output"];

#[pymethods]
impl PyRun {
    #[new]
    fn new(py: Python<'_>, path: PathBuf, accept_changed: Vec<String>) -> PyResult<Self> {
        let folder = RunFolder::open(&path).map_err(|error| exception(py, &error.into()))?;
        Ok(Self { folder, accept_changed })
    }

    /// Facts as JSON.
    fn facts(&self, py: Python<'_>, watch: Watch<'_>) -> PyResult<String> {
        watched(py, &watch, |context| {
            let experiment = context.assets.experiment_of_run(&self.folder)?;
            let record = RunRecord::read(&self.folder)?;
            let about = |record: RunRecord| {
                let RunRecord { version, begun, finished, .. } = record;
                serde_json::json!({"version": version, "begun": begun, "finished": finished})
            };
            let cameras: Vec<String> = experiment.variant.iter().map(|v| v.name.clone()).collect();
            let finished = self.folder.finished(cameras.iter().map(String::as_str));
            json(&Facts {
                name: experiment.name.clone(),
                seed: experiment.seed,
                finished: finished.into_iter().map(str::to_owned).collect(),
                cameras: cameras.clone(),
                record: record.map(about),
                report: self.folder.report(),
            })
        })
    }

    /// The figures of all cameras as JSON.
    fn metrics(&self, py: Python<'_>, watch: Watch<'_>) -> PyResult<String> {
        watched(py, &watch, |context| json(&figures(&self.folder, &self.accept_changed, context)?))
    }

    /// Every step as JSON.
    fn events(&self, py: Python<'_>, watch: Watch<'_>) -> PyResult<String> {
        watched(py, &watch, |context| json(&events(&self.folder, &self.accept_changed, context)?))
    }

    /// The lens of a finished camera, or the one that the run began with.
    fn lens(&self, py: Python<'_>, camera: Option<String>, watch: Watch<'_>) -> PyResult<PyLens> {
        let file = watched(py, &watch, |context| match &camera {
            Some(camera) => {
                check_camera(&self.folder, camera, &self.accept_changed, context)?;
                Ok(camera_lens(&self.folder, camera)?)
            }
            None => Ok(context.assets.lens(&self.folder.nominal_lens().display().to_string())?),
        })?;
        Ok(PyLens { file, glasses: Vec::new() })
    }

    /// Where the weights of a camera's network are; none if it has no network.
    fn weights(&self, py: Python<'_>, camera: &str, watch: Watch<'_>) -> PyResult<Option<PathBuf>> {
        watched(py, &watch, |context| {
            check_camera(&self.folder, camera, &self.accept_changed, context)?;
            Ok(Some(self.folder.camera_weights(camera)).filter(|path| path.is_file()))
        })
    }

    /// The files among its pictures, as JSON.
    fn pictures(&self, py: Python<'_>, watch: Watch<'_>) -> PyResult<String> {
        watched(py, &watch, |_| json(&pictures(&self.folder)?))
    }
}

/// The pictures of a finished run by name; which picture, camera and state a name stands for where it is one of a held-out picture.
fn pictures(run: &RunFolder) -> Result<Vec<Shown>, JobError> {
    let metrics = read_metrics(run)?;
    let mut known = known_names(&metrics);
    let folder = run.picture("");
    let io = |error| JobError::from(DesignError::io(&folder)(error));
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(&folder).map_err(io)? {
        paths.push(entry.map_err(io)?.path());
    }
    paths.sort();
    let is_png = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "png");
    let shown = paths.into_iter().filter(is_png).map(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        match known.remove(&name) {
            Some((index, camera, state)) => Shown { path, index: Some(index), camera, state: Some(state) },
            None => Shown { path, index: None, camera: None, state: None },
        }
    });
    Ok(shown.collect())
}

type Stands = (usize, Option<String>, &'static str);

/// What the names of held-out pictures stand for.
fn known_names(metrics: &Metrics) -> BTreeMap<String, Stands> {
    let mut known = BTreeMap::new();
    for index in 0..metrics.held_out_images * metrics.held_out_places {
        let [truth, states @ ..] = STATES;
        known.insert(file_name(index, truth, None), (index, None, truth));
        for camera in metrics.rows.iter().map(|row| &row.camera) {
            for state in states {
                let name = file_name(index, state, Some(camera));
                known.insert(name, (index, Some(camera.clone()), state));
            }
        }
    }
    known
}

/// The finished cameras of a run.
#[pyclass(frozen, name = "Cameras", module = "petzval._petzval")]
pub struct PyCameras(Cameras);

/// A finished picture, sRGB-encoded; the same with what the network reads in it; and files that say so.
type Seen<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray3<f32>>, Vec<(&'static str, Vec<u8>)>);

#[pymethods]
impl PyCameras {
    #[new]
    fn new(
        py: Python<'_>,
        run: PathBuf,
        names: Vec<String>,
        device: Option<String>,
        accept_changed: Vec<String>,
        watch: Watch<'_>,
    ) -> PyResult<Self> {
        let device = device.unwrap_or_else(usual::device);
        let open = |context: &Context| Cameras::open(&run, &names, &device, &accept_changed, context);
        watched(py, &watch, open).map(Self)
    }

    /// Their names.
    fn names(&self) -> Vec<String> {
        self.0.names().to_vec()
    }

    /// Rows and columns of their sensor.
    fn size(&self) -> (usize, usize) {
        (self.0.sensor().height, self.0.sensor().width)
    }

    /// A picture through a camera.
    fn take<'py>(
        &self,
        py: Python<'py>,
        camera: &str,
        picture: Picture<'_>,
        place: Option<&str>,
        seed: Option<u64>,
        frame: u64,
        watch: Watch<'_>,
    ) -> PyResult<Seen<'py>> {
        let usual = Taking::default();
        let place = place.map_or(Ok(usual.place), place_named);
        let place = place.map_err(|error| exception(py, &error))?;
        let taking = Taking { place, seed: seed.unwrap_or(usual.seed), frame };
        let given = picture.given(py)?;
        let finished = watched(py, &watch, |context| self.0.take(camera, &given.light(context)?, taking))?;
        seen(py, finished)
    }

    /// Digital numbers through development and network of a camera.
    fn develop<'py>(
        &self,
        py: Python<'py>,
        camera: &str,
        raw: PyReadonlyArray2<'_, u16>,
        watch: Watch<'_>,
    ) -> PyResult<Seen<'py>> {
        let (height, width) = (raw.shape()[0], raw.shape()[1]);
        let dn = raw.as_array().iter().copied().collect();
        let frame = RawFrame { height, width, dn, info: RawInfo::default() };
        let finished = watched(py, &watch, |_| self.0.develop(camera, &frame))?;
        seen(py, finished)
    }

    /// A raw file through development and network of a camera.
    fn develop_file<'py>(
        &self,
        py: Python<'py>,
        camera: &str,
        path: PathBuf,
        watch: Watch<'_>,
    ) -> PyResult<Seen<'py>> {
        let finished = watched(py, &watch, |_| self.0.develop(camera, &load_raw(Path::new(&path))?))?;
        seen(py, finished)
    }
}

fn place_named(name: &str) -> Result<Place, JobError> {
    serde_json::from_value(name.into())
        .map_err(|_| JobError::setting("place", name, "no such place", "\"fill\" or \"centre\""))
}

fn seen(py: Python<'_>, finished: Finished) -> PyResult<Seen<'_>> {
    let Finished { picture, shown, read } = finished;
    Ok((picture_array(py, picture)?, picture_array(py, shown)?, read))
}
