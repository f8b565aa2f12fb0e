//! Wide-angle lenses, whose entrance pupil wanders: rays are aimed by continuation from the axis, up to and beyond 90
//! degrees.

use std::f64::consts::TAU;
use std::sync::Arc;

use petzval_optics::analysis::{AnalysisOptions, field_curves, layout, spot_diagram};
use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::{Lens, ObjectDistance, Surface, SurfaceShape, validate};
use petzval_optics::merit::{Merit, SpotResiduals};
use petzval_optics::number::Number;
use petzval_optics::paraxial::first_order;
use petzval_optics::psf::{PsfCotangent, PsfKind, PsfOptions, psf_traced_with_tape, psf_with_tape};
use petzval_optics::pupil::{Quadrature, aim_at_pupil, aim_one, chief_ray, paraxial_launch, trace_beam};
use petzval_optics::solve::with_paraxial_focus;
use petzval_optics::spot::{mean_square_spot, spot};
use petzval_optics::trace::{
    ACROSS_FROM_RAD, AimedRays, Fate, Ray, RayBundle, Reaim, Seeds, Sequence, WaveSeeds, aim_at_stop, launch,
    pull_back, push_change, starts_across, trace, trace_ray,
};
use petzval_optics::wave::{PupilPlane, opd};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A lens of spheres: radius (0 for a plane), thickness, index and clear semi-diameter of each surface; the stop is surface 6.
fn spheres(name: &str, rows: &[(f64, f64, f64, f64)], pupil_mm: f64, fields_deg: &[f64]) -> Lens {
    let glass = |n: f64| {
        let sellmeier = Dispersion::Sellmeier { b: vec![n * n - 1.0], c_um2: vec![0.01] };
        Arc::new(Glass::new(format!("n = {n}"), sellmeier))
    };
    let surface = |(radius, thickness_mm, n, semi_diameter_mm): &(f64, f64, f64, f64)| Surface {
        shape: SurfaceShape {
            curvature: if *radius == 0.0 { 0.0 } else { 1.0 / radius },
            ..SurfaceShape::PLANE
        },
        thickness_mm: *thickness_mm,
        glass: if *n == 1.0 { Glass::air() } else { glass(*n) },
        semi_diameter_mm: *semi_diameter_mm,
        ..Surface::default()
    };
    let lens = Lens {
        name: name.into(),
        source: String::new(),
        surfaces: rows.iter().map(surface).collect(),
        stop: 6,
        entrance_pupil_mm: pupil_mm,
        object: ObjectDistance::Infinity,
        wavelengths_um: vec![0.486, 0.588, 0.656],
        reference_um: 0.588,
        fields_deg: fields_deg.to_vec(),
    };
    with_paraxial_focus(&lens, 0.0)
}

/// A reversed telephoto lens of 8.4 mm: the paraxial guess aims all rays up to about 60 degrees.
fn reversed_telephoto() -> Lens {
    let rows = [
        (60.0, 2.0, 1.62, 22.0),
        (12.0, 9.0, 1.0, 11.7),
        (80.0, 1.5, 1.5, 11.5),
        (14.0, 6.0, 1.0, 11.0),
        (22.0, 5.0, 1.75, 9.0),
        (-50.0, 6.0, 1.0, 9.0),
        (0.0, 1.0, 1.0, 3.0),
        (40.0, 3.0, 1.6, 7.0),
        (-14.0, 18.0, 1.0, 7.0),
    ];
    spheres("reversed telephoto", &rows, 3.0, &[0.0, 30.0, 58.0])
}

/// A fisheye lens of 5.9 mm: two strong negative menisci in front, positive lenses at the stop.
fn fisheye() -> Lens {
    let rows = [
        (45.0, 2.0, 1.62, 34.0),
        (15.2, 14.0, 1.0, 15.15),
        (100.0, 1.5, 1.5, 14.5),
        (8.5, 7.0, 1.0, 8.48),
        (14.0, 5.0, 1.8, 9.0),
        (-60.0, 5.0, 1.0, 9.0),
        (0.0, 1.0, 1.0, 3.0),
        (30.0, 3.0, 1.6, 6.0),
        (-12.0, 12.0, 1.0, 6.0),
    ];
    spheres("fisheye", &rows, 1.5, &[0.0, 45.0, 90.0])
}

