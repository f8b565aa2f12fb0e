//! Special surfaces against what is known of them: implicit equations, the grating equation, images without aberration.

mod common;

use common::{mangin, nominal_triplet, telescope};
use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::lens::{
    Action, Axis, Departure, Lens, LensDefect, ObjectDistance, Pattern, Phase, Placement, Q_TERMS, Surface,
    SurfaceShape, XY_TERMS, validate, xy_index,
};
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::chief_ray;
use petzval_optics::seidel::seidel_total;
use petzval_optics::trace::{Path, Ray, RayBundle, Sequence, trace, trace_ray};

const GLASS: f64 = 1.6;

fn glass() -> std::sync::Arc<Glass> {
    std::sync::Arc::new(Glass::new("glass", Dispersion::Constant(GLASS)))
}

fn lens(surfaces: Vec<Surface>) -> Lens {
    let base = nominal_triplet();
    Lens { surfaces, stop: 0, wavelengths_um: vec![0.5], reference_um: 0.5, fields_deg: vec![0.0], ..base }
}

fn one(surface: Surface) -> Lens {
    lens(vec![Surface { semi_diameter_mm: 50.0, ..surface }])
}

fn reference(lens: &Lens) -> Sequence {
    lens.at_wavelength(lens.reference_um)
}

fn at(lens: &Lens, x: f64, y: f64, direction: [f64; 3]) -> Path {
    let path = trace_ray(&reference(lens), Ray { position: [x, y, 0.0], direction });
    assert!(path.fate.reaches_image(), "{:?}", path.fate);
    path
}

const AXIS: [f64; 3] = [0.0, 0.0, 1.0];

#[test]
fn a_paraboloid_focuses_parallel_light_in_a_point_at_equal_paths() {
    let mirror = one(Surface {
        shape: SurfaceShape { curvature: -1.0 / 200.0, conic: -1.0, ..SurfaceShape::PLANE },
        thickness_mm: -100.0,
        action: Action::Reflect,
        ..Surface::default()
    });
    let order = first_order(&reference(&mirror));
    assert!((order.efl_mm - 100.0).abs() < 1e-12 && (order.image_distance_mm + 100.0).abs() < 1e-12);
    for (x, y) in [(0.0, 1.0), (20.0, -13.0), (-40.0, 25.0)] {
        let path = at(&mirror, x, y, AXIS);
        let [px, py, _] = path.image.unwrap().position;
        assert!(px.abs() < 1e-12 && py.abs() < 1e-12);
        assert!((path.optical_path_mm - 100.0).abs() < 1e-12, "{}", path.optical_path_mm);
    }
}

#[test]
fn an_ellipsoid_images_one_focus_on_the_other() {
    // Foci at a (1 -+ e) from the vertex, k = -e^2, R = a (1 - e^2).
    let (a, e) = (150.0, 0.4);
    let mut mirror = one(Surface {
        shape: SurfaceShape { curvature: -1.0 / (a * (1.0 - e * e)), conic: -e * e, ..SurfaceShape::PLANE },
        thickness_mm: -a * (1.0 - e),
        action: Action::Reflect,
        ..Surface::default()
    });
    mirror.object = ObjectDistance::Finite(a * (1.0 + e));
    assert!((first_order(&reference(&mirror)).image_distance_mm + a * (1.0 - e)).abs() < 1e-9);
    for y in [3.0, -20.0, 35.0_f64] {
        let d = [0.0, y, a * (1.0 + e)];
        let length = d[1].hypot(d[2]);
        let [_, py, _] = at(&mirror, 0.0, y, d.map(|v| v / length)).image.unwrap().position;
        assert!(py.abs() < 1e-10, "{py}");
    }
}

#[test]
fn a_ritchey_chretien_has_no_third_order_spherical_aberration_and_coma() {
    let lens = telescope();
    let total = seidel_total(&reference(&lens), 0.3_f64.to_radians()).unwrap().s;
    let spherical_primary = {
        let mut alone = lens.clone();
        alone.surfaces.truncate(1);
        alone.surfaces[0].shape.conic = 0.0;
        seidel_total(&reference(&alone), 0.3_f64.to_radians()).unwrap().s
    };
    // The conic constants were rounded; what is left is small against what one sphere would have.
    for (sum, single) in total.iter().zip(spherical_primary).take(2) {
        assert!(sum.abs() < 0.05 * single.abs(), "{total:?} {spherical_primary:?}");
    }
}

