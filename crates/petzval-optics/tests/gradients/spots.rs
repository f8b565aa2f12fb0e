//! Landings of rays and spots.

use super::knobs::check;
use super::{near, vignetted};
use crate::common::{nominal_triplet, special_lenses};
use petzval_optics::glass::Glass;
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::{Action, Lens, Pattern, Phase, Surface, SurfaceShape};
use petzval_optics::merit::{Merit, SpotResiduals};
use petzval_optics::number::Number;
use petzval_optics::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use petzval_optics::pupil::{Quadrature, paraxial_launch};
use petzval_optics::spot::{mean_square_spot, mean_square_spot_traced};
use petzval_optics::trace::{AimedRays, RayBundle, Reaim, Seeds, landing_jacobian, pull_back, trace};

#[test]
fn rms_spot() {
    for lens in [nominal_triplet(), near(nominal_triplet())] {
        let fields: Vec<f64> = [0.0, 7.0, 14.0].map(f64::to_radians).to_vec();
        let value = |l: &Lens| mean_square_spot(l, &fields).unwrap().0;
        let (_, gradient) = mean_square_spot(&lens, &fields).unwrap();
        check(&lens, &gradient, &value, &[1.0], 1e-6);
    }
}

#[test]
fn rms_spot_with_special_surfaces() {
    for lens in special_lenses() {
        let far = lens.fields_deg.last().unwrap().to_radians();
        let fields =
            if lens.is_rotationally_symmetric() { vec![0.0, 0.6 * far] } else { vec![-0.4 * far, 0.6 * far] };
        let value = |l: &Lens| mean_square_spot(l, &fields).unwrap().0;
        let (_, gradient) = mean_square_spot(&lens, &fields).unwrap();
        // Systems of mirrors are longer and larger, and their spots small: they need longer steps.
        check(&lens, &gradient, &value, &[0.3, 1.0, 3.0, 100.0], 1e-6);
    }
}

#[test]
fn rms_spot_of_traced_rays_without_symmetry() {
    let quadrature = Quadrature::grid(12).unwrap();
    for lens in special_lenses().into_iter().filter(|l| !l.is_mirror_symmetric()) {
        let fields = [-6.0, 9.0].map(f64::to_radians);
        let value = |l: &Lens| mean_square_spot_traced(l, &fields, &quadrature).unwrap().0;
        let (_, gradient) = mean_square_spot_traced(&lens, &fields, &quadrature).unwrap();
        check(&lens, &gradient, &value, &[0.3, 1.0, 3.0], 1e-6);
    }
}

/// A grating whose order is evanescent for a ray along the axis, on which lost rays and padding are put.
#[test]
fn rms_spot_behind_a_grating_that_stops_the_axis() {
    let mut lens = nominal_triplet();
    lens.surfaces.truncate(2);
    lens.stop = 0;
    lens.surfaces[0].shape = SurfaceShape::PLANE;
    lens.surfaces[0].phase = Some(Phase { order: 1, pattern: Pattern::Grating { lines_per_mm: 1800.0 } });
    lens.surfaces[0].glass = Glass::air();
    lens.surfaces[0].thickness_mm = 5.0;
    lens.surfaces[1] = Surface {
        action: Action::ThinLens { power_per_mm: 0.02 },
        thickness_mm: 49.0,
        semi_diameter_mm: 30.0,
        ..Surface::default()
    };
    lens.wavelengths_um = vec![0.5876];
    let fields = [f64::to_radians(-35.0)];
    let value = |l: &Lens| mean_square_spot(l, &fields).unwrap().0;
    let (_, gradient) = mean_square_spot(&lens, &fields).unwrap();
    assert!(gradient.numbers().iter().all(|v| v.is_finite()));
    check(&lens, &gradient, &value, &[0.3, 1.0, 3.0, 30.0], 1e-6);
}