/// Both lenses, each with its largest field, degrees.
fn wide_angle_lenses() -> [(Lens, f64); 2] {
    [(reversed_telephoto(), 74.0), (fisheye(), 94.0)]
}

/// Points of the pupil: centre, half of the radius and rim.
fn pupil_points() -> Vec<[f64; 2]> {
    let ring = |r: f64| {
        (0..12).map(move |k| (TAU * f64::from(k) / 12.0).sin_cos()).map(move |(s, c)| [r * s, r * c])
    };
    std::iter::once([0.0; 2]).chain(ring(0.5)).chain(ring(1.0)).collect()
}

/// The ray of a field through a point of the stop, followed from the axis in steps of at most half a degree by the scalar
/// reference. Coordinates are those of the launch plane of the field.
fn followed(sequence: &Sequence, field_rad: f64, target_mm: [f64; 2]) -> Option<[f64; 2]> {
    let steps = (field_rad.to_degrees().abs() / 0.5).ceil().max(1.0) as usize;
    let mut across = [target_mm; 2];
    let mut launch_mm = target_mm;
    for k in 0..=steps {
        let field = field_rad * k as f64 / steps as f64;
        // Lengths across the direction are the same on both launch planes.
        let scale = if starts_across(sequence, field) { 1.0 } else { field.cos() };
        let [before, last] = across;
        let guess = [2.0 * last[0] - before[0], (2.0 * last[1] - before[1]) / scale];
        launch_mm = aim_at_stop(sequence, field, target_mm, guess)?.launch_mm;
        across = [if k == 0 { launch_mm } else { last }, [launch_mm[0], launch_mm[1] * scale]];
    }
    Some(launch_mm)
}

/// Point in the stop of a launched ray, by the scalar reference.
fn at_stop(sequence: &Sequence, field_rad: f64, launch_mm: [f64; 2]) -> [f64; 2] {
    let path = trace_ray(sequence, launch(sequence, field_rad, launch_mm).ray);
    let [x, y, _] = path.passages[sequence.stop].point;
    [x, y]
}

#[test]
fn the_lenses_are_possible_and_wide() {
    for (lens, far) in wide_angle_lenses() {
        validate(&lens).unwrap();
        let sequence = lens.at_wavelength(lens.reference_um);
        // The guess of first-order optics fails there.
        let order = first_order(&sequence);
        let field = far.to_radians();
        let points = pupil_points();
        let guesses: Vec<[f64; 2]> =
            points.iter().map(|p| paraxial_launch(&order, &sequence, field, *p)).collect();
        let targets: Vec<[f64; 2]> = points.iter().map(|p| p.map(|p| p * order.stop_radius_mm)).collect();
        let aimed = AimedRays::new(&sequence, field, &targets, &guesses);
        assert!((0..points.len()).all(|i| !aimed.is_aimed(i)), "{}", lens.name);
    }
}

/// Every ray of the pupil is aimed, at every field and wavelength, and it is the ray that is connected with the axis.
#[test]
fn every_ray_of_the_pupil_is_aimed_on_the_branch_of_the_axis() {
    for (lens, far) in wide_angle_lenses() {
        let stop_radius = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
        for wavelength in &lens.wavelengths_um {
            let sequence = lens.at_wavelength(*wavelength);
            for degrees in (0..).map(|k| 3.0 * f64::from(k)).take_while(|d| *d <= far).chain([-far, far]) {
                let field = degrees.to_radians();
                let points = pupil_points();
                let aimed = aim_at_pupil(&sequence, field, stop_radius, &points, None);
                for (i, p) in points.iter().enumerate() {
                    assert!(aimed.is_aimed(i), "{} {degrees} {p:?}", lens.name);
                    let (at, target) = (aimed.launch_of(i), p.map(|p| p * stop_radius));
                    let hit = at_stop(&sequence, field, at);
                    let miss = (hit[0] - target[0]).hypot(hit[1] - target[1]);
                    assert!(miss < 1e-9, "{} {degrees} {p:?}: {miss:e}", lens.name);
                    let expected = followed(&sequence, field, target).unwrap();
                    let off = (at[0] - expected[0]).hypot(at[1] - expected[1]);
                    assert!(off < 1e-8, "{} {degrees} {p:?}: {off:e}", lens.name);
                    assert!(trace_ray(&sequence, launch(&sequence, field, at).ray).fate.reaches_image());
                }
            }
        }
    }
}

