//! The cone of light at the image, first-order figures that lie at infinity, folded axes, and planes that do nothing: against formulas.

mod common;

use std::sync::Arc;

use common::paraboloid;
use petzval_optics::analysis::{
    AnalysisOptions, Cone, analyze, encircled_energy, field_curves, field_mtf, first_order_table,
    leaves_parallel, paraxial_image_mm, wavefront,
};
use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::lens::{
    Action, Axis, Departure, Lens, LensDefect, ObjectDistance, Pattern, Phase, Placement, Surface,
    SurfaceShape, validate,
};
use petzval_optics::paraxial::first_order;

/// A lens for far light, its stop first.
fn lens(entrance_pupil_mm: f64, surfaces: Vec<Surface>) -> Lens {
    Lens {
        name: String::new(),
        source: String::new(),
        surfaces,
        stop: 0,
        entrance_pupil_mm,
        object: ObjectDistance::Infinity,
        wavelengths_um: vec![0.5],
        reference_um: 0.5,
        fields_deg: vec![0.0, 1.0],
    }
}

fn plane(thickness_mm: f64, semi_diameter_mm: f64) -> Surface {
    Surface { thickness_mm, semi_diameter_mm, ..Surface::default() }
}

fn thin(focal_length_mm: f64, thickness_mm: f64) -> Surface {
    let action = Action::ThinLens { power_per_mm: 1.0 / focal_length_mm };
    Surface { action, ..plane(thickness_mm, 12.0) }
}

fn medium(n: f64) -> Arc<Glass> {
    Arc::new(Glass::new("medium", Dispersion::Constant(n)))
}

#[test]
fn the_cone_of_a_paraboloid_has_the_sine_of_its_marginal_ray() {
    for f_number in [0.5, 1.0, 2.0, 8.0] {
        let lens = Lens { wavelengths_um: vec![0.5], reference_um: 0.5, ..paraboloid(f_number) };
        // The ray at height h meets the axis in the focus f at the angle U with tan(U / 2) = h / 2 f.
        let na = (2.0 * (0.25 / f_number).atan()).sin();
        let table = first_order_table(&lens);
        assert!(
            table.is_image_na_real && (table.image_na / na - 1.0).abs() < 1e-9,
            "{} {na}",
            table.image_na
        );
        assert!((table.working_f_number.unwrap() * 2.0 * na - 1.0).abs() < 1e-9);
        assert!((table.airy_radius_um.unwrap() * na / (0.609_835 * 0.5) - 1.0).abs() < 1e-9);
        assert!((table.cutoff_per_mm / (2.0 * na / 0.5e-3) - 1.0).abs() < 1e-9);
        assert!((table.f_number.unwrap() - f_number).abs() < 1e-9);
    }
    // Eight fifteenths of the reciprocal: 8 / 17 at f/1.
    let na = Cone::of(&paraboloid(1.0)).na;
    assert!((na - 8.0 / 17.0).abs() < 1e-12, "{na}");
}

#[test]
fn a_lens_with_a_tiny_pupil_has_its_image() {
    for pupil_mm in [10.0, 1e-4, 1e-6] {
        let lens = lens(pupil_mm, vec![plane(5.0, 12.0), thin(50.0, 50.0)]);
        assert_eq!(leaves_parallel(&lens), [false; 2], "{pupil_mm}");
        assert!((paraxial_image_mm(&lens).unwrap() - 50.0).abs() < 1e-9, "{pupil_mm}");
        let cone = Cone::of(&lens);
        assert!((cone.working_f_number() * pupil_mm / 50.0 - 1.0).abs() < 0.01, "{pupil_mm}: {cone:?}");
    }
    // A long telescope, whose lenses are 0.1 um too far from each other.
    let telescope = lens(1000.0, vec![thin(10_000.0, 10_025.000_1), thin(25.0, 50.0)]);
    assert_eq!((leaves_parallel(&telescope), paraxial_image_mm(&telescope)), ([true; 2], None));
}

