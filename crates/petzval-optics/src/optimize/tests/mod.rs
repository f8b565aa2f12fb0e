//! Derivatives of the merit against differences, and descents.

mod descent;
mod goals;
mod gradient;
mod lift;
mod limits;
mod refusals;
mod search;

use super::analysis::{analyse, linearise};
use super::*;
use crate::common::nominal_triplet;
use crate::constraint::Constraint;
use crate::design_space::{DesignSpaceError, EflSolve, Focus, Pickup, Solves, Variable};
use crate::lens::Lens;
use crate::merit::{Merit, SpotResiduals};
use crate::number::Number;
use crate::paraxial::first_order;

fn variable(surface: usize, number: Number, min: f64, max: f64) -> Variable {
    Variable { surface, number, min, max }
}

/// Curvatures, two aspheric terms and two thicknesses; the last curvature holds the focal length.
fn problem() -> Problem {
    Problem {
        variables: vec![
            variable(0, Number::Curvature, 9.0, 15.0),
            variable(0, Number::Asphere(1), -1e-4, 1e-4),
            variable(1, Number::Curvature, 9.0, 15.0),
            variable(1, Number::Thickness, 6.0, 10.0),
            variable(2, Number::Curvature, -60.0, -20.0),
            variable(5, Number::Curvature, 12.0, 20.0),
            variable(5, Number::Conic, -2.0, 2.0),
            variable(5, Number::Asphere(2), -1e-5, 1e-5),
            variable(5, Number::Thickness, 2.0, 4.0),
        ],
        solves: Solves {
            efl: Some(EflSolve { surface: 6, efl_mm: 25.04, radius_mm: Some([-14.0, -13.0]) }),
            ..Solves::default()
        },
        ..Problem::new(nominal_triplet())
    }
}

fn with_merit(mut problem: Problem, change: impl Fn(&mut SpotResiduals)) -> Problem {
    change(&mut problem.merit);
    problem
}

/// Every limit is set, and every one is violated.
fn strict(mut problem: Problem) -> Problem {
    problem.pickups = vec![Pickup { surface: 3, variable: 4, scale: -1.0, offset: 0.0 }];
    problem.solves.length = Some((3, 22.1));
    problem.limits = Limits {
        element_edge_mm: Some(3.2),
        element_centre_mm: Some(3.5),
        air_gap_mm: Some(1.2),
        back_focal_mm: Some([25.0, 26.0]),
        track_mm: Some(45.0),
        clear_diameter_mm: Some(12.0),
        distortion: Some(0.01),
        slope_rad: Some(0.2),
        chief_ray_angle_rad: Some(0.1),
    };
    problem.stiffness_um_per_mm = 30.0;
    problem
}

fn check_gradient(problem: &Problem) -> usize {
    check_gradient_to(problem, 1e-6)
}

fn check_gradient_to(problem: &Problem, tolerance: f64) -> usize {
    let space = problem.space().unwrap();
    let at = space.start();
    let mapped = space.map(&at).unwrap();
    let analysis = analyse(problem, mapped.lens.clone(), None).unwrap();
    let model = linearise(problem, &space, &mapped, &analysis).unwrap();
    for (i, bounds) in space.bounds().iter().enumerate() {
        let range = bounds[1] - bounds[0];
        let h = 1e-5 * if range.is_finite() { range } else { 1.0 };
        let merit = |steps: f64| {
            let mut moved = at.clone();
            moved[i] += steps * h;
            analyse(problem, space.lens_at(&moved).unwrap(), None).unwrap().merit
        };
        let numeric = (8.0 * (merit(1.0) - merit(-1.0)) - (merit(2.0) - merit(-2.0))) / (12.0 * h);
        let analytic = 2.0 * model.gradient[i];
        let rounding = 1e-12 * analysis.merit / h;
        assert!(
            (analytic - numeric).abs() < tolerance * analytic.abs() + rounding,
            "coordinate {i}: {analytic:e} against {numeric:e}"
        );
    }
    analysis.violations.len()
}
