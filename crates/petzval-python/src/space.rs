//! The free coordinates of a lens, and what its lenses must keep.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use petzval_design::block::free_slopes;
use petzval_files::LensFile;
use petzval_jobs::{JobError, json};
use petzval_optics::constraint::{Constraint, penalty};
use petzval_optics::design_space::{
    DesignSpace, DesignSpaceError, EflSolve, Focus, SmoothSpace, Solves, Variable, near_variables,
};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::number::Number;
use petzval_optics::optimize::Limits;
use petzval_optics::pupil::chief_ray;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};

use crate::arrays::{Like1, checked, finite};
use crate::error::{exception, refusal};
use crate::lens::{PyLens, number_of};

/// Which numbers of a lens move, and how they are free.
#[pyclass(frozen, name = "DesignSpace", module = "petzval._petzval")]
pub struct PyDesignSpace {
    space: SmoothSpace,
    file: LensFile,
    glasses: Vec<PathBuf>,
    constraints: Vec<Constraint>,
    /// The plan that it was made by, as JSON.
    plan: String,
}

/// Numbers of a lens, and their derivatives by coordinates.
type Numbers<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// A variable as Python states it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stated {
    surface: usize,
    number: String,
    min: f64,
    max: f64,
}

/// A coordinate as Python sees it.
#[derive(Serialize)]
struct Coordinate {
    name: String,
    min: Option<f64>,
    max: Option<f64>,
}

/// What a design space is made of.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Plan {
    /// The variables; those of the lens, or the usual ones near its numbers, if none are given.
    variables: Option<Vec<Stated>>,
    /// The surface whose curvature holds the focal length, from 0.
    efl_surface: Option<usize>,
    /// Whether no curvature holds the focal length.
    is_efl_free: bool,
    /// `fixed`, `free` or `paraxial`.
    focus: String,
    /// Half-range of the defocus, mm, where the focus is paraxial.
    defocus_mm: f64,
    element_edge_mm: Option<f64>,
    element_centre_mm: Option<f64>,
    air_gap_mm: Option<f64>,
    back_focal_mm: Option<[f64; 2]>,
    track_mm: Option<f64>,
    distortion: Option<f64>,
    /// The field whose image height is held, degrees, and by how much of itself it may change.
    held_field_deg: Option<f64>,
    held_share: f64,
}

pub fn refused(error: &DesignSpaceError) -> JobError {
    JobError::input(error.to_string(), "name other variables or bounds")
}

impl Plan {
    fn solves_and_variables(&self, file: &LensFile) -> Result<(Solves, Vec<Variable>), JobError> {
        let lens = &file.lens;
        let mut solves = file.solves();
        let usual = near_variables(lens, &solves);
        if let Some(surface) = self.efl_surface {
            let order = petzval_optics::paraxial::first_order(&lens.at_wavelength(lens.reference_um));
            solves.efl = Some(EflSolve { surface, efl_mm: order.efl_mm, radius_mm: None });
            solves.magnification = None;
        }
        let own = (!file.variables.is_empty()).then(|| file.variables.clone());
        let variables = match (&self.variables, own, usual) {
            (Some(stated), ..) => stated.iter().map(|one| one.variable(lens)).collect::<Result<_, _>>()?,
            (None, Some(own), _) => own,
            (None, None, Some((near, held))) => {
                if solves.curvature().is_none() {
                    solves = held;
                }
                near
            }
            (None, None, None) => {
                let message = "the lens names no variables, and has no curved surface with a focal length";
                return Err(JobError::input(message, "name variables"));
            }
        };
        if self.is_efl_free {
            (solves.efl, solves.magnification) = (None, None);
        }
        let solved = solves.curvature().map(|(surface, _)| (surface, Number::Curvature));
        let settled = |v: &Variable| solved != Some((v.surface, v.number));
        Ok((solves, variables.into_iter().filter(settled).collect()))
    }

