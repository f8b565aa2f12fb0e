//! Descents to the least merit.

use super::*;
use crate::design_space::wide_variables;
use crate::lens::{Placement, Surface};

#[test]
fn a_disturbed_triplet_comes_back() {
    let mut lens = nominal_triplet();
    let before = {
        let problem = with_merit(problem(), |m| m.power = 2.0);
        let space = problem.space().unwrap();
        analyse(&problem, space.lens_at(&space.start()).unwrap(), None).unwrap().mean_rms_um()
    };
    for (i, s) in lens.surfaces.iter_mut().enumerate() {
        s.shape.curvature *= if i % 2 == 0 { 1.05 } else { 0.95 };
    }
    let disturbed = Problem {
        variables: [0, 1, 2, 3, 5]
            .map(|s| {
                let r = 1.0 / lens.surfaces[s].shape.curvature;
                variable(s, Number::Curvature, (0.5 * r).min(2.0 * r), (0.5 * r).max(2.0 * r))
            })
            .to_vec(),
        solves: Solves {
            efl: Some(EflSolve { surface: 6, efl_mm: 25.04, radius_mm: None }),
            ..Solves::default()
        },
        ..Problem::new(lens)
    };
    let mut seen = 0;
    let descent = descend(&disturbed, &LevenbergOptions::default(), &mut |_, analysis, _| {
        seen += 1;
        let efl = first_order(&analysis.lens.at_wavelength(analysis.lens.reference_um)).efl_mm;
        assert!((efl - 25.04).abs() < 1e-9);
        true
    })
    .unwrap();
    assert!(seen > descent.iterations);
    assert!(descent.best.mean_rms_um() <= before * 1.001, "{} against {before}", descent.best.mean_rms_um());
}

/// A lens whose front stop stands at the rim of its first surface is usual for telephones.
#[test]
fn a_plane_without_effect_that_stands_behind_the_next_vertex_does_not_stop_a_descent() {
    let with_stop = |behind_mm: f64| {
        let mut base = nominal_triplet();
        // The stop, and no other surface, moves along the axis.
        base.surfaces[3].thickness_mm += base.surfaces[4].thickness_mm + behind_mm;
        base.surfaces[4].thickness_mm = -behind_mm;
        let limits = Limits { element_edge_mm: Some(0.5), air_gap_mm: Some(0.1), ..Limits::default() };
        Problem { merit: SpotResiduals::new(&base), base, limits, ..problem() }
    };
    let descent = |problem: &Problem, iterations: usize| {
        let options = LevenbergOptions { iterations, ..LevenbergOptions::default() };
        descend(problem, &options, &mut |_, _, _| true)
    };
    let at_rim = with_stop(0.2);
    assert_eq!(at_rim.base.stop_at_rim(), Some(4));
    // The stop is no variable, and nothing demands a gap from it to the surface through which it stands.
    let of_gap = |p: &Problem| {
        p.constraints().iter().filter(|c| matches!(c, Constraint::Air { surface: 4, .. })).count()
    };
    assert_eq!((of_gap(&at_rim), of_gap(&with_stop(-0.5))), (0, 1));
    let (start, found) = (descent(&at_rim, 0).unwrap().best, descent(&at_rim, 10).unwrap().best);
    assert!(found.merit < 0.9 * start.merit, "{} from {}", found.merit, start.merit);
    assert_eq!(found.lens.surfaces[4].thickness_mm, -0.2);
    // A plane that is not the stop may stand there as well.
    let mut other = with_stop(0.2);
    other
        .base
        .surfaces
        .insert(0, Surface { thickness_mm: -1.0, semi_diameter_mm: 8.0, ..Default::default() });
    other.base.stop = 5;
    let gaps = wide_variables(&other.base).unwrap();
    assert!(
        gaps.iter().all(|v| v.number != Number::Thickness || ![0, 4, 5].contains(&v.surface)),
        "{gaps:?}"
    );
    let (variables, solves) = (Vec::new(), Solves::default());
    assert!(descent(&Problem { variables, solves, ..other }, 0).is_ok());
    // Surfaces with an effect stay in the order of the light.
    let mut crossed = with_stop(0.2);
    crossed.base.surfaces[4].thickness_mm = -6.0;
    assert_eq!(descent(&crossed, 0).unwrap_err(), DesignSpaceError::AgainstTheLight { surface: 4 });
}

