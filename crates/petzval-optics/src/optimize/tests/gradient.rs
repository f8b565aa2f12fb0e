//! Derivatives of the merit against differences.

use super::*;
use crate::common::special_lenses;
use crate::lens::Departure;

#[test]
fn the_gradient_is_that_of_the_merit() {
    assert_eq!(check_gradient(&problem()), 0);
    assert_eq!(check_gradient(&with_merit(problem(), |m| m.power = 2.0)), 0);
    let fixed = Problem { focus: Focus::Fixed, ..with_merit(problem(), |m| m.power = 4.0) };
    assert_eq!(check_gradient(&fixed), 0);
    assert!(check_gradient(&strict(problem())) >= 10, "{}", check_gradient(&strict(problem())));
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