#[test]
fn the_mtf_of_a_fast_mirror_ends_at_the_cutoff_of_its_real_cone() {
    let lens =
        Lens { wavelengths_um: vec![0.5], reference_um: 0.5, fields_deg: vec![0.0], ..paraboloid(1.2) };
    let cutoff = first_order_table(&lens).cutoff_per_mm;
    let options = petzval_optics::analysis::AnalysisOptions {
        max_frequency_per_mm: Some(1.2 * cutoff),
        frequency_points: 241,
        ..Default::default()
    };
    let mtf = field_mtf(&lens, 0.0, &options).unwrap();
    let waves = mtf.diffraction.unwrap();
    let seen = mtf.frequency_per_mm.iter().zip(&waves.sagittal).rfind(|(_, m)| **m > 2e-3);
    let last = seen.unwrap().0;
    assert!((last / cutoff - 1.0).abs() < 0.03, "{last} {cutoff}");
}

#[test]
fn in_a_medium_the_cone_is_wider_by_its_index() {
    // An ellipsoid with the conic constant -1 / n^2 focuses parallel light sharply in glass of index n, at n R / (n - 1).
    let (n, radius, height): (f64, f64, f64) = (1.7, 30.0, 12.0);
    let k = -1.0 / (n * n);
    let focus = n * radius / (n - 1.0);
    let shape = SurfaceShape { curvature: 1.0 / radius, conic: k, ..SurfaceShape::PLANE };
    let into = Surface { shape, glass: medium(n), ..plane(focus, 13.0) };
    let sag = height * height / radius / (1.0 + (1.0 - (1.0 + k) * (height / radius).powi(2)).sqrt());
    let sine = height / height.hypot(focus - sag);
    let cone = Cone::of(&lens(2.0 * height, vec![into.clone()]));
    assert!((cone.na / (n * sine) - 1.0).abs() < 1e-9, "{} {}", cone.na, n * sine);
    // A sphere about the focus lets the light into water without bending it.
    let out = 10.0;
    let sphere = SurfaceShape { curvature: 1.0 / out, ..SurfaceShape::PLANE };
    let water = Surface { shape: sphere, glass: medium(1.33), ..plane(out, 3.0) };
    let both = lens(2.0 * height, vec![Surface { thickness_mm: focus - out, ..into }, water]);
    assert!((Cone::of(&both).na / (1.33 * sine) - 1.0).abs() < 1e-9);
}

#[test]
fn a_beam_that_is_not_round_has_the_cone_of_its_area() {
    // A stop turned by 60 degrees lets through an ellipse of half the area.
    let mut tilted = lens(10.0, vec![plane(30.0, 5.0), thin(1000.0, 1000.0)]);
    let round = Cone::of(&tilted).na;
    let turn = 60_f64.to_radians();
    tilted.surfaces[0].placement = Some(Placement { tilt_rad: [turn, 0.0, 0.0], ..Placement::default() });
    let found = Cone::of(&tilted).na;
    assert!((found / round - 0.5_f64.sqrt()).abs() < 1e-4, "{found} {round}");
}

/// The paraxial ray of the y-z section sees neither a cylinder with its power in x nor the slope of an axicon.
#[test]
fn light_leaves_parallel_where_real_rays_of_both_sections_do() {
    let shaped = |departure: Departure| {
        let shape = SurfaceShape { departure, ..SurfaceShape::PLANE };
        lens(10.0, vec![Surface { shape, glass: medium(1.5), ..plane(3.0, 6.0) }, plane(50.0, 8.0)])
    };
    let mut terms = [0.0; 8];
    terms[0] = 0.1;
    let axicon = shaped(Departure::Odd(terms));
    for (lens, parallel) in [
        (&shaped(Departure::None), [true; 2]),
        (&lens(20.0, vec![thin(73.3, 93.0), thin(19.7, 48.0)]), [true; 2]),
        (&shaped(Departure::Toroid { curvature_x: 0.02 }), [false, true]),
        (&axicon, [false; 2]),
        (&lens(20.0, vec![thin(100.0, 90.0)]), [false; 2]),
    ] {
        assert_eq!(leaves_parallel(lens), parallel);
    }
    // Every ray leaves the axicon at one angle: Snell's law at the cone, then at the plane.
    let slope = 0.1_f64.atan();
    let na = 1.5 * (slope - (slope.sin() / 1.5).asin()).sin();
    let found = Cone::of(&axicon);
    assert!(found.is_real && (found.na / na - 1.0).abs() < 1e-9, "{} {na}", found.na);
}

