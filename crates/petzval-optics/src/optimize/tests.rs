//! Derivatives of the merit against differences, and descents.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::analysis::{analyse, linearise};
use super::*;
use crate::constraint::{Constraint, SemiDiameters};
use crate::design_space::{DesignSpaceError, EflSolve, Focus, Pickup, Solves, Variable, wide_variables};
use crate::gradient::LensGradient;
use crate::lens::{Departure, Lens, Placement, Surface};
use crate::merit::{Better, FieldSet, Merit, Mtf, Seen, SpotResiduals, lifted_normal_equations};
use crate::number::Number;
use crate::paraxial::first_order;
use crate::psf::PsfKind;
use crate::pupil::{PupilSampling, Quadrature};
use crate::spot::spot;

use crate::common::{mangin, nominal_triplet, special_lenses, telescope};

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

#[test]
fn the_gradient_is_that_of_the_merit() {
    assert_eq!(check_gradient(&problem()), 0);
    assert_eq!(check_gradient(&with_merit(problem(), |m| m.power = 2.0)), 0);
    let fixed = Problem { focus: Focus::Fixed, ..with_merit(problem(), |m| m.power = 4.0) };
    assert_eq!(check_gradient(&fixed), 0);
    assert!(check_gradient(&strict(problem())) >= 10, "{}", check_gradient(&strict(problem())));
}

/// A merit that hides its residuals, and may be lifted in place of them.
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

#[test]
fn the_gradient_is_that_of_the_merit_for_a_near_object_and_for_special_surfaces() {
    // From a near object, and a virtual one, with distortion among the limits.
    for distance_mm in [500.0, -500.0] {
        let mut near = problem();
        near.base.object = crate::lens::ObjectDistance::Finite(distance_mm);
        near.base = crate::solve::with_paraxial_focus(&near.base, 0.0);
        near.limits.distortion = Some(0.001);
        near.stiffness_um_per_mm = 30.0;
        assert_eq!(check_gradient(&near), 1, "{distance_mm}");
    }
    for lens in special_lenses() {
        let free = |surface: usize, number: Number, range: f64| {
            let has = lens.surfaces[surface].has_number(number);
            let value = number.read_stated(&lens, surface);
            has.then(|| variable(surface, number, value - range, value + range))
        };
        let of_surface = |s: usize| {
            // Odd powers are not normalised.
            let is_odd = matches!(lens.surfaces[s].shape.departure, Departure::Odd(_));
            let size = move |k: i32| if is_odd { 4f64.powi(-1 - 2 * k) } else { 1.0 };
            let departures = (0..6).map(move |k| (Number::Departure(k), 1e-3 * size(k as i32)));
            let others = [(Number::Phase(0), 1.0), (Number::Power, 1e-3), (Number::Conic, 0.1)];
            let placement = [
                (Number::Decenter(0), 0.1),
                (Number::Decenter(1), 0.1),
                (Number::Tilt(0), 0.5),
                (Number::Tilt(1), 0.5),
                (Number::Tilt(2), 0.5),
            ];
            departures.chain(others).chain(placement).filter_map(move |(n, range)| free(s, n, range))
        };
        let variables: Vec<Variable> = (0..lens.surfaces.len()).flat_map(of_surface).collect();
        let far = lens.fields_deg.last().unwrap().to_radians();
        let problem = Problem {
            variables,
            merit: SpotResiduals {
                fields_rad: vec![0.0, 0.6 * far],
                field_weights: vec![1.0; 2],
                ..SpotResiduals::new(&lens)
            },
            limits: Limits { slope_rad: Some(0.05), ..Limits::default() },
            stiffness_um_per_mm: 30.0,
            ..Problem::new(lens.clone())
        };
        check_gradient(&problem);
    }
}

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
fn pickups_on_what_is_solved_for_are_refused() {
    let mut one = problem();
    one.pickups = vec![Pickup { surface: 6, variable: 0, scale: 1.0, offset: 0.0 }];
    assert!(matches!(one.space().unwrap_err(), DesignSpaceError::Settled { surface: 7, .. }));
    one.pickups = vec![Pickup { surface: 6, variable: 3, scale: 1.0, offset: 0.0 }];
    assert!(matches!(one.space().unwrap_err(), DesignSpaceError::Settled { surface: 7, .. }));
    one.focus = Focus::Fixed;
    one.solves.length = Some((3, 22.1));
    one.pickups = vec![Pickup { surface: 3, variable: 3, scale: 1.0, offset: 0.0 }];
    assert!(matches!(one.space().unwrap_err(), DesignSpaceError::Settled { surface: 4, .. }));
}

