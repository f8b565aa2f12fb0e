//! Limits, bounds and apertures.

use super::*;
use crate::common::{mangin, telescope};
use crate::constraint::SemiDiameters;
use crate::pupil::Quadrature;
use crate::spot::spot;

/// Limits keep their meaning where light goes backwards.
#[test]
fn limits_of_mirrors_have_the_right_gradient() {
    for lens in [mangin(), telescope()] {
        let variables = (0..lens.surfaces.len())
            .flat_map(|s| {
                let (r, t) = (1.0 / lens.surfaces[s].shape.curvature, lens.surfaces[s].thickness_mm);
                let around = |p, v: f64| variable(s, p, v - 0.3 * v.abs(), v + 0.3 * v.abs());
                [around(Number::Curvature, r), around(Number::Thickness, t)]
            })
            .filter(|v| v.surface + 1 < lens.surfaces.len() || v.number == Number::Curvature)
            .collect();
        let far = lens.fields_deg.last().unwrap().to_radians();
        let limits = Limits {
            element_edge_mm: Some(20.0),
            element_centre_mm: None,
            air_gap_mm: Some(500.0),
            back_focal_mm: Some([1.0, 2.0]),
            track_mm: Some(50.0),
            clear_diameter_mm: Some(10.0),
            slope_rad: Some(0.01),
            ..Limits::default()
        };
        let problem = Problem {
            variables,
            // The mean RMS has a kink where a spot vanishes, as on the axis of a telescope.
            merit: SpotResiduals {
                fields_rad: vec![0.0, far],
                field_weights: vec![1.0; 2],
                power: 2.0,
                ..SpotResiduals::new(&lens)
            },
            limits,
            stiffness_um_per_mm: 1.0,
            ..Problem::new(lens.clone())
        };
        let unlimited = Problem { limits: Limits::default(), ..problem.clone() };
        let space = unlimited.space().unwrap();
        let analysis = analyse(&problem, space.lens_at(&space.start()).unwrap(), None).unwrap();
        let excess = |named: &str| {
            analysis.violations.iter().find(|(what, _)| what.to_string() == named).map(|(_, a)| *a)
        };
        // Distances are counted along the light, whatever their sign.
        let last = lens.surfaces.len() - 1;
        let image = lens.surfaces[last].thickness_mm.abs();
        assert!((excess("back focal length").unwrap() - (image - 2.0)).abs() < 1e-6, "{}", lens.name);
        let at: Vec<f64> = lens
            .surfaces
            .iter()
            .scan(0.0, |z, s| {
                *z += s.thickness_mm;
                Some(*z)
            })
            .collect();
        let range = at.iter().fold(0.0_f64, |a, b| a.max(*b)) - at.iter().fold(0.0_f64, |a, b| a.min(*b));
        assert!((excess("track").unwrap() - (range - 50.0)).abs() < 1e-9);
        if lens.name == "Mangin" {
            assert!(
                excess("edge thickness behind surface 1").unwrap() > 0.0
                    && excess("edge thickness behind surface 2").unwrap() > 0.0
            );
        } else {
            assert!((excess("air behind surface 1").unwrap() - 80.0).abs() < 1e-9);
        }
        assert!(analysis.violations.len() >= 6, "{:?}", analysis.violations);
        // The bound of a least gap would move the start; without it the penalty has its gradient.
        let mut free = problem;
        free.limits.air_gap_mm = None;
        assert!(check_gradient(&free) >= 5);
    }
}

#[test]
fn the_two_ends_of_a_range_have_their_own_slopes() {
    let lens = nominal_triplet();
    let efl_mm = first_order(&lens.at_wavelength(lens.reference_um)).efl_mm;
    let slope = |between_mm: [f64; 2]| {
        let constraint = Constraint::FocalLength { between_mm };
        let clear = SemiDiameters(&lens);
        let gradient = constraint.gradient(&lens, &clear, 1.0).unwrap();
        (constraint.excess_mm(&lens, &clear).unwrap(), gradient[(0, Number::Curvature)])
    };
    // A stronger front shortens the focal length: it leads away from the upper end, and beyond the lower one.
    for (below, above, near) in [(1.0, 0.1, -1.0), (0.1, 1.0, 1.0)] {
        let (excess, by) = slope([efl_mm - below, efl_mm + above]);
        assert!((excess + 0.1).abs() < 1e-12 && by * near > 0.0, "{excess} {by}");
    }
    assert_eq!(Constraint::FocalLength { between_mm: [24.0, 25.5] }.range_mm(), Some(1.5));
}

