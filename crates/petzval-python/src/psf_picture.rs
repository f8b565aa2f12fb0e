//! PSFs as a picture.

use petzval_optics::psf::{FieldPsf, PsfOptions};
use petzval_report::psf_sheet::psf_sheet_of;
use pyo3::prelude::*;

use crate::arrays::{Like1, Like2, Like4, checked, finite};
use crate::watch::{Watch, watched};

/// A sheet of PSFs `[field, wavelength, y, x]` as a PNG: a column a field.
#[pyfunction]
pub fn psf_picture(
    py: Python<'_>,
    values: Like4<'_, f64>,
    fields_deg: Like1<'_>,
    chief_mm: Like2<'_>,
    wavelengths_um: Like1<'_>,
    pitch_um: f64,
    watch: Watch<'_>,
) -> PyResult<Vec<u8>> {
    let fields = finite(py, "fields_deg", &fields_deg)?;
    let colours = finite(py, "wavelengths_um", &wavelengths_um)?;
    let grid = values.as_array().shape()[3];
    let chief = checked(py, "chief_mm", chief_mm.as_array().into_dyn(), &[fields.len(), 2])?;
    let shape = [fields.len(), colours.len(), grid, grid];
    let values = checked(py, "values", values.as_array().into_dyn(), &shape)?;
    let of_field = |i: usize| FieldPsf {
        field_rad: fields[i].to_radians(),
        chief_x_mm: chief[2 * i],
        chief_y_mm: chief[2 * i + 1],
        values: values[i * colours.len() * grid * grid..]
            .chunks(grid * grid)
            .take(colours.len())
            .map(<[f64]>::to_vec)
            .collect(),
        // The sheet shows none of these.
        illumination: Vec::new(),
        image_area: 1.0,
        captured: Vec::new(),
        method: Vec::new(),
    };
    watched(py, &watch, |_| {
        let psfs: Vec<FieldPsf> = (0..fields.len()).map(of_field).collect();
        let options = PsfOptions { grid, pitch_um, ..PsfOptions::default() };
        Ok(psf_sheet_of(&psfs, &options, &colours))
    })
}