#[test]
fn an_afocal_telescope_has_no_focal_length_and_an_angular_magnification() {
    // Kepler: 200 and 40 mm. Galilei: 200 and -40 mm. Focal lengths that are no round numbers leave rounding.
    for (a, b) in [(200.0, 40.0), (200.0, -40.0), (73.3, 19.7), (100.0 / 3.0, -7.1)] {
        let telescope = lens(20.0, vec![thin(a, a + b), thin(b, 48.0)]);
        let table = first_order_table(&telescope);
        let order = first_order(&telescope.at_wavelength(0.5));
        assert!(!order.efl_mm.is_finite() && order.f_number.is_infinite());
        let none = [table.efl_mm, table.bfl_mm, table.f_number, table.defocus_mm, table.working_f_number];
        assert!(none.iter().all(Option::is_none), "{none:?}");
        assert_eq!((table.image_na, table.cutoff_per_mm), (0.0, 0.0));
        assert!((table.angular_magnification.unwrap() + a / b).abs() < 1e-9 * (a / b).abs());
        // The exit pupil is the image of the first lens: its diameter is that of the entrance pupil over the magnification.
        assert!((table.exit_pupil_mm.unwrap() - 20.0 * (b / a).abs()).abs() < 1e-9);
        let at = 1.0 / (1.0 / b - 1.0 / (a + b));
        assert!((table.exit_pupil_at_mm.unwrap() / at - 1.0).abs() < 1e-9);
    }
    // A telescope that is out of adjustment has a focal length: 1 / f = 1 / a + 1 / b - d / a b.
    let loose = lens(20.0, vec![thin(200.0, 240.001), thin(40.0, 48.0)]);
    let efl = first_order_table(&loose).efl_mm.unwrap();
    assert!((efl / (-200.0 * 40.0 / 0.001) - 1.0).abs() < 1e-6, "{efl}");
    // Off by the last digits of a file, it is a telescope.
    let of_digits = first_order_table(&lens(20.0, vec![thin(200.0, 240.000_000_1), thin(40.0, 48.0)]));
    assert!((of_digits.angular_magnification.unwrap() + 5.0).abs() < 1e-6 && of_digits.efl_mm.is_some());
}

#[test]
fn the_line_of_a_cylinder_is_within_the_radii_of_its_energy() {
    let shape = SurfaceShape { departure: Departure::Toroid { curvature_x: 0.02 }, ..SurfaceShape::PLANE };
    let cylinder =
        lens(10.0, vec![Surface { shape, glass: medium(1.5), ..plane(3.0, 6.0) }, plane(98.0, 8.0)]);
    let energy = encircled_energy(&cylinder, 0.0, &AnalysisOptions::default()).unwrap();
    // A line of the pupil's 10 mm.
    let last = energy.radius_um.last().unwrap();
    assert!(last.is_finite() && *last > 4900.0 && *last < 10_000.0, "{last}");
    assert!((energy.geometric.last().unwrap() - 1.0).abs() < 1e-9);
}

/// Rounding of a distance moves an object at the front focus by nanometres: from f/100000 on, light counts as parallel.
#[test]
fn light_that_leaves_nearly_parallel_counts_as_parallel() {
    for (off_mm, is_parallel) in [(1e-5, true), (1e-3, true), (-1e-3, true), (1.0, false), (-1.0, false)] {
        let mut collimator = lens(10.0, vec![thin(100.0, 50.0)]);
        collimator.object = ObjectDistance::Finite(100.0 + off_mm);
        let telescope = lens(10.0, vec![thin(200.0, 240.0 + 0.1 * off_mm), thin(40.0, 48.0)]);
        for lens in [&collimator, &telescope] {
            assert_eq!(paraxial_image_mm(lens).is_none(), is_parallel, "{off_mm}");
            assert_eq!(leaves_parallel(lens), [is_parallel; 2], "{off_mm}");
            let table = first_order_table(lens);
            assert_eq!([table.defocus_mm.is_none(), table.working_f_number.is_none()], [is_parallel; 2]);
            assert!(table.efl_mm.is_some());
        }
        assert_eq!(first_order_table(&collimator).magnification.is_none(), is_parallel, "{off_mm}");
    }
}

