//! Wavefronts and diffraction PSFs against the Airy pattern, against Huygens's wavelets and against Optiland.

mod common;

use common::{bessel_j1, nominal_triplet, paraboloid, special_lenses};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::psf::{PsfKind, PsfMethod, PsfOptions, psf};
use petzval_optics::pupil::Quadrature;
use petzval_optics::wave::huygens_psf;

#[test]
fn a_perfect_lens_makes_an_airy_pattern() {
    for f_number in [4.0, 8.0] {
        let lens = paraboloid(f_number);
        let pitch_um = 0.25 * f_number / 4.0;
        let options = PsfOptions { grid: 64, pitch_um, kind: PsfKind::Diffraction };
        let p = psf(&lens, 0.0, &[0.5], &Quadrature::grid(32).unwrap(), &options).unwrap();
        assert!(matches!(p.method[0], PsfMethod::Wave { .. }));
        // Irradiance (2 J1(v) / v)^2 with v = pi r / (lambda N), N of the marginal ray's sine; the peak is of a grid without a
        // cell at the centre, so compare shapes.
        let n = first_order(&lens.at_wavelength(0.5)).f_number;
        let sine = (2.0 * (0.25 / n).atan()).sin();
        let airy = |r_um: f64| {
            let v = std::f64::consts::TAU / 0.5 * sine * r_um;
            if v < 1e-9 { 1.0 } else { (2.0 * bessel_j1(v) / v).powi(2) }
        };
        let at = |i: usize| (i as f64 - 31.5) * pitch_um;
        let expected: Vec<f64> = (0..64 * 64).map(|c| airy(at(c % 64).hypot(at(c / 64)))).collect();
        let (sum, expected_sum) = (p.values[0].iter().sum::<f64>(), expected.iter().sum::<f64>());
        let peak = expected.iter().fold(0.0_f64, |a, b| a.max(*b)) / expected_sum;
        for (found, expected) in p.values[0].iter().zip(&expected) {
            let off = (found / sum - expected / expected_sum).abs() / peak;
            assert!(off < 1e-3, "f/{f_number}: {off}");
        }
        // The energy within the grid: 1 - J0^2 - J1^2 over a circle; the square holds a little more.
        let v = std::f64::consts::TAU / 0.5 * sine * 32.0 * pitch_um;
        let h = 1e-5;
        let j0 = bessel_j1(v) / v + (bessel_j1(v + h) - bessel_j1(v - h)) / (2.0 * h);
        let within = 1.0 - j0 * j0 - bessel_j1(v).powi(2);
        assert!((0.0..0.02).contains(&(p.captured[0] - within)), "{} {within}", p.captured[0]);
    }
}

#[test]
fn diffraction_psfs_equal_those_of_huygens_wavelets() {
    // Stopped down to where diffraction counts.
    let slow = Lens { entrance_pupil_mm: 2.0, ..nominal_triplet() };
    let mut lenses =
        vec![(nominal_triplet(), 0.0), (nominal_triplet(), 7.0), (nominal_triplet(), 14.0), (slow, 10.0)];
    lenses.extend(special_lenses().into_iter().filter(|l| l.name.contains("tilted")).map(|l| (l, 5.0)));
    for (lens, field_deg) in lenses {
        let sequence = lens.at_wavelength(lens.reference_um);
        let field = f64::to_radians(field_deg);
        let options = PsfOptions { grid: 24, pitch_um: 1.0, kind: PsfKind::Diffraction };
        let quadrature = Quadrature::grid(256).unwrap();
        let p = psf(&lens, field, &[lens.reference_um], &quadrature, &options)
            .unwrap_or_else(|| panic!("{} {field_deg}", lens.name));
        let reference = huygens_psf(&sequence, field, &quadrature, 24, 1.0).unwrap();
        let off: f64 = p.values[0].iter().zip(&reference).map(|(a, b)| (a - b).abs()).sum();
        assert!(off < 1e-2, "{} {field_deg}: {off}", lens.name);
    }
}

#[test]
fn waves_of_a_wide_blur_on_a_wide_grid_are_those_of_a_small_grid_in_its_middle() {
    // 4 mm out of focus: a disc 0.9 mm across. The wide grid holds all of it, and needs some 1100 nodes of the pupil.
    let mut blurred = nominal_triplet();
    blurred.surfaces.last_mut().unwrap().thickness_mm += 4.0;
    let (wide, small) = (256, 64);
    let first = (wide - small) / 2;
    for field_deg in [0.0, 10.0] {
        let on = |grid| {
            let options = PsfOptions { grid, pitch_um: 4.0, kind: PsfKind::Diffraction };
            let quadrature = Quadrature::grid(64).unwrap();
            psf(&blurred, f64::to_radians(field_deg), &[0.55], &quadrature, &options).unwrap()
        };
        let (on_wide, on_small) = (on(wide), on(small));
        assert!(on_wide.captured[0] > 0.98, "{field_deg} degrees: {}", on_wide.captured[0]);
        assert!(on_small.captured[0] < 0.2, "{field_deg} degrees: {}", on_small.captured[0]);
        let off: f64 = (0..small * small)
            .map(|i| {
                let place = (first + i / small) * wide + first + i % small;
                let [a, b] = [(&on_wide, place), (&on_small, i)].map(|(p, i)| p.values[0][i] * p.captured[0]);
                (a - b).abs()
            })
            .sum();
        // The rim of the stop is as soft as its nodes are apart, and interferes a little less on the small grid.
        assert!(off < 5e-3 * on_small.captured[0], "{field_deg} degrees: {off}");
    }
}