/// Launch points of a beam that is far away are no harm, and rays that cannot pass are lost.
#[test]
fn bad_guesses_and_impossible_fields_do_no_harm() {
    for (lens, far) in wide_angle_lenses() {
        let sequence = lens.at_wavelength(lens.reference_um);
        let stop_radius = first_order(&sequence).stop_radius_mm;
        let points = pupil_points();
        for degrees in [20.0, 50.0, far] {
            let field = f64::to_radians(degrees);
            let right = aim_at_pupil(&sequence, field, stop_radius, &points, None);
            for guess in [[0.0, 0.0], [3.0, -5.0], [1.0, 40.0], [f64::NAN, 0.0]] {
                let near = vec![guess; points.len()];
                let found = aim_at_pupil(&sequence, field, stop_radius, &points, Some(&near));
                for i in 0..points.len() {
                    let [a, b] = [right.launch_of(i), found.launch_of(i)];
                    assert!(
                        found.is_aimed(i) && (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-8,
                        "{} {degrees}",
                        lens.name
                    );
                }
            }
        }
        let beyond = f64::to_radians(130.0);
        let lost = aim_at_pupil(&sequence, beyond, stop_radius, &points, None);
        assert!((0..points.len()).all(|i| !lost.is_aimed(i)));
        assert!(chief_ray(&sequence, beyond).is_none());
    }
}

#[test]
fn a_fisheye_is_analysed_beyond_90_degrees() {
    let lens = Lens { fields_deg: vec![0.0, 60.0, 80.0, 90.0, 92.0], ..fisheye() };
    let options = AnalysisOptions::default();
    let drawn = layout(&lens, &options);
    for rays in &drawn.rays {
        assert_eq!(rays.len(), options.layout_rays);
        assert!(rays.iter().all(|r| !r.is_lost && r.points.as_flattened().iter().all(|v| v.is_finite())));
    }
    // The last fan comes from behind the first vertex.
    let [start, met] = [0, 1].map(|i| drawn.rays[4][0].points[i]);
    assert!(start[0] > met[0] && start[1] < met[1], "{start:?} {met:?}");
    let curves = field_curves(&lens, &options).unwrap();
    assert!(curves.relative_illumination.iter().flatten().all(|v| *v > 0.0));
    assert!(spot_diagram(&lens, 92.0, &options).unwrap().rms_um > 0.0);
}

/// The kernel's tracing of steep rays is that of the scalar reference, with the launch derivatives of differences.
#[test]
fn steep_rays_trace_as_the_reference_does() {
    let lens = fisheye();
    let sequence = lens.at_wavelength(lens.reference_um);
    let stop_radius = first_order(&sequence).stop_radius_mm;
    for degrees in [75.0_f64, 90.0, 93.0] {
        let field = degrees.to_radians();
        let aimed = aim_at_pupil(&sequence, field, stop_radius, &pupil_points(), None);
        let mut bundle = aimed.bundle(&sequence);
        trace(&sequence, &mut bundle);
        for i in 0..bundle.len() {
            let at = aimed.launch_of(i);
            let path = trace_ray(&sequence, launch(&sequence, field, at).ray);
            let (image, fast) = (path.image.unwrap(), bundle.ray(i));
            for k in 0..3 {
                assert!((image.position[k] - fast.position[k]).abs() < 1e-10);
                assert!((image.direction[k] - fast.direction[k]).abs() < 1e-11);
            }
            assert!((path.optical_path_mm - bundle.optical_path_mm(i)).abs() < 1e-10);
            let by = aimed.stop_by_launch_of(i);
            for axis in 0..2 {
                let h = 1e-5;
                let moved = |steps: f64| {
                    let mut from = at;
                    from[axis] += steps * h;
                    at_stop(&sequence, field, from)
                };
                let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(moved);
                for row in 0..2 {
                    let numeric = (8.0 * (c[row] - b[row]) - (d[row] - a[row])) / (12.0 * h);
                    assert!((by[row][axis] - numeric).abs() < 1e-7, "{degrees} {i}: {by:?} {numeric}");
                }
            }
        }
    }
}

/// Relative illumination by rays that fall evenly on a plane across the direction: the share that passes the stop and the
/// clear apertures, by the law of a rectilinear image.
fn illumination_by_even_rays(lens: &Lens, wavelength_um: f64, field_rad: f64, stop_radius: f64) -> f64 {
    const SIDE: usize = 500;
    let sequence = lens.at_wavelength(wavelength_um);
    let (sin, cos) = field_rad.sin_cos();
    // A rectangle around the rays of the rim.
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in pupil_points() {
        let at = followed(&sequence, field_rad, p.map(|p| p * stop_radius)).unwrap();
        let scale = [1.0, if starts_across(&sequence, field_rad) { 1.0 } else { cos }];
        for axis in 0..2 {
            low[axis] = low[axis].min(at[axis] * scale[axis]);
            high[axis] = high[axis].max(at[axis] * scale[axis]);
        }
    }
    let margin = [0, 1].map(|axis| 0.15 * (high[axis] - low[axis]));
    let size = [0, 1].map(|axis| high[axis] - low[axis] + 2.0 * margin[axis]);
    let mut light = 0.0;
    for k in 0..SIDE * SIDE {
        let share = [k % SIDE, k / SIDE].map(|i| (i as f64 + 0.5) / SIDE as f64);
        let [s, t] = [0, 1].map(|axis| low[axis] - margin[axis] + share[axis] * size[axis]);
        let path = trace_ray(&sequence, Ray { position: [s, t * cos, -t * sin], direction: [0.0, sin, cos] });
        if let (Some(_), Some(p)) = (path.image, path.passages.get(sequence.stop))
            && p.point[0].hypot(p.point[1]) <= stop_radius
        {
            let is_inside = share.iter().all(|share| (0.02..0.98).contains(share));
            assert!(is_inside, "light at the edge of the rectangle");
            light += path.transmission;
        }
    }
    let radius = 0.5 * lens.entrance_pupil_mm;
    light / (SIDE * SIDE) as f64 * size[0] * size[1] / (std::f64::consts::PI * radius * radius) * cos.powi(3)
}

#[test]
fn illumination_is_that_of_even_rays_through_the_real_stop() {
    for (lens, _) in wide_angle_lenses() {
        let fields: &[f64] =
            if lens.name == "fisheye" { &[30.0, 59.0, 70.0, 86.0] } else { &[44.0, 58.0, 68.0] };
        // Also with a narrow front and a narrow lens behind the stop, which cut the beam.
        for cut in [false, true] {
            let mut lens = lens.clone();
            let stop_radius = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
            for degrees in fields {
                let field = degrees.to_radians();
                if cut {
                    let sequence = lens.at_wavelength(lens.reference_um);
                    let at = aim_one(&sequence, field, stop_radius, [0.0, -0.4]).unwrap();
                    let path = trace_ray(&sequence, launch(&sequence, field, at).ray);
                    let [x, y, _] = path.passages[4].point;
                    lens.surfaces[4].semi_diameter_mm = x.hypot(y);
                }
                let quadrature = Quadrature::grid(256).unwrap();
                for wavelength in [0.486, 0.656] {
                    let sequence = lens.at_wavelength(wavelength);
                    let beam = trace_beam(&sequence, field, stop_radius, &quadrature);
                    let expected = illumination_by_even_rays(&lens, wavelength, field, stop_radius);
                    let relative = beam.light() / expected - 1.0;
                    assert!(relative.abs() < 3e-3, "{} {degrees} {cut}: {relative:e}", lens.name);
                    // Apertures cut rays; aiming does not lose them.
                    assert!(beam.fate.iter().all(|fate| fate.reaches_image()), "{} {degrees}", lens.name);
                    let clipped = beam.fate.iter().any(|fate| matches!(fate, Fate::Clipped(4)));
                    assert_eq!(clipped, cut, "{} {degrees}", lens.name);
                }
            }
        }
    }
}

/// Both launch planes give the same beams: nothing jumps at the field from which the second is used.
#[test]
fn nothing_jumps_where_the_launch_plane_changes() {
    let quadrature = Quadrature::grid(32).unwrap();
    for (lens, _) in wide_angle_lenses() {
        let lens = Lens { entrance_pupil_mm: 0.1 * lens.entrance_pupil_mm, ..lens };
        let sequence = lens.at_wavelength(0.656);
        let stop_radius = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
        let sides = [-1e-10, 1e-10].map(|by| ACROSS_FROM_RAD + by);
        assert!(!starts_across(&sequence, sides[0]) && starts_across(&sequence, sides[1]));
        let [a, b] = sides.map(|f| chief_ray(&sequence, f).unwrap().y_mm);
        assert!((a - b).abs() < 1e-7, "{a} {b}");
        let [a, b] = sides.map(|f| trace_beam(&sequence, f, stop_radius, &quadrature).light());
        assert!((a / b - 1.0).abs() < 1e-8, "{a} {b}");
        let [a, b] =
            sides.map(|f| opd(&sequence, f, stop_radius, &pupil_points(), PupilPlane::Stop).unwrap().waves);
        for (a, b) in a.iter().zip(b) {
            assert!((a.unwrap() - b.unwrap()).abs() < 1e-4, "{a:?} {b:?}");
        }
        // Derivatives of the spot, and of a PSF by waves, whose optical paths begin at the launch plane.
        let options = PsfOptions { grid: 48, pitch_um: 4.0, kind: PsfKind::Diffraction };
        let of_wave = |f: f64| {
            let (psf, tape) = psf_with_tape(&lens, f, &[0.6], &quadrature, &options).unwrap();
            let bar =
                PsfCotangent { values: vec![weights(options.grid)], illumination: vec![0.3], chief_y: 0.0 };
            tape.gradient(&psf, &quadrature, &bar)
        };
        for [a, b] in [sides.map(|f| mean_square_spot(&lens, &[f]).unwrap().1), sides.map(of_wave)] {
            let scale = a.numbers().iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            for (a, b) in a.numbers().iter().zip(b.numbers()) {
                assert!((a - b).abs() < 1e-5 * scale, "{a:e} {b:e}");
            }
        }
    }
}

/// Compares a gradient with central differences by curvatures, conics and thicknesses.
fn check_gradient(
    lens: &Lens,
    tolerance: f64,
    value: impl Fn(&Lens) -> f64,
    gradient: &LensGradient,
    what: &str,
) {
    for i in 0..lens.surfaces.len() {
        for (number, step) in [(Number::Curvature, 2e-7), (Number::Conic, 2e-5), (Number::Thickness, 2e-5)] {
            if i == lens.stop && number != Number::Thickness {
                continue;
            }
            let at = |steps: f64| {
                let mut moved = lens.clone();
                number.write(&mut moved, i, number.read(lens, i) + steps * step);
                value(&moved)
            };
            let numeric = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step);
            let analytic = gradient[(i, number)];
            let rounding = 1e-12 * value(lens).abs() / step;
            assert!(
                (analytic - numeric).abs() < tolerance * analytic.abs().max(numeric.abs()) + 10.0 * rounding,
                "{} {what}: surface {i} {number:?}: {analytic:e} against {numeric:e}",
                lens.name
            );
        }
    }
}