    fn focus(&self) -> Result<Focus, JobError> {
        match self.focus.as_str() {
            "fixed" => Ok(Focus::Fixed),
            "free" => Ok(Focus::Free),
            "paraxial" => Ok(Focus::Paraxial { range_mm: self.defocus_mm }),
            other => {
                let hint = "\"fixed\", \"free\" or \"paraxial\"";
                Err(JobError::setting("focus", other, "no such focus", hint))
            }
        }
    }

    fn constraints(&self, lens: &Lens, solves: &Solves) -> Result<Vec<Constraint>, JobError> {
        let limits = Limits {
            element_edge_mm: self.element_edge_mm,
            element_centre_mm: self.element_centre_mm,
            air_gap_mm: self.air_gap_mm,
            back_focal_mm: self.back_focal_mm,
            track_mm: self.track_mm,
            distortion: self.distortion,
            ..Limits::default()
        };
        let outermost = lens.outermost_field_deg().to_radians();
        let mut all = limits.constraints(lens, outermost);
        let solved = solves.efl.and_then(|solve| Some((solve.surface, solve.radius_mm?)));
        all.extend(solved.map(|(surface, radius_mm)| Constraint::SolvedRadius { surface, radius_mm }));
        if let Some(field_deg) = self.held_field_deg {
            let field_rad = field_deg.to_radians();
            let chief = chief_ray(&lens.at_wavelength(lens.reference_um), field_rad).ok_or_else(|| {
                JobError::setting("held_field_deg", field_deg, "its chief ray does not reach the image", "")
            })?;
            let tolerance_mm = self.held_share * chief.y_mm.abs();
            all.push(Constraint::ChiefHeight { field_rad, wanted_mm: chief.y_mm, tolerance_mm });
        }
        Ok(all)
    }
}

impl Stated {
    fn variable(&self, lens: &Lens) -> Result<Variable, JobError> {
        let number = number_of(lens, self.surface, &self.number)?;
        Ok(Variable { surface: self.surface, number, min: self.min, max: self.max })
    }
}

#[pymethods]
impl PyDesignSpace {
    /// A space around a lens; `plan` is JSON.
    #[new]
    fn new(py: Python<'_>, lens: &PyLens, plan: &str) -> PyResult<Self> {
        let made = || -> Result<Self, JobError> {
            let text = plan.to_owned();
            let plan: Plan = serde_json::from_str(plan).map_err(|e| JobError::input(e.to_string(), ""))?;
            let (solves, variables) = plan.solves_and_variables(&lens.file)?;
            let constraints = plan.constraints(&lens.file.lens, &solves)?;
            let space = DesignSpace::new(
                lens.file.lens.clone(),
                variables,
                lens.file.pickups.clone(),
                solves,
                plan.focus()?,
            );
            let space = space.and_then(SmoothSpace::new).map_err(|e| refused(&e))?;
            let (file, glasses) = (lens.file.clone(), lens.glasses.clone());
            Ok(Self { space, file, glasses, constraints, plan: text })
        };
        made().map_err(|error| exception(py, &error))
    }

    /// The lens that the space was made around, and the plan, as JSON: what makes the same space again.
    fn parts(&self) -> (PyLens, String) {
        (PyLens { file: self.file.clone(), glasses: self.glasses.clone() }, self.plan.clone())
    }