#[test]
fn an_image_at_infinity_or_on_the_last_vertex_is_exactly_there() {
    for f in [100.0, 33.7, 1.0 / 3.0] {
        let mut collimator = lens(0.1 * f, vec![thin(f, 0.5 * f)]);
        collimator.object = ObjectDistance::Finite(f);
        let table = first_order_table(&collimator);
        assert!((table.efl_mm.unwrap() - f).abs() < 1e-12 * f);
        assert_eq!((table.defocus_mm, table.magnification, table.image_na), (None, None, 0.0));
    }
    // A field lens in the focus of a lens: light ends on its vertex, not in front of it and not behind.
    for (f, g) in [(70.1, 31.3), (100.0 / 3.0, 7.7), (19.9, -5.3)] {
        let order = first_order(&lens(1.0, vec![thin(f, f), thin(g, 1.0)]).at_wavelength(0.5));
        assert_eq!((order.bfl_mm, order.image_distance_mm), (0.0, 0.0), "{f} {g}");
        assert!(order.bfl_mm.is_sign_positive());
    }
    // A stop in the front focus sends chief rays out parallel.
    let telecentric = lens(4.0, vec![plane(70.1, 2.0), thin(70.1, 70.1)]);
    let table = first_order_table(&telecentric);
    assert_eq!((table.exit_pupil_at_mm, table.exit_pupil_mm), (None, None));
    assert!((table.working_f_number.unwrap() - 0.5 / (2.0 / 70.1_f64).atan().sin()).abs() < 1e-9);
}

#[test]
fn an_f_number_has_no_sign() {
    // A relay turns the image over: the focal length is negative, 1 / f = 1 / a + 1 / b - d / a b.
    let relay = lens(5.0, vec![thin(50.0, 150.0), thin(40.0, 66.666_666_666_666_67)]);
    let table = first_order_table(&relay);
    let efl = 1.0 / (1.0 / 50.0 + 1.0 / 40.0 - 150.0 / 2000.0);
    assert!((table.efl_mm.unwrap() - efl).abs() < 1e-9 && efl < 0.0);
    assert!((table.f_number.unwrap() - 1.0 / 5.0 * efl.abs()).abs() < 1e-9);
}

#[test]
fn rms_wavefronts_include_the_rim_of_the_pupil() {
    // A paraboloid with the term a r^p on it has the wavefront 2 a r^p, of W waves at the rim: over the disk its RMS about the mean is
    // W p / ((p + 2) sqrt(p + 1)). To the square of the slope of the marginal ray, 8e-5 here.
    for p in [2_usize, 4, 8, 16] {
        let mut lens =
            Lens { wavelengths_um: vec![0.5], reference_um: 0.5, fields_deg: vec![0.0], ..paraboloid(40.0) };
        let waves = 0.05;
        let height = 0.5 * lens.entrance_pupil_mm;
        lens.surfaces[0].shape.asphere[p / 2 - 1] = 0.5 * waves * 0.5e-3 / height.powi(p as i32);
        let power = p as f64;
        let wanted = waves * power / ((power + 2.0) * (power + 1.0).sqrt());
        let found = wavefront(&lens, 0.0).unwrap();
        assert!((found.rms_waves[0] / wanted - 1.0).abs() < 5e-4, "r^{p}: {} {wanted}", found.rms_waves[0]);
        assert!((found.rms_centroid_waves[0] / wanted - 1.0).abs() < 5e-4);
    }
}