#[test]
fn bounds_and_limits_are_kept() {
    let limited = strict(problem());
    let limits = Limits {
        element_edge_mm: Some(0.9),
        element_centre_mm: Some(2.6),
        air_gap_mm: Some(0.5),
        back_focal_mm: Some([24.0, 24.3]),
        track_mm: Some(47.0),
        clear_diameter_mm: Some(14.8),
        distortion: Some(0.05),
        slope_rad: Some(0.9),
        chief_ray_angle_rad: Some(0.28),
    };
    let limited = Problem { stiffness_um_per_mm: 1e4, limits, ..limited };
    let descent = descend(&limited, &LevenbergOptions::default(), &mut |_, _, _| true).unwrap();
    let space = limited.space().unwrap();
    for (x, [low, high]) in descent.at.iter().zip(space.bounds()) {
        assert!(x >= low && x <= high);
    }
    for (what, amount) in &descent.best.violations {
        assert!(*amount < 0.02, "{what:?} {amount}");
    }
    let lens: &Lens = &descent.best.lens;
    let vertices = lens.total_track_mm() - lens.image_distance_mm();
    assert!((vertices - 22.1).abs() < 1e-12);
    assert_eq!(lens.surfaces[3].shape.curvature, -lens.surfaces[2].shape.curvature);
}

/// The limit of clear diameters is that of the semi-diameters which a file gets: with the margin of the mount, which the stop has not.
#[test]
fn clear_diameters_are_limited_as_they_are_written() {
    const MOST_MM: f64 = 1.0;
    let limits = Limits { clear_diameter_mm: Some(MOST_MM), ..Limits::default() };
    let base = nominal_triplet();
    let problem = Problem { limits, ..Problem::new(base.clone()) };
    let analysis = analyse(&problem, base.clone(), None).unwrap();
    let written = analysis.fitted_lens(&problem);
    assert_eq!(analysis.violations.len(), written.surfaces.len());
    for (surface, s) in written.surfaces.iter().enumerate() {
        let limit = Constraint::ClearDiameter { surface, most_mm: MOST_MM };
        let (_, excess_mm) = analysis.violations.iter().find(|(what, _)| *what == limit).unwrap();
        let beyond_mm = s.semi_diameter_mm - 0.5 * MOST_MM;
        assert!((excess_mm - beyond_mm).abs() < 1e-6, "surface {surface}: {excess_mm} {beyond_mm}");
    }
    assert_eq!(analysis.violations_as_written(&problem, &written).len(), written.surfaces.len());
    // Fields that the problem leaves out make the surfaces of the file wider: the limit counts there too.
    let narrow = SpotResiduals { fields_rad: vec![0.0], field_weights: vec![1.0], ..problem.merit.clone() };
    let on_axis = Problem { merit: narrow, ..problem };
    let analysis = analyse(&on_axis, base, None).unwrap();
    let written = analysis.fitted_lens(&on_axis);
    let excess_mm = |found: &[(Constraint, f64)]| found.iter().fold(0.0_f64, |most, (_, mm)| most.max(*mm));
    assert!(excess_mm(&analysis.violations) < 3.0);
    assert!(excess_mm(&analysis.violations_as_written(&on_axis, &written)) > 6.0);
}

/// Gaps are stated as the file has them: beside the stop, which has no mount, the descent measures further out.
#[test]
fn gaps_are_stated_at_the_edges_of_the_file() {
    let limits = Limits { air_gap_mm: Some(5.0), ..Limits::default() };
    let base = nominal_triplet();
    let problem = Problem { limits, ..Problem::new(base.clone()) };
    let analysis = analyse(&problem, base.clone(), None).unwrap();
    let written = analysis.fitted_lens(&problem);
    let beside_stop = Constraint::AirEdge { surface: 4, least_mm: 5.0 };
    let of = |found: &[(Constraint, f64)]| found.iter().find(|(what, _)| *what == beside_stop).unwrap().1;
    let at_edge = beside_stop.excess_mm(&written, &SemiDiameters(&written)).unwrap();
    assert!((of(&analysis.violations) - at_edge).abs() > 1e-4, "the stop has no mount in the file");
    assert_eq!(of(&analysis.violations_at_written_edges(&written)), at_edge);
    assert_eq!(of(&analysis.violations_as_written(&problem, &written)), at_edge);
    // In front of the stop the gap narrows outwards: the file keeps a limit between the two measures, and no violation is stated.
    let in_front = |least_mm: f64| Constraint::AirEdge { surface: 3, least_mm };
    let further_out = analysis.violations.iter().find(|(what, _)| *what == in_front(5.0)).unwrap().1;
    let as_written = in_front(5.0).excess_mm(&written, &SemiDiameters(&written)).unwrap();
    let least_mm = 5.0 - 0.5 * (further_out + as_written);
    let problem = Problem { limits: Limits { air_gap_mm: Some(least_mm), ..Limits::default() }, ..problem };
    let analysis = analyse(&problem, base, None).unwrap();
    let has = |found: &[(Constraint, f64)]| found.iter().any(|(what, _)| *what == in_front(least_mm));
    assert!(has(&analysis.violations) && !has(&analysis.violations_at_written_edges(&written)));
}