#[test]
fn a_mangin_mirror_is_three_surfaces_with_the_light_that_returns_through_glass() {
    // Rays close to the axis meet the axis where first-order optics says.
    let lens = mangin();
    let sequence = reference(&lens);
    let start = Ray { position: [0.0, 1e-3, 0.0], direction: AXIS };
    let image = trace_ray(&sequence, start).image.unwrap();
    assert!(image.position[1].abs() < 1e-9, "{}", image.position[1]);
    // And the optical path grows forwards and backwards alike: about twice the glass, and back to the image.
    let path = trace_ray(&sequence, Ray { position: [0.0; 3], direction: AXIS });
    let n = lens.surfaces[0].glass.index(lens.reference_um);
    let expected = 10.0 * n + lens.surfaces[2].thickness_mm.abs();
    assert!((path.optical_path_mm - expected).abs() < 1e-10);
}

#[test]
fn the_grating_equation_holds() {
    for (order, degrees) in [(1, 0.0), (-2, 10.0), (1, -25.0), (3, 5.0_f64)] {
        let lens = one(Surface {
            phase: Some(Phase { order, pattern: Pattern::Grating { lines_per_mm: 300.0 } }),
            glass: glass(),
            thickness_mm: 10.0,
            ..Surface::default()
        });
        let (sin, cos) = degrees.to_radians().sin_cos();
        let after = at(&lens, 0.3, 2.0, [0.0, sin, cos]).passages[0].direction_after;
        // n' sin' = n sin + m lambda f
        let expected = (sin + f64::from(order) * 0.5e-3 * 300.0) / GLASS;
        assert!((after[1] - expected).abs() < 1e-15 && after[0] == 0.0, "{after:?} {expected}");
        assert!((after.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-14);
    }
}

#[test]
fn a_grating_on_a_mirror_sends_light_back() {
    let lens = one(Surface {
        phase: Some(Phase { order: -1, pattern: Pattern::Grating { lines_per_mm: 600.0 } }),
        action: Action::Reflect,
        thickness_mm: -10.0,
        ..Surface::default()
    });
    // Littrow: in -1st order at sin = lambda f / 2 the light returns where it came from.
    let sin = 0.5 * 0.5e-3 * 600.0;
    let before = [0.0, sin, (1.0_f64 - sin * sin).sqrt()];
    let after = at(&lens, 0.0, 0.0, before).passages[0].direction_after;
    // Directions are those of lines: light itself goes along -after.
    for axis in 0..3 {
        assert!((after[axis] - before[axis]).abs() < 1e-15, "{after:?}");
    }
}

#[test]
fn a_binary_lens_focuses_as_its_phase_says() {
    // Phase of a perfect lens of focal length f: 2 pi / lambda (f - sqrt(f^2 + r^2)), to the eighth power of r.
    let (f, wavelength_mm) = (100.0_f64, 0.5e-3);
    let mut coefficients_rad = [0.0; 8];
    // f - sqrt(f^2 + u) = -u / 2 f + u^2 / 8 f^3 - u^3 / 16 f^5 + 5 u^4 / 128 f^7
    let series = [-0.5, 0.125, -0.0625, 5.0 / 128.0];
    for (i, c) in series.iter().enumerate() {
        coefficients_rad[i] = std::f64::consts::TAU / wavelength_mm * c * f.powi(-1 - 2 * i as i32);
    }
    let lens = one(Surface {
        phase: Some(Phase { order: 1, pattern: Pattern::Binary { norm_radius_mm: 1.0, coefficients_rad } }),
        thickness_mm: f,
        ..Surface::default()
    });
    assert!((first_order(&reference(&lens)).efl_mm - f).abs() < 1e-9);
    for y in [1.0, 5.0, 9.0] {
        let path = at(&lens, 0.6 * y, 0.8 * y, AXIS);
        let [px, py, _] = path.image.unwrap().position;
        // The next term of the series is r^9 (7/256) 10 / f^9.
        assert!(px.hypot(py) < 1e-7, "{px} {py}");
        assert!((path.optical_path_mm - f).abs() < 1e-8);
    }
    // In the second order the power is twice that, and so it is for twice the wavelength.
    let mut second = lens.clone();
    second.surfaces[0].phase.as_mut().unwrap().order = 2;
    assert!((first_order(&reference(&second)).efl_mm - 0.5 * f).abs() < 1e-9);
    assert!((first_order(&lens.at_wavelength(1.0)).efl_mm - 0.5 * f).abs() < 1e-9);
}

#[test]
fn a_thin_lens_images_planes_on_planes() {
    let power = 1.0 / 30.0;
    let (s, h) = (50.0, 7.0);
    let mut lens = one(Surface {
        action: Action::ThinLens { power_per_mm: power },
        thickness_mm: 1.0 / (power - 1.0 / s),
        ..Surface::default()
    });
    lens.object = ObjectDistance::Finite(s);
    let magnification = -lens.surfaces[0].thickness_mm / s;
    for (x, y) in [(0.0, 3.0), (8.0, -6.0), (-12.0, 1.0)] {
        let v = [x, y - h, s];
        let length = v.iter().map(|v: &f64| v * v).sum::<f64>().sqrt();
        let [px, py, _] = at(&lens, x, y, v.map(|v| v / length)).image.unwrap().position;
        assert!(px.abs() < 1e-12 && (py - magnification * h).abs() < 1e-12, "{px} {py}");
    }
    assert!(seidel_total(&reference(&lens), 0.1).is_none());
}

/// Surfaces met at points that fulfil their implicit equations.
#[test]
fn biconics_and_toroids_fulfil_their_equations() {
    let toroid = one(Surface {
        shape: SurfaceShape {
            curvature: 1.0 / 30.0,
            departure: Departure::Toroid { curvature_x: -1.0 / 70.0 },
            ..SurfaceShape::PLANE
        },
        glass: glass(),
        thickness_mm: 5.0,
        ..Surface::default()
    });
    let biconic = one(Surface {
        shape: SurfaceShape {
            curvature: 1.0 / 30.0,
            conic: 0.3,
            departure: Departure::Biconic { curvature_x: -1.0 / 70.0, conic_x: -2.0 },
            ..SurfaceShape::PLANE
        },
        ..toroid.surfaces[0].clone()
    });
    let direction = {
        let d = [0.1, -0.2, 1.0_f64];
        d.map(|v| v / d.iter().map(|v| v * v).sum::<f64>().sqrt())
    };
    for (x, y) in [(0.0, 0.0), (3.0, 12.0), (-14.0, 9.0), (8.0, -15.0)] {
        // The circle of radius 30 in y-z, turned about an axis along y through (0, 0, -70).
        let [px, py, pz] = at(&toroid, x, y, direction).passages[0].point;
        let from_axis = px.hypot(pz + 70.0);
        let miss = (from_axis - 100.0).hypot(py) - 30.0;
        assert!(miss.abs() < 1e-12, "{miss}");

        let [px, py, pz] = at(&biconic, x, y, direction).passages[0].point;
        // Curvatures -1/70 and 1/30, conic constants -2 and 0.3.
        let a = py * py / 30.0 - px * px / 70.0;
        let lost = 1.3 * py * py / 900.0 - px * px / 4900.0;
        assert!((pz - a / (1.0 + (1.0 - lost).sqrt())).abs() < 1e-12);
    }
}

fn departing(base: SurfaceShape, departure: Departure) -> SurfaceShape {
    SurfaceShape { departure, ..base }
}

/// Some departures are even aspheres written otherwise.
#[test]
fn departures_equal_to_even_aspheres_trace_the_same() {
    let h = 6.0_f64;
    let base = SurfaceShape { curvature: 1.0 / 40.0, ..SurfaceShape::PLANE };
    let with_even = |terms: &[(usize, f64)]| {
        let mut shape = base;
        for (j, a) in terms {
            shape.asphere[*j] = *a;
        }
        shape
    };
    // Q_con: v^2 (a_0 + a_1 (6 v - 5)).
    let mut q = [0.0; Q_TERMS];
    (q[0], q[1]) = (0.02, -0.01);
    let q_con = departing(base, Departure::Qcon { norm_radius_mm: h, coefficients: q });
    let as_q_con = with_even(&[(1, (0.02 + 0.05) / h.powi(4)), (2, -0.06 / h.powi(6))]);
    // XY: 0.03 v + 0.02 v^2.
    let mut xy = [0.0; XY_TERMS];
    for (i, j, value) in [(2, 0, 0.03), (0, 2, 0.03), (4, 0, 0.02), (2, 2, 0.04), (0, 4, 0.02)] {
        xy[xy_index(i, j)] = value;
    }
    let xy = departing(base, Departure::Xy { norm_radius_mm: h, coefficients: xy });
    let as_xy = with_even(&[(0, 0.03 / h.powi(2)), (1, 0.02 / h.powi(4))]);
    // Q_bfs about a plane: v (1 - v) a_0.
    let plane = SurfaceShape::PLANE;
    let mut q = [0.0; Q_TERMS];
    q[0] = 0.05;
    let q_bfs = SurfaceShape { departure: Departure::Qbfs { norm_radius_mm: h, coefficients: q }, ..plane };
    let mut as_q_bfs = plane;
    (as_q_bfs.asphere[0], as_q_bfs.asphere[1]) = (0.05 / h.powi(2), -0.05 / h.powi(4));
    // A biconic with two equal sections is a conic.
    let conic = SurfaceShape { conic: 0.4, ..base };
    let biconic =
        SurfaceShape { departure: Departure::Biconic { curvature_x: base.curvature, conic_x: 0.4 }, ..conic };
    // A toroid turned about the centre of its circle is a sphere.
    let toroid = departing(base, Departure::Toroid { curvature_x: base.curvature });
    for (name, a, b) in [
        ("Q_con", q_con, as_q_con),
        ("XY", xy, as_xy),
        ("Q_bfs", q_bfs, as_q_bfs),
        ("biconic", biconic, conic),
        ("toroid", toroid, base),
    ] {
        let [a, b] = [a, b]
            .map(|shape| one(Surface { shape, glass: glass(), thickness_mm: 50.0, ..Surface::default() }));
        let orders = [&a, &b].map(|l| first_order(&reference(l)));
        assert!((orders[0].efl_mm - orders[1].efl_mm).abs() < 1e-9 * orders[1].efl_mm.abs(), "{name}");
        let sums = [&a, &b].map(|l| seidel_total(&reference(l), 0.1).unwrap().s);
        for (s, t) in sums[0].iter().zip(sums[1]) {
            assert!((s - t).abs() < 1e-13, "{name} {sums:?}");
        }
        for (x, y) in [(0.0, 0.0), (2.0, -3.0), (-4.0, 3.5)] {
            let d = [0.05, 0.1, (1.0_f64 - 0.0125).sqrt()];
            let [p, q] = [&a, &b].map(|l| at(l, x, y, d).image.unwrap());
            for axis in 0..3 {
                assert!((p.position[axis] - q.position[axis]).abs() < 1e-11, "{name}");
                assert!((p.direction[axis] - q.direction[axis]).abs() < 1e-12, "{name}");
            }
        }
    }
}

/// Rays that cross the vertex plane beyond the reach of a strongly curved front surface meet it all the same.
#[test]
fn a_dome_with_a_departure_is_met_from_the_side() {
    let dome = |departure| {
        one(Surface {
            shape: SurfaceShape { curvature: 0.1, departure, ..SurfaceShape::PLANE },
            semi_diameter_mm: 9.5,
            glass: glass(),
            thickness_mm: 20.0,
            ..Surface::default()
        })
    };
    let plain = dome(Departure::None);
    for departing in [
        dome(Departure::Qcon { norm_radius_mm: 9.5, coefficients: [0.0; Q_TERMS] }),
        dome(Departure::Xy { norm_radius_mm: 9.5, coefficients: [0.0; XY_TERMS] }),
        dome(Departure::Odd([0.0; 8])),
    ] {
        for degrees in [30.0, 50.0, 60.0_f64] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            // Aimed at points of the dome, from the vertex plane.
            for height in [-6.0, 0.0, 4.0_f64] {
                let sag = 10.0 - (100.0 - height * height).sqrt();
                let y = height - sag * sin / cos;
                let [a, b] = [&plain, &departing].map(|l| at(l, 0.0, y, [0.0, sin, cos]).passages[0].point);
                assert!(
                    (a[1] - b[1]).abs() < 1e-11 && (a[1] - height).abs() < 1e-11,
                    "{degrees}: {a:?} {b:?}"
                );
                let mut bundle = RayBundle::new(1);
                bundle.set(0, Ray { position: [0.0, y, 0.0], direction: [0.0, sin, cos] });
                trace(&reference(&departing), &mut bundle);
                assert!(bundle.fate(0).reaches_image(), "{degrees} {height}: {:?}", bundle.fate(0));
            }
        }
    }
}

