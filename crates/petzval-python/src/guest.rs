//! Classes of a user in the Python that Petzval was started from: made and called with its lock, by the functions of `petzval._worker`.

use std::sync::Arc;

use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use petzval_jobs::guest::{Answer, Array, Call, Guest, GuestError, Host, Role, Said, read_answer};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyBytes;
use serde_json::{Map, Value, json};

/// The host of classes in this process. What they print goes where Python prints.
pub struct InProcess {
    said: Said,
}

impl InProcess {
    /// A host; `said` receives the traceback of each exception.
    pub fn new(said: Said) -> Self {
        Self { said }
    }
}

/// An object in this process.
struct Inside {
    object: Py<PyAny>,
    class: String,
    said: Said,
}

/// What an object gives back: its answer as text, arrays, and bytes.
type Given<'py> = (String, Vec<PyReadonlyArrayDyn<'py, f32>>, PyBackedBytes);

/// A fault of the functions themselves.
fn fault(error: &PyErr) -> GuestError {
    GuestError::Gone(format!("petzval._worker: {error}"))
}

impl Host for InProcess {
    fn make(
        &self,
        class: &str,
        role: Role,
        arguments: &Map<String, Value>,
    ) -> Result<(Arc<dyn Guest>, Value), GuestError> {
        let header = json!({"class": class, "role": role, "arguments": arguments}).to_string();
        let made = |py: Python<'_>| -> PyResult<(String, Py<PyAny>)> {
            py.import("petzval._worker")?.getattr("make")?.call1((header,))?.extract()
        };
        let (answer, object) = Python::attach(made).map_err(|e| fault(&e))?;
        let value = read_answer(&answer, class, "__init__", &*self.said)?;
        Ok((Arc::new(Inside { object, class: class.to_owned(), said: self.said.clone() }), value))
    }
}

impl Guest for Inside {
    fn call(&self, call: &Call) -> Result<Answer, GuestError> {
        let header = json!({"method": call.method, "number": call.number}).to_string();
        let called = |py: Python<'_>| -> PyResult<(String, Vec<Array>, Vec<u8>)> {
            let arrays: Vec<Bound<'_, PyArrayDyn<f32>>> = (call.arrays.iter())
                .map(|array| PyArray1::from_slice(py, array.values).reshape(&array.shape[..]))
                .collect::<PyResult<_>>()?;
            let bytes = PyBytes::new(py, call.bytes.unwrap_or_default());
            let function = py.import("petzval._worker")?.getattr("call")?;
            let (answer, arrays, bytes): Given =
                function.call1((&self.object, header, arrays, bytes))?.extract()?;
            let array = |found: &PyReadonlyArrayDyn<'_, f32>| Array {
                values: found.as_array().iter().copied().collect(),
                shape: found.shape().to_vec(),
            };
            Ok((answer, arrays.iter().map(array).collect(), bytes.to_vec()))
        };
        let (answer, arrays, bytes) = Python::attach(called).map_err(|e| fault(&e))?;
        let value = read_answer(&answer, &self.class, call.method, &*self.said)?;
        Ok(Answer { arrays, value, bytes })
    }
}