#[test]
fn a_variable_that_a_surface_does_not_have_is_refused() {
    let mut problem = problem();
    problem.variables.push(variable(5, Number::Departure(0), -1.0, 1.0));
    let expected = DesignSpaceError::NoSuchNumber { surface: 6, number: Number::Departure(0) };
    assert_eq!(problem.space().unwrap_err(), expected);
}

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

#[test]
fn impossible_problems_say_why() {
    let base = problem();
    let wrong = |change: &dyn Fn(&mut Problem)| {
        let mut p = base.clone();
        change(&mut p);
        descend(&p, &LevenbergOptions::default(), &mut |_, _, _| true).unwrap_err()
    };
    let error = wrong(&|p| p.variables[0].surface = 9);
    assert_eq!(error, DesignSpaceError::NoSuchSurface { surface: 10, count: 7 });
    let error = wrong(&|p| p.pickups.push(Pickup { surface: 1, variable: 77, scale: 1.0, offset: 0.0 }));
    assert_eq!(error, DesignSpaceError::NoSuchVariable { variable: 78, count: 9 });
    let error = wrong(&|p| p.variables[3].max = p.variables[3].min);
    assert!(matches!(error, DesignSpaceError::Bounds { surface: 2, .. }));
    let error = wrong(&|p| p.solves.efl = Some(EflSolve { surface: 4, efl_mm: 25.0, radius_mm: None }));
    assert!(matches!(error, DesignSpaceError::EflUnsolvable { surface: 5, .. }));
    let error = wrong(&|p| p.base.entrance_pupil_mm = 40.0);
    assert_eq!(error, DesignSpaceError::NoRays);
}

#[test]
fn a_search_gives_the_same_on_any_number_of_threads_and_after_a_break() {
    let problem = Problem {
        merit: SpotResiduals {
            wavelengths_um: vec![0.5876],
            sampling: crate::pupil::PupilSampling::Degree(4),
            ..problem().merit
        },
        ..problem()
    };
    let options = SearchOptions { seed: 7, round: 8, ..SearchOptions::default() };
    let search = |threads: usize, rounds: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut search = Search::new(&problem, options).unwrap();
            (0..rounds).for_each(|_| {
                search.advance();
            });
            search.state()
        })
    };
    let whole = search(1, 6);
    assert_eq!(search(3, 6), whole);
    let mut resumed = Search::resume(&problem, options, &search(2, 4)).unwrap();
    resumed.advance();
    resumed.advance();
    assert_eq!(resumed.state(), whole);

    // It only gets better, and better than the lens that it could have begun with.
    let start = descend(&problem, &LevenbergOptions::default(), &mut |_, _, _| true).unwrap().best.merit;
    let mut search = Search::new(&problem, options).unwrap();
    let mut before = f64::INFINITY;
    for _ in 0..8 {
        let improved = search.advance();
        let merit = search.best().unwrap().analysis.merit;
        assert!(merit <= before && improved == (merit < before));
        before = merit;
    }
    assert!(before <= 1.01 * start, "{before} {start}");
}

#[test]
fn a_search_exchanges_glasses() {
    // The flint of the triplet may become a crown that makes colour worse; the search must find its way back.
    let lens = nominal_triplet();
    let flint = lens.surfaces[2].glass.clone();
    let plastic = lens.surfaces[0].glass.clone();
    let mut base = problem();
    base.base.surfaces[2].glass = plastic.clone();
    let limited = Problem {
        glasses: vec![GlassChoice { surface: 2, candidates: vec![plastic, flint.clone()] }],
        ..base.clone()
    };
    let options = SearchOptions { seed: 3, round: 8, ..SearchOptions::default() };
    let mut search = Search::new(&limited, options).unwrap();
    (0..6).for_each(|_| {
        search.advance();
    });
    let best = search.best().unwrap();
    assert_eq!(best.analysis.lens.surfaces[2].glass, flint);
    assert_eq!(best.glasses, [1]);
    let mut stuck = Search::new(&base, options).unwrap();
    (0..6).for_each(|_| {
        stuck.advance();
    });
    let without = stuck.best().map_or(f64::INFINITY, |f| f.analysis.merit);
    assert!(best.analysis.merit < 0.8 * without, "{} {without}", best.analysis.merit);
    // It goes on with the glasses that it had.
    let resumed = Search::resume(&limited, options, &search.state()).unwrap();
    assert_eq!(resumed.best().unwrap().analysis.merit, best.analysis.merit);

    let none = Problem { glasses: vec![GlassChoice { surface: 2, candidates: Vec::new() }], ..base };
    assert_eq!(Search::new(&none, options).err(), Some(DesignSpaceError::NoGlass { surface: 3 }));
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
    assert_eq!(analysed(&whole).rms_through_apertures_um(&whole, &whole.base), None);

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
    let passing_um = analysis.rms_through_apertures_um(&kept, &fitted).unwrap();
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
