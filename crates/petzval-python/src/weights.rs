//! Networks and their weights: read, changed as arrays, written, and run.

use numpy::ndarray::{ArrayD, IxDyn};
use numpy::{AllowTypeChange, IntoPyArray, PyArrayDyn, PyArrayLikeDyn};
use petzval_jobs::{JobError, json};
use petzval_learn::any_network::{FileNames, NamedNetwork, NetworkSpec};
use petzval_learn::detection::DetectorConfig;
use petzval_learn::network::NetworkError;
use petzval_learn::weight_file::NamedArray;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::Serialize;

use crate::error::exception;
use crate::watch::{Watch, watched};

/// A network of any kind with its weights.
#[pyclass(frozen, name = "Network", module = "petzval._petzval")]
pub struct PyNetwork(NamedNetwork);

/// Arrays by name, on their way in and out.
type ArraysIn<'py> = Vec<(String, PyArrayLikeDyn<'py, f32, AllowTypeChange>)>;
type ArraysOut<'py> = Vec<(String, Bound<'py, PyArrayDyn<f32>>)>;

/// What Python reads of a network again and again.
#[derive(Serialize)]
struct Facts {
    #[serde(flatten)]
    spec: NetworkSpec,
    detector: Option<DetectorConfig>,
}

#[pymethods]
impl PyNetwork {
    /// The network of a file of weights; `kind` says what it is where its weights do not.
    #[staticmethod]
    fn read(py: Python<'_>, file: &[u8], kind: Option<String>, watch: Watch<'_>) -> PyResult<Self> {
        let read = |_: &_| NamedNetwork::read(file, kind.as_deref()).map_err(misfit);
        watched(py, &watch, read).map(Self)
    }

    /// The network of a file of the built-in library.
    #[staticmethod]
    fn built_in(py: Python<'_>, name: String, watch: Watch<'_>) -> PyResult<Self> {
        let network = watched(py, &watch, |context| {
            let file = context.assets.bytes(&format!("weights/{name}.safetensors"))?;
            NamedNetwork::read(file, None).map_err(misfit)
        });
        network.map(Self)
    }

    /// The network of weights by name.
    #[staticmethod]
    fn of(py: Python<'_>, weights: ArraysIn<'_>, kind: Option<String>, watch: Watch<'_>) -> PyResult<Self> {
        let weights = arrays_in(weights);
        let of = |_: &_| NamedNetwork::of(weights, kind.as_deref()).map_err(misfit);
        watched(py, &watch, of).map(Self)
    }

    /// A network of a kind and sizes, as JSON, with weights drawn from a seed.
    #[staticmethod]
    fn drawn(py: Python<'_>, spec: &str, seed: u64, watch: Watch<'_>) -> PyResult<Self> {
        let drawn = |_: &_| {
            let spec: NetworkSpec = serde_json::from_str(spec).map_err(|e| {
                JobError::setting("settings", spec, e.to_string(), "the settings of the kind of network")
            })?;
            NamedNetwork::drawn(spec, seed).map_err(|e| JobError::input(e.to_string(), ""))
        };
        watched(py, &watch, drawn).map(Self)
    }

    /// Its kind, sizes and settings as JSON.
    fn facts(&self, py: Python<'_>) -> PyResult<String> {
        let spec = self.0.spec();
        json(&Facts { detector: spec.detector(), spec }).map_err(|error| exception(py, &error))
    }

    /// All weights by name.
    fn tensors<'py>(&self, py: Python<'py>) -> PyResult<ArraysOut<'py>> {
        arrays_out(py, self.0.tensors().map_err(|e| exception(py, &misfit(e)))?)
    }

    /// All weights as a safetensors file, under the names of this program or of torchvision.
    fn file<'py>(
        &self,
        py: Python<'py>,
        of_torchvision: bool,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let names = if of_torchvision { FileNames::Torchvision } else { FileNames::Petzval };
        let refused = |e: NetworkError| JobError::input(e.to_string(), "leave out `names`");
        let file = watched(py, &watch, |_| self.0.to_file(names).map_err(refused))?;
        Ok(PyBytes::new(py, &file))
    }

    /// What the network makes of inputs.
    fn run<'py>(&self, py: Python<'py>, inputs: ArraysIn<'_>, watch: Watch<'_>) -> PyResult<ArraysOut<'py>> {
        let inputs = arrays_in(inputs);
        let refused = |e: NetworkError| JobError::input(e.to_string(), "");
        let outputs = watched(py, &watch, |_| self.0.run(inputs).map_err(refused))?;
        arrays_out(py, outputs)
    }
}

fn arrays_in(arrays: ArraysIn<'_>) -> Vec<NamedArray> {
    let array = |(name, array): (String, PyArrayLikeDyn<'_, f32, AllowTypeChange>)| {
        let array = array.as_array();
        NamedArray { name, shape: array.shape().to_vec(), values: array.iter().copied().collect() }
    };
    arrays.into_iter().map(array).collect()
}

fn arrays_out(py: Python<'_>, arrays: Vec<NamedArray>) -> PyResult<ArraysOut<'_>> {
    let array = |NamedArray { name, shape, values }| {
        let array = ArrayD::from_shape_vec(IxDyn(&shape), values)
            .map_err(|e| exception(py, &JobError::failed(format!("{name}: {e}"))))?;
        Ok((name, array.into_pyarray(py)))
    };
    arrays.into_iter().map(array).collect()
}

fn misfit(error: NetworkError) -> JobError {
    JobError::input(error.to_string(), "give all weights of one network, and its `kind` if they fit several")
}