#[test]
fn gradients_are_exact_at_wide_fields() {
    for (lens, degrees) in
        [(reversed_telephoto(), 57.0), (reversed_telephoto(), 67.0), (fisheye(), 85.0), (fisheye(), 90.0)]
    {
        let field = f64::to_radians(degrees);
        let (_, gradient) = mean_square_spot(&lens, &[field]).unwrap();
        let value = |l: &Lens| mean_square_spot(l, &[field]).unwrap().0;
        check_gradient(&lens, 1e-5, value, &gradient, &format!("spot at {degrees}"));
        let merit = SpotResiduals {
            fields_rad: vec![0.3, field],
            field_weights: vec![1.0; 2],
            ..SpotResiduals::new(&lens)
        };
        let (_, gradient) = merit.with_gradient(&lens).unwrap();
        let value = |l: &Lens| merit.value(l).unwrap();
        check_gradient(&lens, 1e-5, value, &gradient.unwrap(), &format!("residuals at {degrees}"));
    }
}

/// A smooth weight of each cell of a PSF of `grid` x `grid` cells.
fn weights(grid: usize) -> Vec<f64> {
    let weight = |i: usize| {
        let [x, y] = [i % grid, i / grid].map(|i| i as f64 / grid as f64);
        (3.0 * x + 0.4).sin() * (4.0 * y - 0.2).cos()
    };
    (0..grid * grid).map(weight).collect()
}