/// A singlet whose light goes `after_mm` further, by way of a fold mirror or straight on.
fn camera(is_folded: bool) -> Lens {
    let glass = |radius: f64, thickness_mm, n: f64| Surface {
        shape: SurfaceShape { curvature: 1.0 / radius, ..SurfaceShape::PLANE },
        glass: if n == 1.0 { Glass::air() } else { medium(n) },
        ..plane(thickness_mm, 12.0)
    };
    let mut surfaces = vec![plane(20.0, 5.0), glass(-200.0, 6.0, 1.78), glass(-60.0, 106.0, 1.0)];
    if is_folded {
        surfaces[2].thickness_mm = 60.0;
        let tilt_rad = [45_f64.to_radians(), 0.0, 0.0];
        let placement = Some(Placement { tilt_rad, axis: Axis::Bends, ..Placement::default() });
        surfaces.push(Surface { action: Action::Reflect, placement, ..plane(-46.0, 25.0) });
    }
    lens(10.0, surfaces)
}

#[test]
fn the_track_is_the_greatest_distance_between_vertices_and_the_image() {
    let (straight, folded) = (camera(false), camera(true));
    assert!(folded.is_folded() && !straight.is_folded());
    // From the stop to the mirror 86 mm, and from there 46 mm across.
    let wanted_mm = 86_f64.hypot(46.0);
    assert_eq!(straight.track_mm(), 132.0);
    for found_mm in [folded.track_mm(), first_order_table(&folded).total_track_mm] {
        assert!((found_mm - wanted_mm).abs() < 1e-12, "{found_mm}");
    }
    let [a, b] = [&straight, &folded].map(first_order_table);
    assert!(
        (a.image_na - b.image_na).abs() < 1e-12 && (a.efl_mm.unwrap() - b.efl_mm.unwrap().abs()).abs() < 1e-9
    );
    // A telescope of two mirrors on one axis is as long as from its entrance to its image.
    let mirror = |thickness_mm| Surface { action: Action::Reflect, ..plane(thickness_mm, 12.0) };
    let cassegrain = lens(10.0, vec![plane(100.0, 12.0), mirror(-100.0), mirror(130.0)]);
    assert_eq!(first_order_table(&cassegrain).total_track_mm, 130.0);
    // A mirror alone is as long as from its image to its vertex, and with a stop in front of it as far as the stop.
    let newtonian = |stop_mm| lens(10.0, vec![plane(stop_mm, 12.0), mirror(-200.0)]);
    assert_eq!([0.0, 150.0, 300.0].map(|mm| newtonian(mm).track_mm()), [200.0, 200.0, 300.0]);
}

#[test]
fn planes_that_do_nothing_cross_no_surface() {
    // A stop at the vertex of a concave mirror, and dummies at the vertex of a concave lens and behind its rim.
    let mirror = Surface {
        action: Action::Reflect,
        shape: SurfaceShape { curvature: -1.0 / 400.0, conic: -1.0, ..SurfaceShape::PLANE },
        ..plane(-200.0, 26.0)
    };
    let telescope = lens(50.0, vec![plane(0.0, 25.0), mirror]);
    assert_eq!(validate(&telescope), Ok(()));
    let table = first_order_table(&telescope);
    assert!((table.efl_mm.unwrap() - 200.0).abs() < 1e-9);
    let waves = wavefront(&telescope, 0.0).unwrap();
    assert!(waves.rms_waves[0] < 1e-6, "{:?}", waves.rms_waves);

    let concave = |before: f64, after: f64| {
        let curved = |radius: f64, glass, thickness_mm| Surface {
            shape: SurfaceShape { curvature: 1.0 / radius, ..SurfaceShape::PLANE },
            glass,
            ..plane(thickness_mm, 9.0)
        };
        let dummy =
            |glass: &Arc<Glass>, thickness_mm| Surface { glass: glass.clone(), ..plane(thickness_mm, 9.0) };
        let (air, glass) = (Glass::air(), medium(1.5));
        let mut surfaces = vec![dummy(&air, before), curved(-30.0, glass.clone(), 1.5), dummy(&glass, 0.5)];
        surfaces.extend([
            curved(25.0, air.clone(), after),
            dummy(&air, 10.0 - after),
            curved(60.0, glass, 3.0),
        ]);
        surfaces.push(curved(-60.0, air, 50.0));
        lens(4.0, surfaces)
    };
    for (before, after) in [(0.0, 0.0), (0.0, 3.0), (-2.0, -4.0), (2.0, 14.0)] {
        assert_eq!(validate(&concave(before, after)), Ok(()), "{before} {after}");
    }
    // The lens is as it is without the dummies: glass thinner than nothing is found across them.
    let mut thin_glass = concave(0.0, 3.0);
    thin_glass.surfaces[2].thickness_mm = -1.6;
    assert!(matches!(validate(&thin_glass), Err(LensDefect::CentreThickness { surface: 2, .. })));
    let mut crossing = concave(0.0, 3.0);
    crossing.surfaces[4].thickness_mm = -2.9;
    assert!(
        matches!(validate(&crossing), Err(LensDefect::AirGap { surface: 4, next: 6, .. })),
        "{:?}",
        validate(&crossing)
    );
}

