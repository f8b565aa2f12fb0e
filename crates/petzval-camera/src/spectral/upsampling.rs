//! Smooth spectra for RGB colours.
//!
//! Three smooth reflectances `rho_R, rho_G, rho_B`, within 0..1 and with the sum 1, have the colours of the sRGB primaries
//! under D65. The reflectance of a linear sRGB colour is their mixture `r rho_R + g rho_G + b rho_B`. It has exactly that
//! colour under D65, white is the perfect diffuser, and the map is linear. Method: I. Mallett and C. Yuksel, "Spectral
//! primary decomposition for rendering with sRGB reflectance", EGSR 2019. The example `srgb_basis` computes the three
//! curves: they have the least sum of squared second differences.

use std::sync::LazyLock;

use super::colour::{Matrix3, srgb_from_xyz, xyz_from_srgb};
use super::illuminant::Illuminant;
use super::image::SpectralImage;
use super::observer::xyz_of_reflectance;
use super::table::SpectrumTable;
use crate::image::{CHANNELS, LinearImage};
use crate::spectrum::Spectrum;
use crate::spectrum::bands::{band_mean, ends};

/// The three reflectances, 380..780 nm every 5 nm.
pub fn srgb_basis() -> &'static [Spectrum; 3] {
    static BASIS: LazyLock<[Spectrum; 3]> =
        LazyLock::new(|| SpectrumTable::built_in_curves(petzval_data::spectra::SRGB_BASIS));
    &BASIS
}

/// Reflectance of a linear sRGB colour; within 0..1 for colours within 0..1.
pub fn reflectance_of_srgb(rgb: [f64; 3]) -> Spectrum {
    let [r, g, b] = srgb_basis();
    let mixed =
        (0..r.value().len()).map(|i| rgb[0] * r.value()[i] + rgb[1] * g.value()[i] + rgb[2] * b.value()[i]);
    let mixed = mixed.map(|v| if v.is_finite() { v } else { 0.0 }).collect();
    match Spectrum::new(r.wavelength_um().to_vec(), mixed) {
        Ok(curve) => curve,
        Err(error) => unreachable!("a mixture of the basis is finite: {error}"),
    }
}

/// XYZ of D65 (Y = 1) over the range of the basis, and the matrices between XYZ and linear sRGB with that white.
pub fn d65_white() -> ([f64; 3], Matrix3, Matrix3) {
    static WHITE: LazyLock<([f64; 3], Matrix3, Matrix3)> = LazyLock::new(|| {
        let white = xyz_of_reflectance(&reflectance_of_srgb([1.0; 3]), &d65());
        (white, xyz_from_srgb(white), srgb_from_xyz(white))
    });
    *WHITE
}

/// A photograph as the spectral image of a matt print under `light` with an illuminance of `lux`: radiance
/// `E(l) rho(l) / pi` in the bands `band_um` (um, ascending, at least two). Each band holds the mean over its hat function.
pub fn upsample(photo: &LinearImage, light: &Illuminant, lux: f64, band_um: &[f64]) -> SpectralImage {
    let radiance = basis_bands(light, lux, band_um);
    let data = (0..band_um.len()).flat_map(|band| print_plane(photo, &radiance, band)).collect();
    SpectralImage { wavelength_um: band_um.to_vec(), height: photo.height, width: photo.width, data }
}

/// Radiance of each basis reflectance in each band, W m-2 sr-1 nm-1, `[colour][band]`. Outside 380..780 nm the reflectances
/// keep the values at the ends of the range, so white is the perfect diffuser at every wavelength.
pub fn basis_bands(light: &Illuminant, lux: f64, band_um: &[f64]) -> [Vec<f64>; 3] {
    let white = light.white_radiance(lux);
    srgb_basis().each_ref().map(|basis| band_mean(&[&white, &basis.held(ends(band_um))], band_um))
}

/// Radiance of a matt print in one band, row by row. `radiance` comes from [`basis_bands`].
pub(super) fn print_plane(photo: &LinearImage, radiance: &[Vec<f64>; 3], band: usize) -> Vec<f32> {
    let weight = radiance.each_ref().map(|colour| colour[band] as f32);
    let plane = |c: usize| photo.plane(c.min(photo.channels.max(1) - 1));
    let (r, g, b) = (plane(0), plane(1), plane(CHANNELS - 1));
    (0..r.len()).map(|i| weight[0] * r[i] + weight[1] * g[i] + weight[2] * b[i]).collect()
}

fn d65() -> Spectrum {
    match Illuminant::named("D65") {
        Ok(light) => light.power,
        Err(error) => unreachable!("D65 is tabulated: {error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn the_basis_sums_to_one_and_lies_within_zero_and_one() {
        let basis = srgb_basis();
        for i in 0..basis[0].value().len() {
            let values = basis.each_ref().map(|b| b.value()[i]);
            assert!(values.iter().all(|v| (-1e-9..=1.0 + 1e-9).contains(v)), "{values:?}");
            assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn the_basis_has_the_least_bending_of_the_quadratic_program() {
        let bending: f64 = srgb_basis()
            .iter()
            .flat_map(|basis| basis.value().windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).powi(2)))
            .sum();
        // The least value of the quadratic program of the example srgb_basis is 0.019803.
        assert!((bending - 0.019803).abs() < 1e-6, "{bending}");
        for basis in srgb_basis() {
            let jump = basis.value().windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
            assert!(jump < 0.14, "a step of {jump} in 5 nm");
        }
    }

    #[test]
    fn rgb_to_spectrum_to_xyz_to_rgb_is_the_identity() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut colours = vec![[0.0; 3], [1.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        colours.extend((0..200).map(|_| [0; 3].map(|_| rng.random::<f64>())));
        let mut worst = 0.0f64;
        for rgb in colours {
            let back = super::super::colour::apply(
                &d65_white().2,
                xyz_of_reflectance(&reflectance_of_srgb(rgb), &d65()),
            );
            worst = (0..3).map(|c| (back[c] - rgb[c]).abs()).fold(worst, f64::max);
        }
        assert!(worst < 1e-6, "{worst}");
        // The white point of the standard, which has four decimals.
        let (x, y) = super::super::observer::chromaticity(d65_white().0);
        assert!((x - 0.3127).abs() < 1e-4 && (y - 0.3290).abs() < 1e-4, "{x} {y}");
    }
}