/// Where a few rays land, aimed at the stop: the kernels alone, without what is made of the rays.
#[test]
fn landings_on_special_surfaces() {
    for lens in special_lenses() {
        let field = 0.7 * lens.fields_deg.last().unwrap().to_radians();
        // The stop counts by its points, not by the pupil: in this test the stop radius is the first one's.
        let stop = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
        let targets = [[0.3, 0.2], [-0.5, 0.6], [0.1, -0.9], [0.8, -0.1]].map(|p| p.map(|p| p * stop));
        let guess = |l: &Lens| {
            let order = first_order(&l.at_wavelength(l.reference_um));
            let sequence = l.at_wavelength(l.reference_um);
            targets.map(|t| paraxial_launch(&order, &sequence, field, t.map(|t| t / stop)))
        };
        let aim = |l: &Lens| AimedRays::new(&l.at_wavelength(l.reference_um), field, &targets, &guess(l));
        // Weighed sum of landings, all of them about the first lens's.
        let landings = |l: &Lens| {
            let sequence = l.at_wavelength(l.reference_um);
            let aimed = aim(l);
            assert!((0..4).all(|i| aimed.is_aimed(i)), "{}", l.name);
            let mut rays = aimed.bundle(&sequence);
            trace(&sequence, &mut rays);
            (0..4).flat_map(|i| [rays.ray(i).position[0], rays.ray(i).position[1]]).collect::<Vec<_>>()
        };
        let at = landings(&lens);
        let weights = [0.7, -0.3, 0.2, 0.9, -0.5, 0.4, -0.8, 0.6];
        let loss = |l: &Lens| {
            landings(l).iter().zip(&at).zip(weights).map(|((v, at), w)| w * (v - at)).sum::<f64>() + 0.1
        };
        let sequence = lens.at_wavelength(lens.reference_um);
        let aimed = aim(&lens);
        let mut seeds = Seeds::zero(4);
        for i in 0..4 {
            seeds.image_x[i] = weights[2 * i];
            seeds.image_y[i] = weights[2 * i + 1];
        }
        let nothing = vec![0.0; RayBundle::padded(4)];
        let reaim = Reaim { aimed: &aimed, launch_bar: [&nothing, &nothing] };
        let mut gradient = LensGradient::zero(lens.surfaces.len());
        pull_back(&sequence, &aimed.bundle(&sequence), &seeds, Some(&reaim), &mut gradient);
        check(&lens, &gradient, &loss, &[0.1, 1.0, 10.0], 1e-6);

        // The same by the Jacobian of every landing.
        let numbers: Vec<(usize, Number)> = (0..lens.surfaces.len())
            .flat_map(|s| {
                let own = lens.surfaces[s].shape.departure.numbers().len();
                let own = (0..own).map(Number::Departure);
                let all =
                    [Number::Curvature, Number::Conic, Number::Thickness, Number::Asphere(1), Number::Index];
                own.chain(all).chain((0..8).map(Number::Phase)).chain([Number::Power]).map(move |n| (s, n))
            })
            .collect();
        let jacobian = landing_jacobian(&sequence, &aimed, &numbers);
        for ((s, number), by) in numbers.iter().zip(&jacobian.by) {
            let sum: f64 = (0..4).map(|i| weights[2 * i] * by[0][i] + weights[2 * i + 1] * by[1][i]).sum();
            let expected = gradient[(*s, *number)];
            assert!((sum - expected).abs() < 1e-10 * (1.0 + expected.abs()), "{} {number:?}", lens.name);
        }
    }
}

#[test]
fn rms_spot_of_traced_rays() {
    let quadrature = Quadrature::grid(12).unwrap();
    for lens in [nominal_triplet(), near(nominal_triplet())] {
        let fields: Vec<f64> = [0.0, 7.0, 14.0].map(f64::to_radians).to_vec();
        let value = |l: &Lens| mean_square_spot_traced(l, &fields, &quadrature).unwrap().0;
        let (_, gradient) = mean_square_spot_traced(&lens, &fields, &quadrature).unwrap();
        check(&lens, &gradient, &value, &[1.0], 1e-6);
    }
}

#[test]
fn rms_spot_with_vignetting() {
    let (lens, fields) = vignetted();
    let value = |l: &Lens| mean_square_spot(l, &fields).unwrap().0;
    let (_, gradient) = mean_square_spot(&lens, &fields).unwrap();
    check(&lens, &gradient, &value, &[1.0], 1e-5);
}

#[test]
fn rms_spot_of_traced_rays_with_vignetting() {
    let (lens, fields) = vignetted();
    let quadrature = Quadrature::grid(40).unwrap();
    let value = |l: &Lens| mean_square_spot_traced(l, &fields, &quadrature).unwrap().0;
    let (_, gradient) = mean_square_spot_traced(&lens, &fields, &quadrature).unwrap();
    check(&lens, &gradient, &value, &[1.0], 1e-5);
}

/// A merit by residuals: its gradient against central differences, and its normal equations against both.
#[test]
fn spot_residuals() {
    let chosen = ["tilted and decentred", "toroid", "binary"];
    let special = special_lenses().into_iter().filter(|l| chosen.contains(&l.name.as_str()));
    for lens in special.chain([nominal_triplet()]) {
        for power in [1.0, 2.0, 4.0] {
            let merit = SpotResiduals {
                power,
                fields_rad: vec![0.05, 0.2],
                field_weights: vec![1.0, 0.5],
                ..SpotResiduals::new(&lens)
            };
            let (value, gradient) = merit.with_gradient(&lens).unwrap();
            let gradient = gradient.unwrap();
            assert_eq!(merit.value(&lens), Some(value));
            check(&lens, &gradient, &|l: &Lens| merit.value(l).unwrap(), &[0.3, 1.0, 10.0], 1e-6);

            let numbers: Vec<(usize, Number)> = (0..lens.surfaces.len())
                .flat_map(|i| [(i, Number::Curvature), (i, Number::Thickness), (i, Number::Asphere(1))])
                .collect();
            let gram = merit.normal_equations(&lens, &numbers).unwrap();
            let (stop, residual) = (numbers.len(), numbers.len() + 1);
            assert!((gram[(residual, residual)] / (value * value) - 1.0).abs() < 1e-9);
            // Half the gradient of the square, the stop following the entrance pupil.
            let sequence = lens.at_wavelength(lens.reference_um);
            let radius = first_order(&sequence).stop_radius_mm;
            let mut by_stop = LensGradient::zero(lens.surfaces.len());
            let bars = FirstOrderCotangent { stop_radius: 1.0 / radius, ..Default::default() };
            pull_back_first_order(&sequence, bars, &mut by_stop);
            for (n, number) in numbers.iter().enumerate() {
                let found = gram[(n, residual)] + gram[(stop, residual)] * by_stop[*number];
                let expected = value * gradient[*number];
                assert!(
                    (found - expected).abs() < 1e-8 * expected.abs().max(1e-3),
                    "{} {number:?}: {found} {expected}",
                    lens.name
                );
            }
        }
    }
}
