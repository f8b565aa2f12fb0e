//! Merits whose curvature is lifted from rays.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::*;
use crate::gradient::LensGradient;
use crate::merit::{Better, Seen, lifted_normal_equations};
use crate::pupil::PupilSampling;

/// A merit whose residuals are hidden from the optimiser, which lifts their sum instead.
struct Hidden {
    spots: SpotResiduals,
    is_lifted: bool,
}

impl Merit for Hidden {
    fn name(&self) -> String {
        self.spots.name()
    }

    fn unit(&self) -> &str {
        self.spots.unit()
    }

    fn better(&self) -> Better {
        self.spots.better()
    }

    fn value(&self, lens: &Lens) -> Option<f64> {
        self.spots.value(lens)
    }

    fn with_gradient(&self, lens: &Lens) -> Option<(f64, Option<LensGradient>)> {
        self.spots.with_gradient(lens)
    }

    fn normal_equations(&self, lens: &Lens, numbers: &[(usize, Number)]) -> Option<DMatrix<f64>> {
        if !self.is_lifted {
            return None;
        }
        let (value, gradient) = self.with_gradient(lens)?;
        // Other rays than those of the merit.
        let rays = SpotResiduals { sampling: PupilSampling::Degree(4), ..self.spots.clone() };
        let seen = Seen { rays: &rays, places: false, light: &[] };
        lifted_normal_equations(seen, lens, numbers, value * value, &gradient?.scaled(2.0 * value))
    }
}

#[test]
fn a_lifted_merit_has_its_gradient_and_is_minimised_as_by_its_own_residuals() {
    let own = with_merit(problem(), |m| m.power = 2.0);
    let hidden = |is_lifted: bool| {
        let merit = Arc::new(Hidden { spots: own.merit.clone(), is_lifted });
        Problem { spot_weight: 0.0, goals: vec![Goal { merit, target: 0.0, weight_um: 1.0 }], ..own.clone() }
    };
    assert_eq!(check_gradient(&hidden(true)), 0);
    let reached = |problem: &Problem, iterations: usize| {
        let options = LevenbergOptions { iterations, ..LevenbergOptions::default() };
        descend(problem, &options, &mut |_, _, _| true).unwrap().best.merit.sqrt()
    };
    let (start, least) = (reached(&own, 0), reached(&own, 200));
    // The slope alone, one residual in place of those of the rays, leads hardly anywhere.
    let (by_lift, by_slope) = (reached(&hidden(true), 30), reached(&hidden(false), 30));
    assert!(by_lift < least + 0.1 * (start - least), "{start} {least} {by_lift}");
    assert!(by_slope > least + 0.3 * (start - least), "{start} {least} {by_slope}");
}

/// The curvature of a lifted loss by the numbers of a lens whose pupil is `pupil` times as wide; `None` if the loss cannot be lifted.
fn lifted_diagonal(pupil: f64) -> (bool, Option<Vec<f64>>) {
    let problem = problem();
    let mut lens = problem.base.clone();
    lens.entrance_pupil_mm *= pupil;
    let numbers: Vec<(usize, Number)> = problem.variables.iter().map(|v| (v.surface, v.number)).collect();
    let is_whole = problem.merit.value(&lens).is_some();
    let seen = Seen { rays: &problem.merit, places: true, light: &[] };
    let mut gradient = LensGradient::zero(lens.surfaces.len());
    gradient[numbers[0]] = 2.0;
    let gram = lifted_normal_equations(seen, &lens, &numbers, 3.0, &gradient);
    let diagonal = gram.map(|gram| {
        assert!(gram.iter().all(|v| v.is_finite()));
        assert_eq!((gram[(numbers.len() + 1, numbers.len() + 1)], gram[(0, numbers.len() + 1)]), (3.0, 1.0));
        (0..numbers.len()).map(|i| gram[(i, i)]).collect()
    });
    (is_whole, diagonal)
}

#[test]
fn a_lost_ray_is_left_out_of_the_lift_and_refused_by_the_spot() {
    // Between a pupil through which every ray arrives and one through which most are lost, a few are.
    let pupils = || (0..200).map(|i| 1.0 + 0.02 * f64::from(i));
    let widest = pupils().take_while(|p| lifted_diagonal(*p).0).last().unwrap();
    let first_lost = pupils().find(|p| *p > widest).unwrap();
    let (is_whole, diagonal) = lifted_diagonal(first_lost);
    assert!(!is_whole, "{first_lost}");
    // The rays that are left move as those of a slightly smaller pupil do.
    let before = lifted_diagonal(0.95 * widest).1.unwrap();
    for (lost, whole) in diagonal.unwrap().iter().zip(&before) {
        assert!((0.5..2.0).contains(&(lost / whole)), "{first_lost}: {lost} {whole}");
    }
    assert_eq!(lifted_diagonal(5.0 * first_lost).1, None);
}