/// Illumination and the values of PSFs, by polynomials and with a ray for every cell.
#[test]
fn gradients_of_psfs_are_exact_at_wide_fields() {
    let quadrature = Quadrature::grid(64).unwrap();
    let options = PsfOptions { grid: 48, pitch_um: 60.0, kind: PsfKind::Geometric };
    let weights = weights(options.grid);
    for (lens, degrees) in [(reversed_telephoto(), 66.0), (fisheye(), 84.0)] {
        let field = f64::to_radians(degrees);
        for make in [psf_with_tape, psf_traced_with_tape] {
            let make = |l: &Lens| make(l, field, &[0.6], &quadrature, &options).unwrap();
            let value = |l: &Lens| {
                let (psf, _) = make(l);
                let sum: f64 = psf.values[0].iter().zip(&weights).map(|(v, w)| w * v).sum();
                sum + 5.0 * psf.illumination[0]
            };
            let (psf, tape) = make(&lens);
            let bar = PsfCotangent { values: vec![weights.clone()], illumination: vec![5.0], chief_y: 0.0 };
            let gradient = tape.gradient(&psf, &quadrature, &bar);
            check_gradient(&lens, 1e-3, value, &gradient, &format!("PSF at {degrees}"));
        }
    }
}

/// `<seeds, J change> = <J^T seeds, change>` for steep rays that keep their points of the stop.
#[test]
fn tangent_and_adjoint_are_transposes_for_steep_rays() {
    let lens = fisheye();
    let sequence = lens.at_wavelength(lens.reference_um);
    let stop_radius = first_order(&sequence).stop_radius_mm;
    let aimed = aim_at_pupil(&sequence, f64::to_radians(91.0), stop_radius, &pupil_points(), None);
    let launched = aimed.bundle(&sequence);
    let rays = launched.len();
    let mut noise = (0..).map(|i| 2.0 * (f64::from(i) * 0.618_033_988_7).fract() - 1.0);
    let mut seeds = Seeds::zero(rays);
    let mut wave = WaveSeeds::zero(rays);
    for i in 0..rays {
        seeds.image_x[i] = noise.next().unwrap();
        seeds.image_y[i] = noise.next().unwrap();
        wave.optical_path[i] = noise.next().unwrap();
    }
    seeds.wave = Some(wave);
    let mut change = LensGradient::zero(lens.surfaces.len());
    for i in 0..lens.surfaces.len() {
        for (number, size) in
            [(Number::Curvature, 1e-2), (Number::Conic, 1.0), (Number::Thickness, 1.0), (Number::Index, 1e-2)]
        {
            change[(i, number)] = size * noise.next().unwrap();
        }
    }
    let nothing = vec![0.0; RayBundle::padded(rays)];
    let reaim = Reaim { aimed: &aimed, launch_bar: [&nothing, &nothing] };
    let moved = push_change(&sequence, &launched, &change, Some((&aimed, 0.37)));
    let mut gradient = LensGradient::zero(lens.surfaces.len());
    let by_stop = pull_back(&sequence, &launched, &seeds, Some(&reaim), &mut gradient);
    let wave = seeds.wave.as_ref().unwrap();
    let (mut left, mut scale) = (0.0, 0.0);
    for i in 0..rays {
        for (a, b) in [
            (seeds.image_x[i], moved.image_x[i]),
            (seeds.image_y[i], moved.image_y[i]),
            (wave.optical_path[i], moved.optical_path[i]),
        ] {
            left += a * b;
            scale += (a * b).abs();
        }
    }
    let mut right = 0.37 * by_stop;
    right += gradient.numbers().iter().zip(change.numbers()).map(|(a, b)| a * b).sum::<f64>();
    assert!((left - right).abs() < 1e-10 * scale, "{left} {right}");
}

