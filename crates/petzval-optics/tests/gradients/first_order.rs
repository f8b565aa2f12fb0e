//! First-order properties, clearances and the field of view.

use super::knobs::check;
use super::near;
use crate::common::{nominal_triplet, special_lenses};
use petzval_optics::constraint::{Constraint, penalty};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::optimize::Limits;
use petzval_optics::paraxial::{
    FirstOrderCotangent, first_order, image_brightness, image_height_per_tangent, pull_back_first_order,
    pull_back_image_distance, pull_back_image_height, pull_back_log_brightness,
};
use petzval_optics::pupil::chief_ray;
use petzval_optics::solve::with_paraxial_focus;

#[test]
fn first_order_properties() {
    let lens = nominal_triplet();
    let loss = |l: &Lens| {
        let order = first_order(&l.at_wavelength(l.reference_um));
        order.efl_mm + 0.5 * order.bfl_mm + 3.0 * order.stop_radius_mm
    };
    let mut gradient = LensGradient::zero(7);
    let first_order_bar = FirstOrderCotangent { efl: 1.0, bfl: 0.5, stop_radius: 3.0 };
    pull_back_first_order(&lens.at_wavelength(lens.reference_um), first_order_bar, &mut gradient);
    check(&lens, &gradient, &loss, &[1.0], 1e-6);

    let lens = near(lens);
    let loss = |l: &Lens| first_order(&l.at_wavelength(l.reference_um)).image_distance_mm;
    let mut gradient = LensGradient::zero(7);
    pull_back_image_distance(&lens.at_wavelength(lens.reference_um), 1.0, &mut gradient);
    check(&lens, &gradient, &loss, &[1.0], 1e-6);

    let mut all = special_lenses();
    all.extend(
        special_lenses().into_iter().map(|lens| Lens { object: ObjectDistance::Finite(300.0), ..lens }),
    );
    for lens in all {
        let sequence = lens.at_wavelength(lens.reference_um);
        let loss = |l: &Lens| {
            let sequence = l.at_wavelength(l.reference_um);
            let order = first_order(&sequence);
            order.image_distance_mm
                + 3.0 * order.stop_radius_mm
                + 2.0 * image_height_per_tangent(&sequence)
                + 5.0 * image_brightness(&sequence).ln()
        };
        let mut gradient = LensGradient::zero(lens.surfaces.len());
        pull_back_image_distance(&sequence, 1.0, &mut gradient);
        pull_back_first_order(
            &sequence,
            FirstOrderCotangent { stop_radius: 3.0, ..Default::default() },
            &mut gradient,
        );
        pull_back_image_height(&sequence, 2.0, &mut gradient);
        pull_back_log_brightness(&sequence, 5.0, &mut gradient);
        check(&lens, &gradient, &loss, &[1.0, 10.0], 1e-6);
        // A field close to the axis is imaged where first-order optics says, on the paraxial image plane.
        let focused = with_paraxial_focus(&lens, 0.0);
        if focused.is_rotationally_symmetric() {
            let sequence = focused.at_wavelength(focused.reference_um);
            let field = 1e-5_f64;
            let real = chief_ray(&sequence, field).unwrap().y_mm;
            let ideal = image_height_per_tangent(&sequence) * field.tan();
            assert!((real / ideal - 1.0).abs() < 1e-6, "{}: {real} {ideal}", lens.name);
        }
    }
}

#[test]
fn clearances() {
    let lens = nominal_triplet();
    let limits = Limits {
        element_edge_mm: Some(6.0),
        element_centre_mm: Some(6.0),
        air_gap_mm: Some(4.0),
        ..Limits::default()
    };
    let mut constraints = limits.constraints(&lens, 0.0);
    constraints.push(Constraint::ImageDistance { least_mm: 30.0 });
    let (value, gradient) = penalty(&constraints, &lens).unwrap();
    assert!(value > 1.0);
    // The semi-diameter is where the edge is measured, not a variable of the penalty.
    let mut lens = lens;
    lens.entrance_pupil_mm = 5.7;
    let loss = |l: &Lens| penalty(&constraints, &with_radii_of(&lens, l)).unwrap().0;
    check(&lens, &gradient, &loss, &[1.0], 1e-6);
}

/// A lens with the clear radii of another: there constraints are measured, and no penalty moves them.
fn with_radii_of(clear: &Lens, lens: &Lens) -> Lens {
    let mut same = lens.clone();
    for (a, b) in same.surfaces.iter_mut().zip(&clear.surfaces) {
        a.semi_diameter_mm = b.semi_diameter_mm;
    }
    same
}

#[test]
fn radius_and_field_of_view() {
    let lens = nominal_triplet();
    let of_radius = |l: &Lens, surface: usize, radius_mm: [f64; 2]| {
        penalty(&[Constraint::SolvedRadius { surface, radius_mm }], l).unwrap()
    };
    let loss = |l: &Lens| {
        let same = with_radii_of(&lens, l);
        of_radius(&same, 6, [-12.5, -11.0]).0 + of_radius(&same, 1, [12.0, 14.0]).0
    };
    let (low, mut gradient) = of_radius(&lens, 6, [-12.5, -11.0]);
    let (high, other) = of_radius(&lens, 1, [12.0, 14.0]);
    gradient += &other;
    // The sag at the clear radius between the shape and that of the bound, which is 1e-4 of the width inside.
    let sag_mm2 = |surface: usize, bound_mm: f64, other_mm: f64| {
        let surface = &lens.surfaces[surface];
        let inside = 1e-4 * (1.0 / bound_mm - 1.0 / other_mm).abs();
        let beyond = (surface.shape.curvature - 1.0 / bound_mm).abs() + inside;
        (0.5 * surface.semi_diameter_mm.powi(2) * beyond).powi(2)
    };
    let of_low = sag_mm2(6, -12.5, -11.0);
    assert!((low / of_low - 1.0).abs() < 1e-9 && low > 1e-4, "{low} {of_low}");
    let of_high = sag_mm2(1, 12.0, 14.0);
    assert!((high / of_high - 1.0).abs() < 1e-9 && high > 1e-4, "{high} {of_high}");
    check(&lens, &gradient, &loss, &[1.0], 1e-6);
    assert_eq!(of_radius(&lens, 6, [-15.05, -11.5]).0, 0.0);

    let field = 14.0_f64.to_radians();
    let at = |l: &Lens, wanted_mm: f64| {
        penalty(&[Constraint::ChiefHeight { field_rad: field, wanted_mm, tolerance_mm: 0.02 }], l).unwrap()
    };
    for wanted in [5.0, 6.5] {
        let (value, gradient) = at(&lens, wanted);
        assert!(value > 0.01);
        check(&lens, &gradient, &|l: &Lens| at(l, wanted).0, &[1.0], 1e-6);
    }
    let held = chief_ray(&lens.at_wavelength(lens.reference_um), field).unwrap().y_mm;
    assert_eq!(at(&lens, held + 0.019).0, 0.0);
}