#[test]
fn lenses_that_cross_or_end_to_the_side_are_refused() {
    let plate = |departure, semi_diameter_mm: f64| {
        let shape = SurfaceShape { departure, ..SurfaceShape::PLANE };
        lens(vec![
            Surface { glass: glass(), thickness_mm: 1.0, semi_diameter_mm, ..Surface::default() },
            Surface { shape, thickness_mm: 50.0, semi_diameter_mm, ..Surface::default() },
        ])
    };
    assert!(validate(&plate(Departure::None, 10.0)).is_ok());
    let thin = validate(&plate(Departure::Toroid { curvature_x: -0.05 }, 10.0)).unwrap_err();
    assert!(matches!(thin, LensDefect::EdgeThickness { surface: 1, .. }), "{thin}");
    let ended = validate(&plate(Departure::Toroid { curvature_x: 0.25 }, 6.0)).unwrap_err();
    assert!(
        matches!(ended, LensDefect::SurfaceEnds { reach_mm, .. } if (reach_mm - 4.0).abs() < 1e-6),
        "{ended}"
    );
    let mut tilted = [0.0; XY_TERMS];
    tilted[xy_index(0, 1)] = 3.0;
    let crossing =
        validate(&plate(Departure::Xy { norm_radius_mm: 10.0, coefficients: tilted }, 10.0)).unwrap_err();
    assert!(matches!(crossing, LensDefect::EdgeThickness { .. }), "{crossing}");
}