/// Irradiance of the image of a uniform scene in the ring `inner_mm ... outer_mm`, per unit of radiance, and its standard error as a share:
/// rays thrown at random, from a disc across each direction that is wider than the beam.
///
/// All azimuths are alike in a round lens, so every direction lies in one plane. The disc follows the chief ray; a disc that missed a
/// part of the beam would show as missing light.
fn thrown(lens: &Lens, fields_deg: [f64; 2], [inner_mm, outer_mm]: [f64; 2], rays: usize) -> (f64, f64) {
    let sequence = lens.at_wavelength(lens.reference_um);
    let stop_mm = first_order(&sequence).stop_radius_mm;
    let disc_mm = 0.9 * lens.entrance_pupil_mm;
    let [from, to] = fields_deg.map(f64::to_radians);
    // Where the chief rays of some fields start; between them, straight.
    const KNOTS: usize = 33;
    let field_of = |k: usize| from + (to - from) * k as f64 / (KNOTS - 1) as f64;
    let starts: Vec<[f64; 3]> = (0..KNOTS)
        .map(|k| {
            let at = aim_one(&sequence, field_of(k), stop_mm, [0.0; 2]).unwrap();
            launch(&sequence, field_of(k), at).ray.position
        })
        .collect();
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..rays {
        // Evenly over the solid angle of the fields: evenly in their cosine.
        let field = random.random_range(to.cos()..from.cos()).acos();
        let (sin, cos) = field.sin_cos();
        let place = ((field - from) / (to - from) * (KNOTS - 1) as f64).min((KNOTS - 1) as f64 - 1e-9);
        let (k, t) = (place as usize, place.fract());
        let centre = [0, 1, 2].map(|i| starts[k][i] + t * (starts[k + 1][i] - starts[k][i]));
        let (r, turn) =
            (disc_mm * random.random::<f64>().sqrt(), random.random_range(0.0..std::f64::consts::TAU));
        let (u, v) = (r * turn.sin(), r * turn.cos());
        let position = [centre[0] + u, centre[1] + v * cos, centre[2] - v * sin];
        let path = trace_ray(&sequence, Ray { position, direction: [0.0, sin, cos] });
        let Some(image) = path.image else { continue };
        let [x, y, _] = path.passages[lens.stop].point;
        let landed = image.position[0].hypot(image.position[1]);
        if x.hypot(y) < stop_mm && landed > inner_mm && landed < outer_mm {
            sum += path.transmission;
            squares += path.transmission * path.transmission;
        }
    }
    // Flux = radiance x area of the disc across the direction x solid angle.
    let pi = std::f64::consts::PI;
    let etendue = pi * disc_mm * disc_mm * 2.0 * pi * (from.cos() - to.cos());
    let area = pi * (outer_mm.powi(2) - inner_mm.powi(2));
    (sum / rays as f64 * etendue / area, squares.sqrt() / sum)
}

