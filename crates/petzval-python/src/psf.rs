//! PSFs of a lens, and of the lenses of a design space with their gradient.

use numpy::ndarray::{Array1, Array2, Array4};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray4};
use petzval_design::lens::psf_plan::scale_of_bank_mm;
use petzval_jobs::{Context, JobError, psf};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::psf::{FieldPsf, PsfCotangent, PsfOptions, PsfTangent, psf_converged, psf_with_tape};
use petzval_optics::pupil::{PupilRefinement, Quadrature, chief_ray, pull_back_chief};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::{Like1, Like2, Like4, checked, finite};
use crate::error::{exception, refusal};
use crate::lens::{PyLens, check_fields};
use crate::space::PyDesignSpace;
use crate::watch::{Watch, watched};

/// Fields, colours and cells of PSFs.
#[pyclass(frozen, name = "PsfPlan", module = "petzval._petzval")]
pub struct PyPsfPlan {
    fields_deg: Vec<f64>,
    wavelengths_um: Vec<f64>,
    options: PsfOptions,
    /// Cells a side of the pupil: the first number of them where they are refined.
    pupil_cells: usize,
    quadrature: Quadrature,
}

/// The arrays of PSFs: values, illumination, chief rays in mm, captured light.
type Outputs<'py> = (
    Bound<'py, PyArray4<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// The same, then pupil cells and their error.
type Arrays<'py> = (
    Bound<'py, PyArray4<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    usize,
    f64,
);

/// The outputs of one field.
struct OfField {
    values: Vec<Vec<f64>>,
    illumination: Vec<f64>,
    chief_mm: [f64; 2],
    captured: Vec<f64>,
}

impl From<FieldPsf> for OfField {
    fn from(psf: FieldPsf) -> Self {
        let FieldPsf { values, illumination, chief_x_mm, chief_y_mm, captured, .. } = psf;
        Self { values, illumination, chief_mm: [chief_x_mm, chief_y_mm], captured }
    }
}

impl From<PsfTangent> for OfField {
    fn from(PsfTangent { values, illumination, chief_mm, captured }: PsfTangent) -> Self {
        Self { values, illumination, chief_mm, captured }
    }
}

#[pymethods]
impl PyPsfPlan {
    #[new]
    fn new(
        py: Python<'_>,
        fields_deg: Like1<'_>,
        wavelengths_um: Like1<'_>,
        grid: i64,
        pitch_um: f64,
        kind: &str,
        pupil_cells: i64,
    ) -> PyResult<Self> {
        let fields_deg = finite(py, "fields_deg", &fields_deg)?;
        let wavelengths_um = finite(py, "wavelengths_um", &wavelengths_um)?;
        let plan = || -> Result<Self, JobError> {
            check_fields(&fields_deg, 180.0)?;
            let kind = serde_json::from_value(kind.into()).map_err(|_| {
                let hint = "\"geometric\" or \"diffraction\"";
                JobError::setting("kind", kind, "no such kind", hint)
            })?;
            let count = |cells: i64| usize::try_from(cells).unwrap_or(0);
            let request = psf::Request {
                wavelengths: wavelengths_um.clone(),
                grid: count(grid),
                pitch_um,
                kind,
                pupil_cells: count(pupil_cells),
                ..psf::Request::default()
            };
            let (options, quadrature) = request.options()?;
            let pupil_cells = request.pupil_cells;
            Ok(Self { fields_deg, wavelengths_um, options, pupil_cells, quadrature })
        };
        // Arguments have names of their own, and numbers below 0 are shown as they were given.
        let named = |error: JobError| match error {
            JobError::Setting { key: "wavelengths", value, message, hint } => {
                JobError::Setting { key: "wavelengths_um", value, message, hint }
            }
            JobError::Setting { key: "grid", message, hint, .. } => {
                JobError::setting("grid", grid, message, hint)
            }
            JobError::Setting { key: "pupil_cells", message, hint, .. } => {
                JobError::setting("pupil_cells", pupil_cells, message, hint)
            }
            other => other,
        };
        plan().map_err(|error| exception(py, &named(error)))
    }