/// Further constraints are kept at the clear radii that the lens has.
#[test]
fn further_constraints_are_kept_at_drawn_apertures() {
    let drawn = Problem {
        further: vec![
            Constraint::Edge { surface: 5, least_mm: 2.2 },
            Constraint::AirEdge { surface: 1, least_mm: 7.4 },
            Constraint::ImageDistance { least_mm: 25.5 },
        ],
        apertures: Apertures::Drawn,
        focus: Focus::Paraxial { range_mm: 0.5 },
        solves: Solves {
            efl: Some(EflSolve { surface: 6, efl_mm: 25.04, radius_mm: None }),
            ..Solves::default()
        },
        ..problem()
    };
    let loose = Problem { stiffness_um_per_mm: 30.0, ..drawn.clone() };
    assert_eq!(check_gradient(&loose), 3);
    let descent = descend(&drawn, &LevenbergOptions::default(), &mut |_, _, _| true).unwrap();
    for (what, amount) in &descent.best.violations {
        assert!(*amount < 2e-3, "{what} {amount}");
    }
    assert!(descent.best.lens.image_distance_mm() > 25.498);
}

/// A first surface that cuts the beams of the corner keeps its clear aperture; spots through it are those of the light that passes. No other number
/// changes, and a lens that cuts nothing keeps nothing.
#[test]
fn a_clear_aperture_that_cuts_beams_is_kept() {
    let analysed = |problem: &Problem| {
        let once = LevenbergOptions { iterations: 0, ..LevenbergOptions::default() };
        descend(problem, &once, &mut |_, _, _| true).unwrap().best
    };
    let whole = problem();
    let none = analysed(&whole).cutting_apertures_mm(&whole);
    assert!(none.iter().all(Option::is_none), "{none:?}");

    let mut cut = problem();
    cut.base.surfaces[0].semi_diameter_mm = 5.0;
    let analysis = analysed(&cut);
    let cutting = analysis.cutting_apertures_mm(&cut);
    assert_eq!(cutting[0], Some(5.0));
    assert!(cutting[1..].iter().all(Option::is_none), "{cutting:?}");
    // The merit follows every ray of the stop.
    assert_eq!(analysis.rms_um, analysed(&whole).rms_um);

    let kept = Problem { kept_apertures_mm: cutting, ..cut.clone() };
    let (grown, fitted) = (analysis.fitted_lens(&cut), analysis.fitted_lens(&kept));
    assert!(grown.surfaces[0].semi_diameter_mm > 7.0);
    assert_eq!(fitted.surfaces[0].semi_diameter_mm, 5.0);
    for (a, b) in grown.surfaces.iter().zip(&fitted.surfaces).skip(1) {
        assert_eq!(a.semi_diameter_mm, b.semi_diameter_mm);
    }
    // A spot by cells of the pupil, on the plane where the light that passes is best.
    let passing_um = analysis.rms_of_light_um(&kept, &fitted).unwrap();
    for (field, rms_um) in kept.merit.fields_rad.iter().zip(&passing_um) {
        let reference = spot(&fitted, *field, &Quadrature::grid(256).unwrap()).unwrap();
        assert!((rms_um / reference.rms_poly_um - 1.0).abs() < 3e-3, "{rms_um} {}", reference.rms_poly_um);
    }
    // Limits are measured where the surface ends, not where beams would need it to.
    let limits = Limits { clear_diameter_mm: Some(12.0), ..Limits::default() };
    let violated = |problem: Problem| {
        let found = analysed(&Problem { limits, ..problem }).violations;
        found.into_iter().any(|(what, _)| what == Constraint::ClearDiameter { surface: 0, most_mm: 12.0 })
    };
    assert!(violated(cut) && !violated(kept));
}