#[test]
fn an_axicon_bends_every_ray_by_the_same_angle() {
    // b_1 r: a cone of slope 0.1.
    let mut b = [0.0; 8];
    b[0] = 0.1;
    let lens = one(Surface {
        shape: SurfaceShape { departure: Departure::Odd(b), ..SurfaceShape::PLANE },
        glass: glass(),
        thickness_mm: 50.0,
        ..Surface::default()
    });
    // Refracted at a plane tilted by atan(0.1).
    let tilt = 0.1_f64.atan();
    let expected = (tilt - (tilt.sin() / GLASS).asin()).sin();
    for (x, y) in [(0.0, 2.0), (3.0, 4.0), (-5.0, 1.0)] {
        let [l, m, _] = at(&lens, x, y, AXIS).passages[0].direction_after;
        assert!((l.hypot(m) - expected).abs() < 1e-12);
        assert!((l * x + m * y) < 0.0, "towards the axis");
    }
}

#[test]
fn a_tilted_plate_shifts_the_beam() {
    let (t, angle) = (5.0, 20.0_f64.to_radians());
    let placed =
        |axis, sign: f64| Some(Placement { decenter_mm: [0.0; 2], tilt_rad: [sign * angle, 0.0, 0.0], axis });
    // The front turns the axis, the rear is straight on it, and a dummy surface turns it back.
    let plate = lens(vec![
        Surface {
            glass: glass(),
            thickness_mm: t,
            placement: placed(Axis::Follows, 1.0),
            semi_diameter_mm: 50.0,
            ..Surface::default()
        },
        Surface { semi_diameter_mm: 50.0, ..Surface::default() },
        Surface {
            thickness_mm: 30.0,
            placement: placed(Axis::Follows, -1.0),
            semi_diameter_mm: 50.0,
            ..Surface::default()
        },
    ]);
    let image = at(&plate, 0.0, 0.0, AXIS).image.unwrap();
    // The beam leaves parallel to itself; by Snell it is shifted across by t sin(i - r) / cos r.
    let r = (angle.sin() / GLASS).asin();
    let shift = t * (angle - r).sin() / r.cos();
    // The origin of the last frame lies t along the normal of the plate, which a positive turn points towards -y.
    let origin_y = -t * angle.sin();
    assert!((image.direction[2] - 1.0).abs() < 1e-14);
    assert!((image.position[1] + origin_y + shift).abs() < 1e-12, "{} {origin_y} {shift}", image.position[1]);
}

