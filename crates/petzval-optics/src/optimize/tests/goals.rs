//! Goals beside spots, and in place of them.

use std::sync::Arc;

use super::*;
use crate::merit::{FieldSet, Mtf, RmsSpot, RmsWavefront};
use crate::psf::PsfKind;
use crate::pupil::PupilSampling;

fn goal(merit: impl Merit + 'static, target: f64, weight_um: f64) -> Goal {
    Goal { merit: Arc::new(merit), target, weight_um }
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

/// A figure that is the root of a sum of squares curves as its residuals do, and along its slope as the figure alone does.
#[test]
fn a_figure_beyond_its_bound_has_the_curvature_of_its_residuals() {
    let lens = nominal_triplet();
    let space = problem().space().unwrap();
    let mapped = space.map(&space.start()).unwrap();
    // The model of the goal alone, its value and its residual.
    let model = |goal: Goal| {
        let problem = Problem { spot_weight: 0.0, goals: vec![goal], ..problem() };
        let analysis = analyse(&problem, mapped.lens.clone(), None).unwrap();
        let model = linearise(&problem, &space, &mapped, &analysis).unwrap();
        (model, analysis.goals[0], analysis.merit.sqrt())
    };
    let field_rad = 0.1_f64;
    let rays = SpotResiduals {
        fields_rad: vec![field_rad],
        field_weights: vec![1.0],
        power: 2.0,
        ..SpotResiduals::new(&lens)
    };
    let (of_rays, size_um, _) = model(goal(rays.clone(), 0.0, 1.0));
    let fields = || FieldSet::new(&lens, &[field_rad.to_degrees()]);
    let spot = RmsSpot { fields: fields(), sampling: PupilSampling::Degree(6) };
    let figures: [Arc<dyn Merit>; 3] =
        [Arc::new(rays), Arc::new(spot), Arc::new(RmsWavefront { fields: fields() })];
    for merit in figures {
        let (name, value) = (merit.name(), merit.value(&mapped.lens).unwrap());
        let (beyond, _, residual_um) = model(Goal { merit, target: 0.25 * value, weight_um: 10.0 });
        // (1 - b/s) J'J + (b/s) grad grad', where the rays stand for the residuals.
        let slope = &beyond.gradient / residual_um;
        let share = 0.75 * (10.0 * value / size_um).powi(2);
        let expected = &of_rays.hessian * share + &slope * slope.transpose() * 0.25;
        let apart = (&beyond.hessian - &expected).norm() / expected.norm();
        assert!(apart < 1e-6, "{name}: {apart:e}");
    }
}

/// Spots beyond a bound that no lens reaches are led where spots without a bound are.
#[test]
fn a_bound_on_spots_does_not_stop_a_descent() {
    let mut own = with_merit(problem(), |m| m.power = 2.0);
    // No aperture takes light from a spot, which would be another figure then.
    let stop = own.base.stop;
    own.base.surfaces.iter_mut().enumerate().for_each(|(i, surface)| surface.is_open = i != stop);
    let reached = |problem: &Problem, iterations: usize| {
        let options = LevenbergOptions { iterations, ..LevenbergOptions::default() };
        let best = descend(problem, &options, &mut |_, _, _| true).unwrap().best;
        own.merit.value(&best.lens).unwrap()
    };
    let (start, least) = (reached(&own, 0), reached(&own, 200));
    let spot = RmsSpot::new(&own.base);
    let bounded = Problem { spot_weight: 0.0, goals: vec![goal(spot, 0.5 * least, 1.0)], ..own.clone() };
    let found = reached(&bounded, 30);
    assert!(found < least + 0.1 * (start - least), "{start} {least} {found}");
}

/// The way by the spots never ends above the lens to which the spots lead.
#[test]
fn the_way_by_the_spots_goes_on_from_their_best_lens() {
    let lens = nominal_triplet();
    let contrast = goal(Mtf::new(&lens, 40.0, PsfKind::Geometric), 0.9, 100.0);
    let traded = Problem { goals: vec![contrast], ..problem() };
    let options = |iterations: usize| LevenbergOptions { iterations, ..LevenbergOptions::default() };
    let goes_on = &mut |_: usize, _: &Analysis, _: &[f64]| true;
    // A quarter of the iterations is left for the whole problem.
    let by_spots = descend(&problem(), &options(6), goes_on).unwrap().best;
    let there = Problem { base: by_spots.lens, ..traded.clone() };
    let known = descend(&there, &options(0), goes_on).unwrap().best;
    let found = descend_by_spots(&traded, &options(8), goes_on).unwrap();
    assert!(found.best.merit <= known.merit, "{} {}", found.best.merit, known.merit);
    assert!(found.iterations <= 8, "{}", found.iterations);
}

/// A goal has the wavelengths of the spots beside it, also where these are not those of the lens.
#[test]
fn goals_see_the_wavelengths_of_the_problem() {
    let lens = nominal_triplet();
    let merit = SpotResiduals {
        fields_rad: vec![0.0],
        field_weights: vec![1.0],
        wavelengths_um: vec![0.5876],
        power: 2.0,
        ..SpotResiduals::new(&lens)
    };
    let spot = RmsSpot { fields: FieldSet::new(&lens, &[0.0]), sampling: PupilSampling::Degree(6) };
    let problem = Problem { merit, goals: vec![goal(spot, 1.0, 1.0)], ..problem() };
    let space = problem.space().unwrap();
    let analysis = analyse(&problem, space.lens_at(&space.start()).unwrap(), None).unwrap();
    // Each ray with its light, and all alike; in all colours it is a tenth more.
    let ratio = analysis.goals[0] / analysis.rms_um[0];
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    check_gradient_to(&problem, 1e-4);
}