    /// The PSFs of a lens, on as many pupil cells as the error needs.
    fn of_lens<'py>(
        &self,
        py: Python<'py>,
        lens: &PyLens,
        pupil_error: f64,
        watch: Watch<'_>,
    ) -> PyResult<Arrays<'py>> {
        if pupil_error.is_nan() || pupil_error <= 0.0 {
            return Err(refusal(py, "pupil_error", pupil_error, "is not positive", "0.02 is usual"));
        }
        let refinement =
            PupilRefinement { tolerance: pupil_error, first_cells: self.pupil_cells, most_cells: 4096 };
        let lens = &lens.file.lens;
        let found = watched(py, &watch, |context| {
            self.by_field(context, |field| {
                psf_converged(lens, field, &self.wavelengths_um, &self.options, &refinement)
            })
        })?;
        let cells = found.iter().map(|of| of.cells).max().unwrap_or(self.pupil_cells);
        let error = found.iter().map(|of| of.error).fold(0.0, f64::max);
        let (values, light, chief_mm, captured) =
            self.arrays(py, found.into_iter().map(|of| of.value.into()))?;
        Ok((values, light, chief_mm, captured, cells, error))
    }

    /// Image height per tangent of the field near the axis of a lens, mm, as a bank of these fields states it; `None` if it has none.
    ///
    /// It is measured at a thousandth of the outermost field. If all fields lie on the axis, the outermost one of the lens is taken.
    fn image_scale_mm(&self, lens: &PyLens) -> Option<f64> {
        let lens = &lens.file.lens;
        let outermost = self.fields_deg.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let outermost_deg = outermost.filter(|deg| *deg != 0.0).unwrap_or_else(|| lens.outermost_field_deg());
        scale_of_bank_mm(lens, outermost_deg.to_radians())
    }

    /// The PSFs of the lens with these numbers, on the pupil cells of the plan.
    fn at<'py>(
        &self,
        py: Python<'py>,
        space: &PyDesignSpace,
        numbers: Like1<'_>,
        watch: Watch<'_>,
    ) -> PyResult<Arrays<'py>> {
        let lens = space.lens_with(py, &numbers)?;
        let psfs = watched(py, &watch, |context| {
            let of_field =
                |field| psf_with_tape(&lens, field, &self.wavelengths_um, &self.quadrature, &self.options);
            Ok(self.by_field(context, of_field)?.into_iter().map(|(psf, _)| psf).collect::<Vec<_>>())
        })?;
        let (values, light, chief_mm, captured) = self.arrays(py, psfs.into_iter().map(OfField::from))?;
        Ok((values, light, chief_mm, captured, self.pupil_cells, 0.0))
    }

    /// Derivatives of values, illumination, chief rays (mm) and captured light along a direction: a change of each number of the lens.
    fn push_forward<'py>(
        &self,
        py: Python<'py>,
        space: &PyDesignSpace,
        numbers: Like1<'_>,
        direction: Like1<'_>,
        watch: Watch<'_>,
    ) -> PyResult<Outputs<'py>> {
        let lens = space.lens_with(py, &numbers)?;
        let change = space.change(py, &direction)?;
        let tangents = watched(py, &watch, |context| {
            self.by_field(context, |field| {
                let (psf, tape) =
                    psf_with_tape(&lens, field, &self.wavelengths_um, &self.quadrature, &self.options)?;
                Some(tape.push_forward(&psf, &self.quadrature, &change))
            })
        })?;
        self.arrays(py, tangents.into_iter().map(OfField::from))
    }

    /// Derivatives by the numbers of the lens of a loss with these derivatives by values, illumination and chief rays (1/mm).
    fn pull_back<'py>(
        &self,
        py: Python<'py>,
        space: &PyDesignSpace,
        numbers: Like1<'_>,
        values: Like4<'_, f64>,
        illumination: Like2<'_>,
        chief_mm: Like2<'_>,
        watch: Watch<'_>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let lens = space.lens_with(py, &numbers)?;
        let (fields, colours, grid) = (self.fields_deg.len(), self.wavelengths_um.len(), self.options.grid);
        let values = checked(py, "values", values.as_array().into_dyn(), &[fields, colours, grid, grid])?;
        let light = checked(py, "illumination", illumination.as_array().into_dyn(), &[fields, colours])?;
        let chief_mm = checked(py, "chief_mm", chief_mm.as_array().into_dyn(), &[fields, 2])?;
        let gradient = watched(py, &watch, |context| {
            let cells = grid * grid;
            let of_field = |i: usize| {
                let of_colour = |c: usize| values[(i * colours + c) * cells..][..cells].to_vec();
                let cotangent = PsfCotangent {
                    values: (0..colours).map(of_colour).collect(),
                    illumination: light[i * colours..][..colours].to_vec(),
                    chief_y: chief_mm[2 * i + 1],
                };
                self.gradient(&lens, self.fields_deg[i].to_radians(), &cotangent, chief_mm[2 * i])
            };
            let parts = (0..fields)
                .into_par_iter()
                .map(|i| {
                    context.check(|| "stopped before all fields were traced")?;
                    of_field(i).ok_or_else(|| no_light(self.fields_deg[i]))
                })
                .collect::<Result<Vec<_>, JobError>>()?;
            let mut sum = LensGradient::zero(lens.surfaces.len());
            parts.iter().for_each(|part| sum += part);
            Ok(space.by_numbers(&sum))
        })?;
        Ok(Array1::from_vec(gradient).into_pyarray(py))
    }
}