#[test]
fn a_bent_axis_is_that_of_the_reflected_ray() {
    for tilt_deg in [[45.0, 0.0, 0.0], [30.0, -20.0, 0.0], [-10.0, 40.0, 33.0_f64]] {
        let folded = lens(vec![
            Surface {
                action: Action::Reflect,
                thickness_mm: -20.0,
                placement: Some(Placement {
                    decenter_mm: [0.0; 2],
                    tilt_rad: tilt_deg.map(f64::to_radians),
                    axis: Axis::Bends,
                }),
                semi_diameter_mm: 50.0,
                ..Surface::default()
            },
            Surface { thickness_mm: -10.0, semi_diameter_mm: 50.0, ..Surface::default() },
        ]);
        // The axis stays the axis, and every ray is where the straight mirror has it.
        let mut straight = folded.clone();
        straight.surfaces[0].placement = None;
        let image = at(&folded, 0.0, 0.0, AXIS).image.unwrap();
        for axis in 0..2 {
            assert!(
                image.position[axis].abs() < 1e-12 && image.direction[axis].abs() < 1e-14,
                "{tilt_deg:?}"
            );
        }
        let path = at(&folded, 2.0, -1.5, AXIS);
        assert!((path.optical_path_mm - 30.0).abs() < 1e-10, "{}", path.optical_path_mm);
        for (x, y, l, m) in [(2.0, -1.5, 0.0, 0.0), (1.0, 3.0, 0.1, -0.05), (-2.0, 0.5, 0.02, 0.2)] {
            let d = [l, m, (1.0_f64 - l * l - m * m).sqrt()];
            let [a, b] = [&folded, &straight].map(|lens| at(lens, x, y, d).image.unwrap());
            for axis in 0..3 {
                assert!((a.position[axis] - b.position[axis]).abs() < 1e-11, "{tilt_deg:?} {a:?} {b:?}");
                assert!((a.direction[axis] - b.direction[axis]).abs() < 1e-13, "{tilt_deg:?}");
            }
        }
    }
}