/// A decentred and tilted surface is set straight again.
#[test]
fn decentres_and_tilts_come_back() {
    let mut lens = nominal_triplet();
    lens.surfaces[5].placement = Some(Placement {
        decenter_mm: [0.08, -0.05],
        tilt_rad: [0.3_f64.to_radians(), -0.2_f64.to_radians(), 0.0],
        ..Placement::default()
    });
    // A tilt about the vertex is not a decentre: that of a sphere is one about its centre, which the asphere tells apart.
    let decenter = |axis: usize| variable(5, Number::Decenter(axis), -0.5, 0.5);
    let tilt = |axis: usize| variable(5, Number::Tilt(axis), -1.0, 1.0);
    let problem = Problem {
        variables: vec![decenter(0), decenter(1), tilt(0), tilt(1)],
        focus: Focus::Fixed,
        // Fields on both sides of the axis, so that symmetry is best.
        merit: SpotResiduals {
            fields_rad: [-12.0, -6.0, 0.0, 6.0, 12.0].map(f64::to_radians).to_vec(),
            field_weights: vec![1.0; 5],
            power: 2.0,
            ..SpotResiduals::new(&lens)
        },
        ..Problem::new(lens)
    };
    assert_eq!(problem.sides(), crate::pupil::Sides::Both);
    let options = LevenbergOptions { iterations: 60, tolerance: 1e-14, ..Default::default() };
    let descent = descend(&problem, &options, &mut |_, _, _| true).unwrap();
    let placement = descent.best.lens.surfaces[5].placement.unwrap();
    let off = placement.decenter_mm.iter().chain(&placement.tilt_rad);
    assert!(off.clone().all(|v| v.abs() < 1e-5), "{placement:?} {:?}", descent.stop);
    let straight = Problem { base: nominal_triplet(), variables: Vec::new(), ..problem };
    let best = analyse(&straight, nominal_triplet(), None).unwrap().merit;
    assert!((descent.best.merit / best - 1.0).abs() < 1e-9, "{} {best}", descent.best.merit);
}

/// A descent that is interrupted, and kept as text meanwhile, ends at the bits of one that is not.
#[test]
fn an_interrupted_descent_goes_on_to_the_same_bits() {
    let problem = problem();
    let options = LevenbergOptions::default();
    let whole = descend(&problem, &options, &mut |_, _, _| true).unwrap();
    assert!(whole.iterations > 4 && whole.stop != Stop::Interrupted, "{}", whole.iterations);
    for interrupted_at in [0, 1, whole.iterations / 2, whole.iterations - 1] {
        let part = descend_watched(&problem, &options, &mut |progress| progress.iterations < interrupted_at)
            .unwrap();
        assert_eq!((part.stop, part.iterations), (Stop::Interrupted, interrupted_at));
        let text = serde_json::to_string(&part.state).unwrap();
        let kept: DescentState = serde_json::from_str(&text).unwrap();
        let rest = descend_on(&problem, &options, &kept, &mut |_| true).unwrap();
        assert_eq!(rest.state, whole.state, "interrupted at iteration {interrupted_at}");
        assert_eq!(rest.best.merit.to_bits(), whole.best.merit.to_bits());
    }
    // One that found no better lens any more stays as it is.
    let mut seen = 0;
    let again = descend_on(&problem, &options, &whole.state, &mut |_| {
        seen += 1;
        true
    });
    assert_eq!((again.unwrap().state, seen), (whole.state.clone(), 0));
    // The state of another problem is refused.
    let other = Problem { variables: Vec::new(), ..problem };
    assert!(descend_on(&other, &options, &whole.state, &mut |_| true).is_err());
}
