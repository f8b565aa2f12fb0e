//! Curvature steps of a lens: the loss of its PSFs is lifted to the rays, as the lens block of a design does it.

use nalgebra::DMatrix;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use petzval_design::block::{Lift, Lifted};
use petzval_jobs::JobError;
use petzval_optics::constraint::penalty;
use petzval_optics::gradient::LensGradient;
use petzval_optics::merit::{Seen, SpotResiduals};
use petzval_optics::pupil::PupilSampling;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::{Like1, Like2, checked, finite};
use crate::error::refusal;
use crate::psf::PyPsfPlan;
use crate::space::{PyDesignSpace, refused};
use crate::watch::{Watch, watched};

/// A matrix, `[coordinate][coordinate]`, then a penalty and its derivatives.
type Curvature<'py> = (Bound<'py, PyArray2<f64>>, f64, Bound<'py, PyArray1<f64>>);

/// Averages of gradient and curvature, and the coordinates after a step.
type Step<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// The curvature by the free coordinates `x` of a loss > 0 of PSFs, from its derivatives by the numbers of the lens, and of the weighted penalty.
/// With it the penalty itself, mm^2, and its derivatives by the coordinates. `None` where most rays of a field are lost.
#[pyfunction]
pub fn lift<'py>(
    py: Python<'py>,
    plan: &PyPsfPlan,
    space: &PyDesignSpace,
    x: Like1<'_>,
    loss: f64,
    by_numbers: Like1<'_>,
    penalty_weight: f64,
    watch: Watch<'_>,
) -> PyResult<Option<Curvature<'py>>> {
    let x = space.coordinates(py, &x)?;
    let numbers = space.space().space().numbers();
    let by_numbers = checked(py, "by_numbers", by_numbers.as_array().into_dyn(), &[numbers.len()])?;
    if !(loss > 0.0 && loss.is_finite()) {
        return Err(refusal(py, "loss", loss, "is not positive", "the lift takes losses above zero"));
    }
    if !(penalty_weight >= 0.0 && penalty_weight.is_finite()) {
        return Err(refusal(py, "penalty_weight", penalty_weight, "out of range", "at least 0, 1/mm^2"));
    }
    let found = watched(py, &watch, |context| {
        let lens = space.lens_of(&x)?;
        // The light of each field, at the middle wavelength.
        let light: Vec<LensGradient> = plan.by_field(context, |field| plan.light_gradient(&lens, field))?;
        let rays = beams(plan);
        // Each violation is a residual of its own.
        let squares = space.constraints().par_iter().map(|constraint| {
            penalty(std::slice::from_ref(constraint), &lens)
                .ok_or_else(|| JobError::input("a ray that a limit needs is lost", "step back"))
        });
        let violations: Vec<(f64, LensGradient)> = squares
            .filter(|square| square.as_ref().map_or(true, |(value, _)| *value > 0.0))
            .collect::<Result<_, JobError>>()?;
        let mut by_loss = LensGradient::zero(lens.surfaces.len());
        for (number, by) in numbers.iter().zip(&by_numbers) {
            by_loss[*number] = *by;
        }
        let lift = Lift {
            space: space.space(),
            x: &x,
            errors: &[],
            lens: &lens,
            seen: Seen { rays: &rays, places: true, light: &light },
            violations: &violations,
            constraint_weight: penalty_weight,
        };
        let curvature = lift.curvature(loss, &by_loss).map_err(|e| refused(&e))?;
        let (mut square, mut by_square) = (0.0, LensGradient::zero(lens.surfaces.len()));
        for (value, by) in &violations {
            square += value;
            by_square += by;
        }
        Ok(curvature.map(|curvature| {
            let rows: Vec<f64> = curvature.transpose().iter().copied().collect();
            (rows, square, space.pull_back(&x, &lens, &by_square))
        }))
    })?;
    let Some((rows, square, by_square)) = found else { return Ok(None) };
    let curvature = rows.into_pyarray(py).reshape([x.len(), x.len()])?;
    Ok(Some((curvature, square, by_square.into_pyarray(py))))
}

/// The rays that stand for the beams of PSFs, as those of a design.
fn beams(plan: &PyPsfPlan) -> SpotResiduals {
    let fields_rad: Vec<f64> = plan.fields_deg().iter().map(|field| field.to_radians()).collect();
    SpotResiduals {
        field_weights: vec![1.0; fields_rad.len()],
        fields_rad,
        wavelengths_um: plan.wavelengths_um().to_vec(),
        sampling: PupilSampling::Degree(8),
        power: 2.0,
    }
}

/// A step of a share `rate` of the way to the minimum of the averages, which take up a gradient and a curvature. `gradient` is half of the
/// derivatives, as the squares of residuals have them.
#[pyfunction]
pub fn lifted_step<'py>(
    py: Python<'py>,
    x: Like1<'_>,
    gradient: Like1<'_>,
    curvature: Like2<'_>,
    average_gradient: Like1<'_>,
    average_curvature: Like2<'_>,
    steps: i32,
    rate: f64,
) -> PyResult<Step<'py>> {
    let mut x = finite(py, "x", &x)?;
    let count = x.len();
    let vector = |name, array: &Like1<'_>| checked(py, name, array.as_array().into_dyn(), &[count]);
    let matrix = |name, array: &Like2<'_>| checked(py, name, array.as_array().into_dyn(), &[count, count]);
    let gradient = vector("gradient", &gradient)?;
    let curvature = matrix("curvature", &curvature)?;
    let averages =
        (vector("average_gradient", &average_gradient)?, matrix("average_curvature", &average_curvature)?);
    if !(0..i32::MAX).contains(&steps) {
        return Err(refusal(py, "steps", steps, "out of range", "the number of steps so far"));
    }
    if !rate.is_finite() {
        return Err(refusal(py, "rate", rate, "is not finite", "a share of the way, such as 0.3"));
    }
    let mut lifted = Lifted::of(averages.0, averages.1, steps);
    lifted.step(&mut x, &gradient, &DMatrix::from_row_slice(count, count, &curvature), rate);
    let [gradient, curvature] = lifted.averages().map(<[f64]>::to_vec);
    let curvature = curvature.into_pyarray(py).reshape([count, count])?;
    Ok((x.into_pyarray(py), gradient.into_pyarray(py), curvature))
}
