//! Arrays of Python on their way in.

use numpy::ndarray::ArrayViewD;
use numpy::{AllowTypeChange, PyArrayLike1, PyArrayLike2, PyArrayLike3, PyArrayLike4, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::error::refusal;

/// Arrays of numbers of any type, and nested lists, as Python gives them: by their dimensions.
pub type Like1<'py, T = f64> = PyArrayLike1<'py, T, AllowTypeChange>;
pub type Like2<'py, T = f64> = PyArrayLike2<'py, T, AllowTypeChange>;
pub type Like3<'py, T = f32> = PyArrayLike3<'py, T, AllowTypeChange>;
pub type Like4<'py, T = f32> = PyArrayLike4<'py, T, AllowTypeChange>;

/// The numbers of an array, all of them finite. A list, an array of whole numbers or of float32, and one with strides will do.
pub fn finite(py: Python<'_>, name: &'static str, array: &Like1<'_>) -> PyResult<Vec<f64>> {
    let numbers: Vec<f64> = array.as_array().iter().copied().collect();
    match numbers.iter().position(|x| !x.is_finite()) {
        None if array.len() > 0 => Ok(numbers),
        None => Err(refusal(py, name, "[]", "is empty", "give one number at least")),
        Some(place) => {
            let hint = format!("element {place} is no finite number");
            Err(refusal(py, name, numbers[place], "is not finite", hint))
        }
    }
}

/// The numbers of an array of a known shape, all of them finite.
pub fn checked(
    py: Python<'_>,
    name: &'static str,
    array: ArrayViewD<'_, f64>,
    shape: &[usize],
) -> PyResult<Vec<f64>> {
    if array.shape() != shape {
        let (found, hint) = (format!("of shape {:?}", array.shape()), format!("give {shape:?}"));
        return Err(refusal(py, name, found, "has the wrong shape", hint));
    }
    if let Some(wrong) = array.iter().find(|x| !x.is_finite()) {
        return Err(refusal(py, name, wrong, "is not finite", ""));
    }
    Ok(array.iter().copied().collect())
}