impl PyPsfPlan {
    /// Field angles, degrees.
    pub fn fields_deg(&self) -> &[f64] {
        &self.fields_deg
    }

    /// Wavelengths, um.
    pub fn wavelengths_um(&self) -> &[f64] {
        &self.wavelengths_um
    }

    /// The gradient of the relative illumination of a field at the middle wavelength; `None` if no light arrives.
    pub fn light_gradient(&self, lens: &Lens, field_rad: f64) -> Option<LensGradient> {
        let (colours, cells) = (self.wavelengths_um.len(), self.options.grid.pow(2));
        let mut illumination = vec![0.0; colours];
        illumination[colours / 2] = 1.0;
        let cotangent = PsfCotangent { values: vec![vec![0.0; cells]; colours], illumination, chief_y: 0.0 };
        self.gradient(lens, field_rad, &cotangent, 0.0)
    }

    /// The gradient of a loss with these derivatives by the PSFs of a field and by x of its chief ray; `None` if no light arrives.
    fn gradient(
        &self,
        lens: &Lens,
        field_rad: f64,
        cotangent: &PsfCotangent,
        by_chief_x: f64,
    ) -> Option<LensGradient> {
        let (psf, tape) =
            psf_with_tape(lens, field_rad, &self.wavelengths_um, &self.quadrature, &self.options)?;
        let mut gradient = tape.gradient(&psf, &self.quadrature, cotangent);
        // In a lens without a plane of symmetry, the chief ray leaves the plane of the fields.
        let reference = lens.at_wavelength(lens.reference_um);
        if by_chief_x != 0.0 && !reference.is_mirror_symmetric {
            let chief = chief_ray(&reference, field_rad)?;
            pull_back_chief(&reference, &chief, [by_chief_x, 0.0], &mut gradient);
        }
        Some(gradient)
    }

    /// What each field gives, in the order of the fields.
    pub fn by_field<T: Send>(
        &self,
        context: &Context,
        of: impl Fn(f64) -> Option<T> + Sync,
    ) -> Result<Vec<T>, JobError> {
        let found = self.fields_deg.par_iter().map(|field| {
            context.check(|| "stopped before all fields were traced")?;
            of(field.to_radians()).ok_or_else(|| no_light(*field))
        });
        found.collect()
    }

    fn arrays<'py>(
        &self,
        py: Python<'py>,
        of_fields: impl Iterator<Item = OfField>,
    ) -> PyResult<Outputs<'py>> {
        let (fields, colours, grid) = (self.fields_deg.len(), self.wavelengths_um.len(), self.options.grid);
        let mut values = Vec::with_capacity(fields * colours * grid * grid);
        let [mut light, mut chief_mm, mut captured] = [const { Vec::new() }; 3];
        for of in of_fields {
            of.values.iter().for_each(|of_colour| values.extend_from_slice(of_colour));
            light.extend(of.illumination);
            chief_mm.extend(of.chief_mm);
            captured.extend(of.captured);
        }
        let wrong = |e: numpy::ndarray::ShapeError| exception(py, &JobError::failed(e.to_string()));
        let table =
            |columns: usize, of: Vec<f64>| Array2::from_shape_vec((fields, columns), of).map_err(wrong);
        Ok((
            Array4::from_shape_vec((fields, colours, grid, grid), values).map_err(wrong)?.into_pyarray(py),
            table(colours, light)?.into_pyarray(py),
            table(2, chief_mm)?.into_pyarray(py),
            table(colours, captured)?.into_pyarray(py),
        ))
    }
}

fn no_light(field_deg: f64) -> JobError {
    JobError::input(
        format!("fields_deg: no light of the field {field_deg} degrees arrives on the grid"),
        "try a smaller field, a larger grid, or the other kind of PSF",
    )
}