    /// The free coordinates of the lens that the space was made around.
    fn start<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.space.start().to_vec().into_pyarray(py)
    }

    /// Name and bounds of each coordinate, as JSON.
    fn describe(&self, py: Python<'_>) -> PyResult<String> {
        let under = self.space.space();
        let mut all: Vec<Coordinate> = under
            .variables()
            .iter()
            .map(|v| Coordinate {
                name: format!("surfaces[{}].{}", v.surface, v.number),
                min: Some(v.min),
                max: Some(v.max),
            })
            .collect();
        for [min, max] in &under.bounds()[all.len()..] {
            let bound = |at: f64| at.is_finite().then_some(at);
            let name = match under.focus() {
                Focus::Paraxial { .. } => "defocus_mm",
                _ => "image_distance_mm",
            };
            all.push(Coordinate { name: name.to_owned(), min: bound(*min), max: bound(*max) });
        }
        json(&all).map_err(|error| exception(py, &error))
    }

    /// The lens at free coordinates.
    fn lens_at(&self, py: Python<'_>, x: Like1<'_>) -> PyResult<PyLens> {
        let x = self.coordinates(py, &x)?;
        let lens = self.lens_of(&x).map_err(|error| exception(py, &error))?;
        Ok(PyLens {
            file: LensFile { lens, expect: None, ..self.file.clone() },
            glasses: self.glasses.clone(),
        })
    }

    /// Free coordinates of a lens of this space, moved inside their bounds: not onto them, where the map has no slope. A lens of the space has
    /// its numbers and media, except for those that move. Semi-diameters may differ, which optimisers let follow the beam.
    fn coordinates_of<'py>(&self, py: Python<'py>, lens: &PyLens) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (mine, other) = (self.file.lens.surfaces.len(), lens.file.lens.surfaces.len());
        if mine != other {
            let hint = format!("it has {other} surfaces, the lenses of this space {mine}");
            return Err(refusal(py, "lens", &lens.file.lens.name, "is another lens", hint));
        }
        if let Some(other) = self.held_otherwise(&lens.file.lens) {
            let hint = "make the space from the lens itself, by `lens.variables(...)`";
            let message = format!("is another lens than those of this space: {other}");
            return Err(refusal(py, "lens", &lens.file.lens.name, message, hint));
        }
        let at = self.space.space().coordinates(&lens.file.lens);
        Ok(self.space.off_bounds(&self.space.free(&at)).into_pyarray(py))
    }

    /// The numbers of the lens that follow free coordinates, and their derivatives, `[number][coordinate]`. Curvatures are in 1/mm, tilts in rad.
    fn numbers<'py>(&self, py: Python<'py>, x: Like1<'_>) -> PyResult<Numbers<'py>> {
        let x = self.coordinates(py, &x)?;
        let places = self.space.space().numbers();
        let found = py.detach(|| -> Result<_, JobError> {
            let lens = self.lens_of(&x)?;
            let slopes = free_slopes(&self.space, &x, &[], &lens).map_err(|e| refused(&e))?;
            let rows: Vec<f64> = slopes.rows(0, places.len()).transpose().iter().copied().collect();
            Ok((places.iter().map(|(s, number)| number.read(&lens, *s)).collect::<Vec<f64>>(), rows))
        });
        let (numbers, rows) = found.map_err(|error| exception(py, &error))?;
        Ok((numbers.into_pyarray(py), rows.into_pyarray(py).reshape([places.len(), x.len()])?))
    }

    /// How many numbers of the lens follow the coordinates.
    fn number_count(&self) -> usize {
        self.space.space().numbers().len()
    }

    /// The squares of all violations at free coordinates, mm^2, and the derivatives of their sum.
    fn penalty<'py>(&self, py: Python<'py>, x: Like1<'_>) -> PyResult<(f64, Bound<'py, PyArray1<f64>>)> {
        let x = self.coordinates(py, &x)?;
        let found = py.detach(|| -> Result<_, JobError> {
            let lens = self.lens_of(&x)?;
            let (value, gradient) = penalty(&self.constraints, &lens)
                .ok_or_else(|| JobError::input("a ray that a limit needs is lost", "step back"))?;
            Ok((value, self.pull_back(&x, &lens, &gradient)))
        });
        let (value, gradient) = found.map_err(|error| exception(py, &error))?;
        Ok((value, gradient.into_pyarray(py)))
    }
}

