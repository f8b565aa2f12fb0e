//! Pictures in and out: `[y, x, 3]` in Python, planes in Petzval.

use std::path::PathBuf;

use numpy::ndarray::{Array3, ArrayView3};
use numpy::{Element, IntoPyArray, PyArray3, PyReadonlyArray3};
use petzval_camera::image::{CHANNELS, LinearImage, srgb_decode};
use petzval_design::error::DesignError;
use petzval_files::{encoded_png_bytes, load_image};
use petzval_jobs::{Context, JobError, WarningKind};
use pyo3::prelude::*;

use crate::arrays::Like3;
use crate::error::{exception, refusal};
use crate::watch::{Watch, watched};

/// A picture as Python gives it.
#[derive(FromPyObject)]
pub enum Picture<'py> {
    /// A file.
    Path(PathBuf),
    /// sRGB-encoded, 255 is white.
    Encoded(PyReadonlyArray3<'py, u8>),
    /// Linear light, 1 is white.
    Light(Like3<'py>),
}

/// A picture that is read, or where it is.
pub enum Given {
    Path(PathBuf),
    Light(LinearImage),
}

impl Picture<'_> {
    /// The light of an array, or the path of a file.
    pub fn given(&self, py: Python<'_>) -> PyResult<Given> {
        match self {
            Self::Path(path) => Ok(Given::Path(path.clone())),
            Self::Encoded(bytes) => {
                let light: Vec<f32> = (0..=u8::MAX).map(|v| srgb_decode(f32::from(v) / 255.0)).collect();
                planes(py, bytes.as_array(), |v| light[usize::from(v)]).map(Given::Light)
            }
            Self::Light(light) => planes(py, light.as_array(), |v| v).map(Given::Light),
        }
    }
}

impl Given {
    /// The light of the picture; warns of statements of its file that are ignored.
    pub fn light(self, context: &Context) -> Result<LinearImage, JobError> {
        match self {
            Self::Light(light) => Ok(light),
            Self::Path(path) => {
                let picture = load_image(&path).map_err(DesignError::from)?;
                for note in picture.notes {
                    context.warning(WarningKind::Picture, format!("{}: {note}", path.display()));
                }
                Ok(picture.light)
            }
        }
    }
}

/// The three planes of a picture.
fn planes<T: Copy>(
    py: Python<'_>,
    picture: ArrayView3<'_, T>,
    light: impl Fn(T) -> f32,
) -> PyResult<LinearImage> {
    let (height, width, channels) = picture.dim();
    if channels != CHANNELS || height == 0 || width == 0 {
        let found = format!("of shape {:?}", picture.shape());
        return Err(refusal(py, "picture", found, "is no picture", "give [y, x, 3]: red, green and blue"));
    }
    let data = picture.permuted_axes([2, 0, 1]).iter().map(|v| light(*v)).collect();
    Ok(LinearImage { channels, height, width, data })
}

/// Three planes as an array `[y, x, 3]`, whose memory stays in planes.
pub fn array<T: Element>(
    py: Python<'_>,
    [height, width]: [usize; 2],
    data: Vec<T>,
) -> PyResult<Bound<'_, PyArray3<T>>> {
    let planes = Array3::from_shape_vec((CHANNELS, height, width), data)
        .map_err(|e| exception(py, &JobError::failed(e.to_string())))?;
    Ok(planes.permuted_axes([1, 2, 0]).into_pyarray(py))
}

/// A picture as an array `[y, x, 3]`.
pub fn picture_array(py: Python<'_>, picture: LinearImage) -> PyResult<Bound<'_, PyArray3<f32>>> {
    array(py, [picture.height, picture.width], picture.data)
}

/// Reads a picture: linear light, `[y, x, 3]`.
#[pyfunction]
pub fn read_picture<'py>(
    py: Python<'py>,
    path: PathBuf,
    watch: Watch<'_>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let light = watched(py, &watch, |context| Given::Path(path).light(context))?;
    picture_array(py, light)
}

/// The PNG of a picture `[y, x, 3]` of sRGB-encoded bytes.
#[pyfunction]
pub fn picture_png(py: Python<'_>, picture: PyReadonlyArray3<'_, u8>) -> PyResult<Vec<u8>> {
    let encoded = planes(py, picture.as_array(), |v| f32::from(v) / 255.0)?;
    let png = py.detach(|| encoded_png_bytes(&encoded));
    png.map_err(|e| exception(py, &JobError::failed(e.to_string())))
}
