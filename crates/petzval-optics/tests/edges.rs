//! Edges of elements whose surfaces have different clear radii, against their geometry.

mod common;

use common::nominal_triplet;
use petzval_optics::constraint::{Constraint, SemiDiameters};
use petzval_optics::lens::{Lens, SurfaceShape};
use petzval_optics::number::Number;

/// The sag of a sphere.
fn sag(radius_mm: f64, height_mm: f64) -> f64 {
    radius_mm - radius_mm.signum() * (radius_mm * radius_mm - height_mm * height_mm).sqrt()
}

/// The first element of the triplet with other spheres: radius and clear radius of the front, and of the rear.
fn element(front: [f64; 2], rear: [f64; 2], thickness_mm: f64) -> Lens {
    let mut lens = nominal_triplet();
    for (s, [radius_mm, clear_mm]) in lens.surfaces.iter_mut().zip([front, rear]) {
        s.shape = SurfaceShape { curvature: 1.0 / radius_mm, ..SurfaceShape::PLANE };
        s.semi_diameter_mm = clear_mm;
    }
    lens.surfaces[0].thickness_mm = thickness_mm;
    lens
}

fn excess(lens: &Lens, constraint: Constraint) -> f64 {
    constraint.excess_mm(lens, &SemiDiameters(lens)).unwrap()
}

fn edge(lens: &Lens) -> f64 {
    -excess(lens, Constraint::Edge { surface: 0, least_mm: 0.0 })
}

#[test]
fn each_surface_has_its_shape_up_to_its_own_clear_radius_and_is_flat_beyond() {
    // A deep inner radius: at the clear radius of the front, 22.2 mm, the rear has no sag at all.
    let deep = element([140.0, 22.2], [22.0, 16.0], 3.8);
    assert!((edge(&deep) - (3.8 + sag(22.0, 16.0) - sag(140.0, 22.2))).abs() < 1e-12);
    // A hair on either side of that radius nothing jumps.
    let just = |radius_mm| edge(&element([140.0, 22.218603], [radius_mm, 16.0], 3.8));
    assert!((just(22.218602) - just(22.218604)).abs() < 1e-5);
    // A meniscus whose concave front is the larger is thinnest where the convex rear ends.
    let meniscus = element([-20.0, 10.0], [-15.0, 8.0], 2.0);
    assert!((edge(&meniscus) - (2.0 + sag(-15.0, 8.0) - sag(-20.0, 8.0))).abs() < 1e-12);
    // Of two equal clear radii it is the plain edge.
    let equal = element([30.0, 7.0], [-40.0, 7.0], 5.0);
    assert!((edge(&equal) - (5.0 + sag(-40.0, 7.0) - sag(30.0, 7.0))).abs() < 1e-12);
}

#[test]
fn a_shape_must_not_end_inside_its_clear_radius() {
    let reach = |radius_mm: f64, conic: f64| {
        let mut lens = element([140.0, 22.2], [radius_mm, 16.0], 3.8);
        lens.surfaces[1].shape.conic = conic;
        excess(&lens, Constraint::Reach { surface: 1 })
    };
    // A sphere ends at its radius, a conic at R / sqrt(1 + k), a paraboloid nowhere; a thousandth before, it counts no more.
    assert!((reach(16.0, 0.0) - (16.0 - 0.999 * 16.0)).abs() < 1e-12);
    assert!((reach(20.0, 0.96) - (16.0 - 0.999 * 20.0 / 1.4)).abs() < 1e-12);
    assert!(reach(16.1, 0.0) < 0.0 && reach(3.0, -1.0) < 0.0);
    // Beyond its reach the edge is that at the reach, so that it has a value everywhere.
    let beyond = element([140.0, 22.2], [15.0, 16.0], 3.8);
    let at = 3.8 + sag(15.0, 0.999 * 15.0) - sag(140.0, 22.2);
    assert!((edge(&beyond) - at).abs() < 1e-9, "{}", edge(&beyond));
}

#[test]
fn edges_and_reach_have_the_gradient_of_their_excess() {
    let lenses = [
        element([140.0, 22.2], [22.0, 16.0], 3.8),
        element([-20.0, 10.0], [-15.0, 8.0], 2.0),
        element([30.0, 7.0], [-40.0, 9.0], 5.0),
    ];
    for lens in lenses {
        for constraint in [
            Constraint::Edge { surface: 0, least_mm: 30.0 },
            Constraint::AirEdge { surface: 1, least_mm: 30.0 },
            Constraint::Reach { surface: 1 },
        ] {
            let gradient = constraint.gradient(&lens, &SemiDiameters(&lens), 1.0).unwrap();
            for (surface, number, step) in [
                (0, Number::Curvature, 1e-7),
                (0, Number::Thickness, 1e-5),
                (1, Number::Curvature, 1e-7),
                (1, Number::Conic, 1e-5),
                (1, Number::Thickness, 1e-5),
            ] {
                let moved = |by: f64| {
                    let mut lens = lens.clone();
                    let value = number.read(&lens, surface);
                    number.write(&mut lens, surface, value + by);
                    excess(&lens, constraint)
                };
                let numeric = (moved(step) - moved(-step)) / (2.0 * step);
                let analytic = gradient[(surface, number)];
                let scale = analytic.abs().max(1.0);
                assert!((numeric - analytic).abs() < 1e-6 * scale, "{constraint}: {numeric} {analytic}");
            }
        }
    }
}
