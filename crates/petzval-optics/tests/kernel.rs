//! The vector kernels against the readable reference, ray by ray.

mod built_in;
mod common;

use built_in::all_lenses;
use common::special_lenses;
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::number::Number;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::{aim_at_pupil, paraxial_launch};
use petzval_optics::trace::{
    AimedRays, Fate, Ray, RayBundle, Reaim, Seeds, WaveSeeds, aim_at_stop, launch, pull_back, push_change,
    trace, trace_ray,
};

/// Points of a square in a fixed, irregular order.
fn scattered(count: usize, half_mm: f64) -> impl Iterator<Item = [f64; 2]> {
    (0..count)
        .map(move |i| [0.754_877_666, 0.569_840_291].map(|g| half_mm * (2.0 * (i as f64 * g).fract() - 1.0)))
}

fn assert_same(lens: &Lens, field_deg: f64, half_mm: f64) -> [usize; 3] {
    let sequence = lens.at_wavelength(lens.reference_um);
    let field = field_deg.to_radians();
    let starts: Vec<Ray> = scattered(203, half_mm).map(|at| launch(&sequence, field, at).ray).collect();
    let mut bundle = RayBundle::new(starts.len());
    for (i, start) in starts.iter().enumerate() {
        bundle.set(i, *start);
    }
    trace(&sequence, &mut bundle);
    let mut seen = [0; 3];
    for (i, start) in starts.iter().enumerate() {
        let path = trace_ray(&sequence, *start);
        assert!((bundle.transmission(i) - path.transmission).abs() < 1e-9, "{}", lens.name);
        // Far outside the apertures a steep asphere may be met in several places, and either is right.
        let radii = path.passages.iter().map(|p| p.point[0].hypot(p.point[1]));
        if !radii.zip(&sequence.surfaces).all(|(r, s)| r < 1.2 * s.semi_diameter_mm) {
            continue;
        }
        // The same of a ray that the reference loses before its first passage: it begins in the plane of the first vertex.
        let from_axis = start.position[0].hypot(start.position[1]);
        if path.fate == Fate::Missed(0)
            && bundle.fate(i) != Fate::Ok
            && from_axis > 1.2 * sequence.surfaces[0].semi_diameter_mm
        {
            continue;
        }
        // Where a conic has ended, its polynomial may still be met; beyond the aperture it makes no difference.
        if let (Fate::Clipped(a), Fate::Missed(b)) = (bundle.fate(i), path.fate)
            && a == b
        {
            continue;
        }
        assert_eq!(bundle.fate(i), path.fate, "{} ray {i}: {start:?}", lens.name);
        seen[match path.fate {
            Fate::Ok => 0,
            Fate::Clipped(_) => 1,
            _ => 2,
        }] += 1;
        let Some(image) = path.image else { continue };
        let fast = bundle.ray(i);
        for axis in 0..3 {
            assert!((fast.position[axis] - image.position[axis]).abs() < 1e-10, "{} ray {i}", lens.name);
            assert!((fast.direction[axis] - image.direction[axis]).abs() < 1e-10, "{} ray {i}", lens.name);
        }
        assert!((bundle.optical_path_mm(i) - path.optical_path_mm).abs() < 1e-10);
    }
    seen
}

#[test]
fn every_lens_traces_as_the_reference_does() {
    let mut seen = [0; 3];
    for file in all_lenses() {
        let lens = file.lens;
        let half = 0.5 * lens.entrance_pupil_mm;
        for field_deg in [0.0, 7.0, 15.0] {
            for wide in [0.6, 1.0, 2.5] {
                let found = assert_same(&lens, field_deg, wide * half);
                seen = [0, 1, 2].map(|i| seen[i] + found[i]);
            }
        }
        let near = Lens { object: ObjectDistance::Finite(200.0), ..lens.clone() };
        assert_same(&near, 4.0, half);
    }
    // The test has met rays of every fate.
    assert!(seen.iter().all(|count| *count > 50), "{seen:?}");
}

#[test]
fn special_surfaces_trace_as_the_reference_does() {
    let mut seen = [0; 3];
    for lens in special_lenses() {
        petzval_optics::lens::validate(&lens).unwrap_or_else(|e| panic!("{}: {e}", lens.name));
        let half = 0.5 * lens.entrance_pupil_mm;
        let far = *lens.fields_deg.last().unwrap();
        for field_deg in [0.0, 0.5 * far, -0.9 * far] {
            for wide in [0.9, 1.6] {
                let found = assert_same(&lens, field_deg, wide * half);
                seen = [0, 1, 2].map(|i| seen[i] + found[i]);
            }
        }
    }
    assert!(seen[0] > 5000 && seen[1] > 50, "{seen:?}");
}