#[test]
fn a_decentred_surface_has_its_position() {
    // A paraboloid decentred by (1, 2) focuses parallel light at (1, 2) of the axis that returns.
    let mut mirror = one(Surface {
        shape: SurfaceShape { curvature: -1.0 / 200.0, conic: -1.0, ..SurfaceShape::PLANE },
        thickness_mm: -100.0,
        action: Action::Reflect,
        placement: Some(Placement { decenter_mm: [1.0, 2.0], ..Placement::default() }),
        ..Surface::default()
    });
    let [x, y, _] = at(&mirror, 10.0, -5.0, AXIS).image.unwrap().position;
    assert!((x - 1.0).abs() < 1e-12 && (y - 2.0).abs() < 1e-12);
    // And in the middle of the axis that follows.
    mirror.surfaces[0].placement.as_mut().unwrap().axis = Axis::Follows;
    let [x, y, _] = at(&mirror, 10.0, -5.0, AXIS).image.unwrap().position;
    assert!(x.abs() < 1e-12 && y.abs() < 1e-12);
}

#[test]
fn a_stop_may_stand_at_the_rim_of_a_surface_behind_its_vertex() {
    let convex = |thickness_mm: f64| Surface {
        shape: SurfaceShape { curvature: 0.05, ..SurfaceShape::PLANE },
        thickness_mm,
        semi_diameter_mm: 4.0,
        glass: glass(),
        ..Surface::default()
    };
    let plane = |thickness_mm: f64| Surface { thickness_mm, semi_diameter_mm: 4.0, ..Surface::default() };
    let singlet = lens(vec![convex(3.0), plane(30.0)]);
    let at_rim = |rim_mm: f64| lens(vec![plane(-rim_mm), convex(3.0), plane(30.0)]);
    assert_eq!(validate(&at_rim(0.3)), Ok(()));
    // The chief ray goes through the middle of the plane at the rim; continued to the vertex it is the same ray.
    let field = 0.2_f64;
    let behind = at(&singlet, 0.0, -0.3 * field.tan(), [0.0, field.sin(), field.cos()]);
    let chief = chief_ray(&reference(&at_rim(0.3)), field).unwrap();
    assert!((chief.y_mm - behind.image.unwrap().position[1]).abs() < 1e-9, "{}", chief.y_mm);
    // What lies beside the stop is still looked at: edges behind it, and the distance between its neighbours.
    let thin = lens(vec![plane(-0.3), convex(0.2), plane(30.0)]);
    assert!(matches!(validate(&thin), Err(LensDefect::EdgeThickness { surface: 2, .. })));
    let between = |after_mm: f64| {
        let stop = Surface { thickness_mm: after_mm, ..plane(0.0) };
        Lens { stop: 2, ..lens(vec![convex(3.0), plane(1.0), stop, convex(3.0), plane(30.0)]) }
    };
    assert_eq!(validate(&between(-0.9)), Ok(()));
    assert!(matches!(validate(&between(-1.1)), Err(LensDefect::CentreThickness { surface: 2, .. })));
    // Any other plane without effect may stand there as well.
    let other = Lens { stop: 1, ..at_rim(0.3) };
    assert_eq!(validate(&other), Ok(()));
}
