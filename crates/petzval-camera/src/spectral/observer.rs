//! The CIE 1931 observer: from a spectrum to XYZ, luminance and chromaticity.

use std::sync::LazyLock;

use super::table::SpectrumTable;
use crate::spectrum::{Spectrum, integral};

/// Maximum luminous efficacy K_m, lm/W. CIE 15 allows 683 in place of 683.002, the value for the wavelength in standard air.
pub const LUMENS_PER_WATT: f64 = 683.0;

/// Colour-matching functions x, y, z of the CIE 1931 2 degree observer, 360..830 nm every 1 nm (CIE 15); y is the luminous
/// efficiency V.
pub fn cie1931() -> &'static [Spectrum; 3] {
    static OBSERVER: LazyLock<[Spectrum; 3]> =
        LazyLock::new(|| SpectrumTable::built_in_curves(petzval_data::spectra::CIE_1931));
    &OBSERVER
}

/// Tristimulus values of a stimulus per nm: `X = int S(l) x(l) dl`, l in nm, likewise Y and Z.
///
/// For radiance in W m-2 sr-1 nm-1, `LUMENS_PER_WATT * Y` is the luminance in cd/m2; for irradiance the illuminance in lux.
pub fn xyz(stimulus: &Spectrum) -> [f64; 3] {
    cie1931().each_ref().map(|curve| 1000.0 * integral(&[stimulus, curve]))
}

/// Tristimulus values of a reflectance under an illuminant, with Y = 1 for the perfect diffuser.
///
/// The illuminant must have visible light; without it the result is not finite.
pub fn xyz_of_reflectance(reflectance: &Spectrum, illuminant: &Spectrum) -> [f64; 3] {
    let [x, y, z] = cie1931();
    let white = integral(&[illuminant, y]);
    [x, y, z].map(|curve| integral(&[reflectance, illuminant, curve]) / white)
}

/// Luminance, cd/m2, of a radiance in W m-2 sr-1 nm-1; or illuminance, lux, of an irradiance in W m-2 nm-1.
pub fn luminous(stimulus: &Spectrum) -> f64 {
    LUMENS_PER_WATT * 1000.0 * integral(&[stimulus, &cie1931()[1]])
}

/// Chromaticity `(x, y)` of tristimulus values.
pub fn chromaticity(xyz: [f64; 3]) -> (f64, f64) {
    let sum: f64 = xyz.iter().sum();
    (xyz[0] / sum, xyz[1] / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_watt_at_555_nm_is_683_lumens() {
        // A line of 1 W as a narrow tent of unit area in nm.
        let line = Spectrum::new(vec![0.5545, 0.555, 0.5555], vec![0.0, 2.0, 0.0]).unwrap();
        assert!((luminous(&line) / 683.0 - 1.0).abs() < 1e-3, "{}", luminous(&line));
    }

    #[test]
    fn integrals_of_the_matching_functions_match_the_cie_table() {
        // Sums of the 1 nm table of CIE 15. They give the chromaticity of equal energy, (0.33331, 0.33329).
        let even = Spectrum::new(vec![0.36, 0.83], vec![1.0, 1.0]).unwrap();
        for (ours, sum) in xyz(&even).into_iter().zip([106.865469, 106.856917, 106.892251]) {
            assert!((ours / sum - 1.0).abs() < 1e-5, "{ours} {sum}");
        }
    }
}