#[test]
fn conics_and_strong_aspheres_trace_as_the_reference_does() {
    for file in all_lenses() {
        let mut lens = file.lens;
        let half = 0.5 * lens.entrance_pupil_mm;
        for (i, surface) in lens.surfaces.iter_mut().enumerate() {
            surface.shape.conic = [-1.0, -2.5, 0.7][i % 3];
            surface.shape.asphere[0] = [1e-3, 0.0, -2e-3][i % 3];
            surface.shape.asphere[1] = [0.0, 0.0, 1e-5][i % 3];
        }
        for field_deg in [0.0, 10.0] {
            assert_same(&lens, field_deg, half);
        }
    }
}

#[test]
fn rays_are_aimed_as_the_reference_aims_them() {
    for file in all_lenses() {
        for object in [ObjectDistance::Infinity, ObjectDistance::Finite(300.0)] {
            let lens = Lens { object, ..file.lens.clone() };
            let sequence = lens.at_wavelength(lens.reference_um);
            for field_deg in [0.0, 6.0, 12.0] {
                let field = f64::to_radians(field_deg);
                let targets: Vec<[f64; 2]> = scattered(37, 0.35 * lens.entrance_pupil_mm).collect();
                let guesses = vec![[0.0, -20.0 * field.tan()]; targets.len()];
                let aimed = AimedRays::new(&sequence, field, &targets, &guesses);
                for (i, target) in targets.iter().enumerate() {
                    let reference = aim_at_stop(&sequence, field, *target, guesses[i]);
                    assert_eq!(aimed.is_aimed(i), reference.is_some(), "{} {field_deg} {i}", lens.name);
                    let Some(reference) = reference else { continue };
                    let found = aimed.launch_of(i);
                    for axis in 0..2 {
                        assert!((found[axis] - reference.launch_mm[axis]).abs() < 1e-9, "{}", lens.name);
                    }
                    let [[a, b], [c, d]] = reference.stop_by_launch;
                    let area = aimed.launch_per_stop_area(i) * (a * d - b * c);
                    assert!((area - 1.0).abs() < 1e-9, "{}: {area}", lens.name);
                }
            }
        }
    }
}

/// In the lenses that are built in the guess of first-order optics works up to 30 degrees: following the beam changes no bit. Further out it may
/// lead to another ray through the same point of the stop, as at 34 degrees in the triplet for a larger field of view; then following the beam
/// is what finds the right one.
#[test]
fn rays_near_their_paraxial_guess_are_those_of_newtons_method_alone() {
    for lens in all_lenses().into_iter().map(|file| file.lens) {
        let stop_radius = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
        for wavelength in &lens.wavelengths_um {
            let sequence = lens.at_wavelength(*wavelength);
            let order = first_order(&sequence);
            for field_deg in lens.fields_deg.iter().filter(|field| **field <= 30.0) {
                let field = field_deg.to_radians();
                let points: Vec<[f64; 2]> = scattered(203, 0.7).collect();
                let guesses: Vec<[f64; 2]> =
                    points.iter().map(|p| paraxial_launch(&order, &sequence, field, *p)).collect();
                let targets: Vec<[f64; 2]> = points.iter().map(|p| p.map(|p| stop_radius * p)).collect();
                let alone = AimedRays::new(&sequence, field, &targets, &guesses);
                let followed = aim_at_pupil(&sequence, field, stop_radius, &points, None);
                for i in 0..points.len() {
                    assert!(followed.is_aimed(i));
                    assert_eq!(alone.launch_of(i), followed.launch_of(i), "{} {field_deg} {i}", lens.name);
                }
            }
        }
    }
}