/// A biconvex singlet of index 1.5 in OpticStudio's coordinates: stop at its front vertex, radii of 20 mm, 2 mm of aperture.
fn singlet(field_deg: f64) -> Lens {
    let curved = |radius: f64, thickness_mm, glass| Surface {
        shape: SurfaceShape { curvature: 1.0 / radius, ..SurfaceShape::PLANE },
        glass,
        ..plane(thickness_mm, 4.0)
    };
    let surfaces = vec![plane(0.0, 1.0), curved(20.0, 1.0, medium(1.5)), curved(-20.0, 19.792, Glass::air())];
    Lens {
        wavelengths_um: vec![0.543],
        reference_um: 0.543,
        fields_deg: vec![field_deg],
        ..lens(2.0, surfaces)
    }
}

/// Figures of OpticStudio 2025 (25.1.1), from the test data of ZOSPy (MIT licence, commit 894387c43c2d): system data, cardinal points, standard
/// Zernike coefficients of 64 terms on 128 x 128 rays.
#[test]
fn figures_of_a_singlet_are_those_of_opticstudio() {
    let table = first_order_table(&singlet(0.0));
    for (found, theirs, half) in [
        (table.efl_mm, 20.168067, 5e-7),
        (table.bfl_mm, 19.831933, 5e-7),
        (table.ffl_mm, -19.831933, 5e-7),
        (Some(table.total_track_mm), 20.792, 1e-12),
        (table.f_number, 10.08403, 5e-6),
        (table.working_f_number, 10.05939, 5e-6),
        (table.entrance_pupil_at_mm, 0.0, 1e-12),
        (table.exit_pupil_mm, 2.033898, 5e-7),
        // They count from the image plane.
        (table.exit_pupil_at_mm.map(|at| at - 19.792), -20.46997, 5e-6),
    ] {
        let found = found.unwrap();
        assert!((found - theirs).abs() <= half, "{found} {theirs}");
    }
    // On the axis, and at 10 and 20 degrees in x and y, which is one field in the plane of the two.
    let oblique = 10_f64.to_radians().tan().hypot(20_f64.to_radians().tan()).atan().to_degrees();
    // Off the axis OpticStudio's own two ways of integration differ by 1.2e-3; ours lies within 1e-4 of the one by coefficients.
    for (field, rms, centroid, peak_to_valley, share) in [
        (0.0, 0.00684787, 0.00684787, 0.02350575, 2e-5),
        (oblique, 2.59513577, 2.58361616, 11.43021185, 1e-4),
    ] {
        let found = wavefront(&singlet(field), field).unwrap();
        assert!((found.rms_waves[0] / rms - 1.0).abs() < share, "{} {rms}", found.rms_waves[0]);
        assert!(
            (found.rms_centroid_waves[0] / centroid - 1.0).abs() < share,
            "{}",
            found.rms_centroid_waves[0]
        );
        // Neither has a ray at the very ends.
        let beyond = found.peak_to_valley_waves[0] / peak_to_valley - 1.0;
        assert!(beyond.abs() < 0.01, "{} {peak_to_valley}", found.peak_to_valley_waves[0]);
    }
}