/// Illumination per real image area to 85 degrees, against rays that are thrown at random. Beyond 90 degrees apertures cut the light so
/// abruptly that blur mixes it from place to place.
#[test]
fn the_light_of_a_fisheye_is_that_of_a_uniform_scene() {
    // Stopped down: blur whose centroid leaves the chief ray moves light from place to place, by 2 % at 85 degrees with the full pupil.
    let lens = Lens { entrance_pupil_mm: 0.3, ..fisheye() };
    let reference = lens.at_wavelength(lens.reference_um);
    let quadrature = Quadrature::grid(128).unwrap();
    let light = |field_deg: f64| {
        let lens = Lens { wavelengths_um: vec![lens.reference_um], ..lens.clone() };
        spot(&lens, field_deg.to_radians(), &quadrature).unwrap().illumination[0]
    };
    let height = |field_deg: f64| chief_ray(&reference, field_deg.to_radians()).unwrap().y_mm;
    let (on_axis, axis_error) = thrown(&lens, [0.0, 7.0], [0.0, height(6.0)], 800_000);
    for field_deg in [45.0, 70.0, 85.0, 88.0] {
        let ring = [height(field_deg - 1.4), height(field_deg + 1.4)];
        let (found, error) = thrown(&lens, [field_deg - 2.5, field_deg + 2.5], ring, 1_500_000);
        let (thrown, error) = (found / on_axis, error.hypot(axis_error));
        let ratio = light(field_deg) / light(0.0) / thrown;
        println!("{field_deg} degrees: {:.4} for {thrown:.4} (+- {:.2} %)", ratio * thrown, 100.0 * error);
        assert!(error < 0.006 && (ratio - 1.0).abs() < 3.0 * error, "{field_deg}: {ratio}");
    }
}
