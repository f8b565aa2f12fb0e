//! Banks of PSFs as files, and from arrays of a user.

use std::path::PathBuf;

use numpy::ndarray::{Array2, Array4};
use numpy::{IntoPyArray, PyArray2, PyArray4, PyUntypedArrayMethods};
use petzval_files::FloatType;
use petzval_files::psf_file::{PsfAxes, PsfFault, PsfFile, read_psfs, write_psfs};
use petzval_jobs::{JobError, json};
use pyo3::prelude::*;

use crate::arrays::{Like2, Like4};
use crate::error::{exception, refusal};
use crate::lens::PyLens;
use crate::watch::{Watch, watched};

/// Values and illumination of a bank.
type Arrays<'py> = (Bound<'py, PyArray4<f64>>, Bound<'py, PyArray2<f64>>);

/// A bank of arrays and of axes in JSON.
struct Given {
    axes: PsfAxes,
    shape: [usize; 4],
    values: Vec<f64>,
    illumination: Vec<f64>,
}

impl Given {
    fn new(py: Python<'_>, axes: &str, values: &Like4<'_, f64>, illumination: &Like2<'_>) -> PyResult<Self> {
        let axes = PsfAxes::parse(axes)
            .map_err(|e| exception(py, &JobError::input(e.to_string(), e.hint.unwrap_or_default())))?;
        let (values, light) = (values.as_array(), illumination.as_array());
        let &[fields, colours, rows, columns] = values.shape() else {
            return Err(exception(py, &JobError::failed("PSFs without four axes")));
        };
        if light.shape() != [fields, colours] {
            let found = format!("of shape {:?}", illumination.shape());
            return Err(refusal(
                py,
                "illumination",
                found,
                "has the wrong shape",
                format!("give [{fields}, {colours}]"),
            ));
        }
        Ok(Self {
            axes,
            shape: [fields, colours, rows, columns],
            values: values.iter().copied().collect(),
            illumination: light.iter().copied().collect(),
        })
    }

    fn checked(self) -> Result<PsfFile, JobError> {
        PsfFile::new(self.axes, self.shape, self.values, self.illumination).map_err(wrong)
    }

    fn normalised(self) -> Result<PsfFile, JobError> {
        PsfFile::normalised(self.axes, self.shape, self.values, self.illumination).map_err(wrong)
    }
}

/// A fault of an argument. Fields have another name in files.
fn wrong(fault: PsfFault) -> JobError {
    let argument = if fault.key == "field_deg" { "fields_deg" } else { fault.key };
    JobError::setting(argument, fault.value, fault.message, fault.hint)
}

fn arrays(py: Python<'_>, bank: PsfFile) -> PyResult<Arrays<'_>> {
    let PsfFile { shape, values, illumination, .. } = bank;
    let wrong = |e: numpy::ndarray::ShapeError| exception(py, &JobError::failed(e.to_string()));
    Ok((
        Array4::from_shape_vec(shape, values).map_err(wrong)?.into_pyarray(py),
        Array2::from_shape_vec([shape[0], shape[1]], illumination).map_err(wrong)?.into_pyarray(py),
    ))
}

/// The arrays of a bank whose PSFs are divided by their sums, once all of it is known to be right.
#[pyfunction]
pub fn psfs_of<'py>(
    py: Python<'py>,
    axes: &str,
    values: Like4<'_, f64>,
    illumination: Like2<'_>,
    watch: Watch<'_>,
) -> PyResult<Arrays<'py>> {
    let given = Given::new(py, axes, &values, &illumination)?;
    arrays(py, watched(py, &watch, |_| given.normalised())?)
}

/// Writes a bank into a folder, its PSFs in a precision: `float16`, `float32` or `float64`.
#[pyfunction]
pub fn psfs_save(
    py: Python<'_>,
    folder: PathBuf,
    axes: &str,
    values: Like4<'_, f64>,
    illumination: Like2<'_>,
    precision: &str,
    watch: Watch<'_>,
) -> PyResult<()> {
    let precision: FloatType = serde_json::from_value(precision.into()).map_err(|_| {
        let hint = "numpy.float16, numpy.float32 or numpy.float64";
        refusal(py, "dtype", precision, "no type of floats", hint)
    })?;
    let given = Given::new(py, axes, &values, &illumination)?;
    watched(py, &watch, |_| {
        write_psfs(&given.checked()?, &folder, precision)?;
        Ok(())
    })
}

/// Reads a bank: its axes as JSON, and its arrays.
#[pyfunction]
pub fn psfs_load<'py>(py: Python<'py>, path: PathBuf, watch: Watch<'_>) -> PyResult<(String, Arrays<'py>)> {
    let (axes, bank) = watched(py, &watch, |_| {
        let bank = read_psfs(&path)?;
        Ok((json(&bank.axes)?, bank))
    })?;
    Ok((axes, arrays(py, bank)?))
}

/// Whether the PSFs of a lens at other azimuths are the same, turned.
#[pyfunction]
pub fn is_rotationally_symmetric(lens: &PyLens) -> bool {
    lens.file.lens.is_rotationally_symmetric()
}