/// `<seeds, J change> = <J^T seeds, change>` over the rays of a beam, with and without re-aiming.
#[test]
fn tangent_and_adjoint_are_transposes() {
    for base in all_lenses().into_iter().map(|file| file.lens).chain(special_lenses()) {
        let far = 0.8 * base.fields_deg.last().unwrap();
        for (object, field_deg) in
            [(ObjectDistance::Infinity, far), (ObjectDistance::Finite(300.0), 0.4 * far)]
        {
            let mut lens = Lens { object, ..base.clone() };
            let semi = 0.45 * lens.entrance_pupil_mm;
            // Aperture edges cross the beam in front of the stop and behind it.
            lens.surfaces[0].semi_diameter_mm = semi + 3.0;
            lens.surfaces[lens.stop + 1].semi_diameter_mm = semi;
            for surface in &mut lens.surfaces {
                surface.shape.conic += 0.1;
            }
            let sequence = lens.at_wavelength(lens.reference_um);
            let field = f64::to_radians(field_deg);
            let targets: Vec<[f64; 2]> = scattered(61, 0.33 * lens.entrance_pupil_mm).collect();
            let aimed = AimedRays::new(&sequence, field, &targets, &vec![[0.0, -20.0 * field.tan()]; 61]);
            let launched = aimed.bundle(&sequence);

            let mut noise = (0..).map(|i| 2.0 * (f64::from(i) * 0.618_033_988_7).fract() - 1.0);
            let mut seeds = Seeds::zero(launched.len());
            for i in 0..launched.len() {
                seeds.image_x[i] = noise.next().unwrap();
                seeds.image_y[i] = noise.next().unwrap();
                seeds.transmission[i] = 1e-3 * noise.next().unwrap();
            }
            let mut wave = WaveSeeds::zero(launched.len());
            for i in 0..launched.len() {
                wave.optical_path[i] = noise.next().unwrap();
                for by in &mut wave.direction {
                    by[i] = 10.0 * noise.next().unwrap();
                }
            }
            seeds.wave = Some(wave);
            let mut change = LensGradient::zero(lens.surfaces.len());
            for (i, surface) in lens.surfaces.iter().enumerate() {
                let is_plain = |n: Number| n.slot() < Number::Departure(0).slot();
                for number in Number::ALL.into_iter().filter(|n| is_plain(*n) || surface.has_number(*n)) {
                    let size = match number {
                        Number::Conic | Number::Thickness | Number::Phase(_) => 1.0,
                        Number::SemiDiameter | Number::Departure(_) | Number::Power => 1e-3,
                        Number::Asphere(j) => 10f64.powi(-2 - 2 * j as i32),
                        Number::Curvature | Number::Index | Number::Decenter(_) | Number::Tilt(_) => 1e-2,
                    };
                    change[(i, number)] = size * noise.next().unwrap();
                }
            }
            let nothing = vec![0.0; RayBundle::padded(61)];
            for follow in [false, true] {
                let growth = 0.37;
                let moved = push_change(&sequence, &launched, &change, follow.then_some((&aimed, growth)));
                let mut gradient = LensGradient::zero(lens.surfaces.len());
                let reaim = Reaim { aimed: &aimed, launch_bar: [&nothing, &nothing] };
                let by_stop =
                    pull_back(&sequence, &launched, &seeds, follow.then_some(&reaim), &mut gradient);
                let (mut left, mut scale) = (0.0, 0.0);
                let wave = seeds.wave.as_ref().unwrap();
                for i in 0..launched.len() {
                    for (a, b) in [
                        (seeds.image_x[i], moved.image_x[i]),
                        (seeds.image_y[i], moved.image_y[i]),
                        (seeds.transmission[i], moved.transmission[i]),
                        (wave.optical_path[i], moved.optical_path[i]),
                        (wave.direction[0][i], moved.direction[0][i]),
                        (wave.direction[1][i], moved.direction[1][i]),
                        (wave.direction[2][i], moved.direction[2][i]),
                    ] {
                        left += a * b;
                        scale += (a * b).abs();
                    }
                }
                let mut right = by_stop * growth;
                right += gradient.numbers().iter().zip(change.numbers()).map(|(a, b)| a * b).sum::<f64>();
                assert!((left - right).abs() < 1e-10 * scale, "{} {follow}: {left} {right}", lens.name);
            }
        }
    }
}

/// A ray that comes from far beyond the centre of curvature meets the near side of the sphere, not the far one.
#[test]
fn rays_from_beyond_a_centre_of_curvature_do_not_miss_the_surface() {
    let mut lens = all_lenses().remove(0).lens;
    let glass = lens.surfaces[0].glass.clone();
    lens.surfaces.truncate(2);
    lens.stop = 0;
    for radius in [-20.0, -25.0, -30.0, 20.0] {
        for (i, s) in lens.surfaces.iter_mut().enumerate() {
            s.shape = petzval_optics::lens::SurfaceShape::PLANE;
            s.semi_diameter_mm = 15.0;
            s.thickness_mm = 50.0;
            s.glass = petzval_optics::glass::Glass::air();
            if i == 1 {
                s.shape.curvature = 1.0 / radius;
                s.glass = glass.clone();
            }
        }
        let sequence = lens.at_wavelength(lens.reference_um);
        let mut bundle = RayBundle::new(1);
        let start = launch(&sequence, 0.0, [0.0, 6.0]).ray;
        bundle.set(0, start);
        let path = trace_ray(&sequence, start);
        trace(&sequence, &mut bundle);
        assert_eq!((path.fate, bundle.fate(0)), (Fate::Ok, Fate::Ok), "radius {radius}");
        // By hand: the sag of a sphere at a height of 6 mm.
        let sag = radius - f64::signum(radius) * (radius * radius - 36.0_f64).sqrt();
        let [_, y, z] = path.passages[1].point;
        assert!((y - 6.0).abs() < 1e-12 && (z - sag).abs() < 1e-12, "{y} {z} {sag}");
        let image = path.image.unwrap();
        assert!((bundle.ray(0).position[1] - image.position[1]).abs() < 1e-12);
    }
}