impl PyDesignSpace {
    /// The first thing that the space holds and that is another one in a lens of as many surfaces, in words.
    fn held_otherwise(&self, other: &Lens) -> Option<String> {
        let (mine, moved) = (&self.file.lens, self.space.space().numbers());
        if mine.stop != other.stop {
            return Some(format!("its stop is surface {}, not {}", other.stop, mine.stop));
        }
        // A plane has an infinite radius, and a surface that lacks a number is NaN there.
        let are_alike =
            |a: f64, b: f64| a == b || a.is_nan() && b.is_nan() || (a - b).abs() <= 1e-9 * (1.0 + a.abs());
        for (surface, (a, b)) in mine.surfaces.iter().zip(&other.surfaces).enumerate() {
            let has_moving_index = moved.contains(&(surface, Number::Index));
            let [n_a, n_b] = [&a.glass, &b.glass].map(|glass| glass.index(mine.reference_um));
            if !has_moving_index && !are_alike(n_a, n_b) {
                return Some(format!("behind surface {surface} is {}, not {}", b.glass.name, a.glass.name));
            }
            let is_held =
                |number: &&Number| **number != Number::SemiDiameter && !moved.contains(&(surface, **number));
            for number in Number::ALL.iter().filter(is_held) {
                let [from, to] = [mine, other].map(|lens| number.read_stated(lens, surface));
                if !are_alike(from, to) {
                    return Some(format!("the {number} of surface {surface} is {to}, not {from}"));
                }
            }
        }
        None
    }

    /// Free coordinates that an array holds.
    pub fn coordinates(&self, py: Python<'_>, x: &Like1<'_>) -> PyResult<Vec<f64>> {
        let x = finite(py, "x", x)?;
        let dimension = self.space.dimension();
        if x.len() == dimension {
            return Ok(x);
        }
        let hint = format!("the space has {dimension} coordinates");
        Err(refusal(py, "x", format!("of length {}", x.len()), "has the wrong length", hint))
    }

    /// The lens at free coordinates.
    pub fn lens_of(&self, x: &[f64]) -> Result<Lens, JobError> {
        self.space.lens_at(x).map_err(|e| refused(&e))
    }

    /// The space itself.
    pub fn space(&self) -> &SmoothSpace {
        &self.space
    }

    /// What its lenses must keep.
    pub fn constraints(&self) -> &[Constraint] {
        &self.constraints
    }

    /// The lens with numbers that `numbers` gave.
    pub fn lens_with(&self, py: Python<'_>, numbers: &Like1<'_>) -> PyResult<Lens> {
        let places = self.space.space().numbers();
        let numbers = checked(py, "numbers", numbers.as_array().into_dyn(), &[places.len()])?;
        let mut lens = self.space.space().base().clone();
        for ((surface, number), value) in places.iter().zip(numbers) {
            number.write(&mut lens, *surface, value);
        }
        Ok(lens)
    }

    /// The change of every number of a lens, from those of the numbers of the space.
    pub fn change(&self, py: Python<'_>, direction: &Like1<'_>) -> PyResult<LensGradient> {
        let places = self.space.space().numbers();
        let direction = checked(py, "direction", direction.as_array().into_dyn(), &[places.len()])?;
        let mut change = LensGradient::zero(self.file.lens.surfaces.len());
        for (place, by) in places.iter().zip(direction) {
            change[*place] = by;
        }
        Ok(change)
    }

    /// Derivatives by the numbers of the space, from those by all numbers of the lens.
    pub fn by_numbers(&self, gradient: &LensGradient) -> Vec<f64> {
        self.space.space().numbers().iter().map(|number| gradient[*number]).collect()
    }

    /// Derivatives by the free coordinates, from those by the numbers of the lens at `x`.
    pub fn pull_back(&self, x: &[f64], lens: &Lens, gradient: &LensGradient) -> Vec<f64> {
        self.space.pull_back(x, lens, gradient)
    }
}
