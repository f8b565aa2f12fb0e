//! Goals beside spots, and in place of them.

use super::*;
use crate::merit::{FieldSet, Mtf};
use crate::psf::PsfKind;

fn goal(merit: impl Merit + 'static, target: f64, weight_um: f64) -> Goal {
    Goal { merit: std::sync::Arc::new(merit), target, weight_um }
}

#[test]
fn goals_have_the_gradient_of_what_is_minimised() {
    let lens = nominal_triplet();
    let spots = SpotResiduals::new(&lens);
    let mtf = || Mtf::new(&lens, 40.0, PsfKind::Geometric);
    let with = |goals: Vec<Goal>| Problem { goals, ..problem() };
    // By residuals, by one distance from a target, and alone.
    check_gradient(&with(vec![goal(spots.clone(), 0.0, 0.7)]));
    check_gradient(&with(vec![goal(spots.clone(), 3.0, 0.7)]));
    // The splats of a geometric PSF have no third derivative, so that differences of it are less exact.
    check_gradient_to(&Problem { spot_weight: 0.0, ..with(vec![goal(mtf(), 1.0, 30.0)]) }, 1e-4);
    // A target that is met adds nothing.
    let space = problem().space().unwrap();
    let merit =
        |problem: &Problem| analyse(problem, space.lens_at(&space.start()).unwrap(), None).unwrap().merit;
    assert_eq!(merit(&problem()), merit(&with(vec![goal(mtf(), 0.01, 30.0), goal(spots, 1e3, 1.0)])));
}

#[test]
fn spots_as_a_goal_are_the_spots_of_the_problem() {
    let by_goal = Problem {
        spot_weight: 0.0,
        goals: vec![goal(SpotResiduals::new(&nominal_triplet()), 0.0, 1.0)],
        ..problem()
    };
    let descend = |problem: &Problem| {
        descend(problem, &LevenbergOptions { iterations: 6, ..Default::default() }, &mut |_, _, _| true)
            .unwrap()
    };
    let (one, other) = (descend(&problem()).best, descend(&by_goal).best);
    assert!((one.merit / other.merit - 1.0).abs() < 1e-6, "{} {}", one.merit, other.merit);
    assert!((other.goals[0] / other.merit.sqrt() - 1.0).abs() < 1e-9);
}

#[test]
fn contrast_as_a_goal_beats_spots_in_contrast() {
    // 60/mm is a frequency at which the smallest spot is not the best contrast.
    let contrast = || Mtf::new(&nominal_triplet(), 60.0, PsfKind::Geometric);
    let options = LevenbergOptions { iterations: 25, ..Default::default() };
    let descend = |problem: &Problem| descend(problem, &options, &mut |_, _, _| true).unwrap();
    let by_spots = descend(&problem());
    let mut start = problem();
    start.base = by_spots.best.lens.clone();
    let by_contrast =
        descend(&Problem { spot_weight: 0.0, goals: vec![goal(contrast(), 1.0, 100.0)], ..start });
    let (spots, goal) = (contrast().value(&by_spots.best.lens).unwrap(), by_contrast.best.goals[0]);
    assert!(goal > spots + 0.005, "{goal} against {spots}");
    assert!(by_contrast.best.mean_rms_um() > by_spots.best.mean_rms_um());
}

/// A figure of a lens is one number, whose slope knows one direction; its rays know how curvatures and aspheres go together. And the penalty of a
/// range begins where a step ends outside.
#[test]
fn contrast_within_a_range_of_focal_lengths_goes_on_quickly() {
    let lens = nominal_triplet();
    let contrast = |deg: &f64| {
        let fields = FieldSet::new(&lens, &[*deg]);
        goal(Mtf::new(&lens, 40.0, PsfKind::Geometric).with_fields(fields), 0.9, 100.0)
    };
    let mut free = problem();
    free.variables.push(variable(6, Number::Curvature, -15.0, -11.5));
    let within = |between_mm: [f64; 2]| Problem {
        solves: Solves::default(),
        spot_weight: 0.0,
        goals: lens.fields_deg.iter().map(contrast).collect(),
        further: vec![Constraint::FocalLength { between_mm }],
        ..free.clone()
    };
    let options = LevenbergOptions { iterations: 12, ..LevenbergOptions::default() };
    // By the slopes alone 89.7 um from 100.8, in an independent calculation with other rays; with the rays and the range 84.2.
    let found = descend(&within([24.9, 25.1]), &options, &mut |_, _, _| true).unwrap().best;
    let efl_mm = first_order(&found.lens.at_wavelength(found.lens.reference_um)).efl_mm;
    assert!(found.merit.sqrt() < 87.0, "{}", found.merit.sqrt());
    assert!((efl_mm - 25.0).abs() < 0.102, "{efl_mm}");
}