/// A grating in the stop, which turns light of -40 degrees into the axis of a perfect lens of 100 mm; light of the axis misses that lens.
fn spectrometer(fields_deg: Vec<f64>) -> Lens {
    let lines_per_mm = 40_f64.to_radians().sin() / 0.5e-3;
    let phase = Some(Phase { order: 1, pattern: Pattern::Grating { lines_per_mm } });
    let grating = Surface { phase, ..plane(20.0, 3.0) };
    Lens { fields_deg, ..lens(4.0, vec![grating, Surface { semi_diameter_mm: 6.0, ..thin(100.0, 100.0) }]) }
}

#[test]
fn a_field_stands_for_the_axis_where_no_field_is_near_it() {
    let reference = |fields_deg: &[f64]| spectrometer(fields_deg.to_vec()).reference_field_deg();
    assert_eq!(reference(&[-42.0, -40.0, -38.0]), -38.0);
    assert_eq!(reference(&[38.0, 42.0]), 38.0);
    for beside in [&[-42.0, 0.0][..], &[-42.0, 38.0], &[-42.0, -4.0], &[0.0], &[]] {
        assert_eq!(reference(beside), 0.0, "{beside:?}");
    }
    // A lens with rotational symmetry has an axis whatever its fields.
    let symmetric = lens(4.0, vec![thin(100.0, 100.0)]);
    assert_eq!(Lens { fields_deg: vec![10.0, 20.0], ..symmetric }.reference_field_deg(), 0.0);
}

#[test]
fn the_cone_of_a_spectrometer_is_that_of_its_own_beams() {
    let table = first_order_table(&spectrometer(vec![-42.0, -40.0]));
    // A round beam of 4 mm meets at 100 mm.
    let na = 2.0 / 2_f64.hypot(100.0);
    assert!(table.is_image_na_real && (table.image_na / na - 1.0).abs() < 1e-6, "{}", table.image_na);
    assert_eq!(table.image_na_field_deg, Some(-40.0));
    let with_axis = first_order_table(&spectrometer(vec![-42.0, 0.0]));
    assert_eq!(with_axis.image_na_field_deg, None);
    assert!(with_axis.image_na < 0.9 * na, "{}", with_axis.image_na);
}

#[test]
fn a_lens_whose_axis_is_dark_has_curves_over_its_own_fields() {
    let options = AnalysisOptions { field_points: 3, ..Default::default() };
    let curves = field_curves(&spectrometer(vec![-42.0, -40.0]), &options).unwrap();
    assert_eq!(curves.field_deg, [-40.0, -41.0, -42.0]);
    assert!((curves.relative_illumination[0][0] - 1.0).abs() < 1e-12);
    // h = 100 mm tan t with sin t = sin a + sin 40 degrees; near -40 degrees dh/da = 100 mm cos a, and by the tangent 100 mm cos^3 a.
    let (field, axis) = (-42_f64.to_radians(), -40_f64.to_radians());
    let height = 100.0 * (field.sin() - axis.sin()).asin().tan();
    let by_tangent = height / (field.tan() - axis.tan()) / (100.0 * axis.cos().powi(3)) - 1.0;
    let by_angle = height / (field - axis) / (100.0 * axis.cos()) - 1.0;
    for (found, wanted) in
        [(&curves.distortion_percent[0], by_tangent), (&curves.f_theta_distortion_percent[0], by_angle)]
    {
        assert!(found[0].abs() < 1e-6, "{found:?}");
        assert!((found[2] - 100.0 * wanted).abs() < 1e-3, "{found:?} {wanted}");
    }
    let one = field_curves(&spectrometer(vec![-40.0]), &options).unwrap();
    assert_eq!(one.field_deg, [-40.0; 3]);
    let whole = analyze(&spectrometer(vec![-42.0, -40.0]), &options, &|| Ok(())).unwrap();
    assert_eq!(whole.no_curves, None);
    // Rays of the reference field cross its chief ray in the image.
    let crossings = &whole.longitudinal_aberration.crossing_mm[0];
    assert!(crossings.iter().all(|mm| mm.unwrap().abs() < 1e-3), "{crossings:?}");
}
