//! SI photometry of a pixel: from the radiance of a scene to the photons that a pixel collects.
//!
//! A lens that images by the sine condition has the cone `sin U' = 1 / (2 F)` at its f-number `F`. With the transmission `tau` it gives the
//! irradiance `pi L tau / (4 F^2)` on the axis: that to which relative illuminations refer. A pixel of area `A` that is exposed for the time
//! `t` collects, per nm,
//!
//! ```text
//! N(l) = L(l) A t pi / (4 F^2) tau(l) l / (h c)
//! ```
//!
//! photons, with L in W m-2 sr-1 nm-1. The renderer multiplies by the relative illumination. EMVA 1288 release 4.0,
//! section 2, has `1 + 4 F^2` for a sensor that sees a bright disk without a lens; h and c are exact in the SI (CODATA 2018).

use super::bands::hat;
use super::{Spectrum, integral};

/// Planck's constant, J s (exact).
pub const PLANCK_J_S: f64 = 6.626_070_15e-34;
/// Speed of light in vacuum, m/s (exact).
pub const LIGHT_M_PER_S: f64 = 299_792_458.0;

/// Lens, pixel and exposure time: all that turns scene radiance into photons of one pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct PixelOptics {
    /// Pixel pitch, um; the whole pixel collects (fill factor and microlens count as quantum efficiency).
    pub pixel_um: f64,
    /// f-number of the lens.
    pub f_number: f64,
    /// Exposure time, s.
    pub time_s: f64,
    /// Transmission of the lens, 0..1; `None` loses no light.
    pub transmission: Option<Spectrum>,
}

/// A setting of the optics that is not a positive number.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{what} is {value}; it must be a positive number")]
pub struct OpticsError {
    /// Which setting.
    pub what: &'static str,
    /// Its value.
    pub value: f64,
}

impl PixelOptics {
    /// Checks that all settings are positive and finite.
    pub fn validate(&self) -> Result<(), OpticsError> {
        let settings = [
            ("the pixel pitch in um", self.pixel_um),
            ("the f-number", self.f_number),
            ("the exposure time in s", self.time_s),
        ];
        match settings.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
            Some((what, value)) => Err(OpticsError { what, value }),
            None => Ok(()),
        }
    }

    /// Joules that a pixel collects per unit of radiance without losses: `A t pi / (4 F^2)`, m2 sr s.
    pub fn throughput(&self) -> f64 {
        let area_m2 = (self.pixel_um * 1e-6).powi(2);
        area_m2 * self.time_s * std::f64::consts::PI / (4.0 * self.f_number.powi(2))
    }

    /// Electrons of a pixel with quantum efficiency `efficiency` (0..1) under `radiance` (W m-2 sr-1 nm-1); with an
    /// efficiency of 1 everywhere, photons. The integral is exact for the curves as given.
    pub fn electrons(&self, radiance: &Spectrum, efficiency: &Spectrum) -> f64 {
        // Photons per joule are l / (h c): the wavelength is one more linear factor of the product.
        let (low, high) = radiance.range_um();
        let Ok(wavelength_um) = Spectrum::new(vec![low, high], vec![low, high]) else { return 0.0 };
        let mut factors = vec![radiance, efficiency, &wavelength_um];
        factors.extend(self.transmission.as_ref());
        let nm_um = 1000.0 * integral(&factors);
        self.throughput() * nm_um * 1e-6 / (PLANCK_J_S * LIGHT_M_PER_S)
    }

    /// Electrons per unit radiance of each band of a spectral image. For a spectrum that is linear between the bands,
    /// [`Self::electrons`] is the sum over the bands of weight times radiance.
    ///
    /// `band_um` are the wavelengths of the bands, um, ascending. The weight of a band is the integral over its hat function,
    /// which falls to zero at its neighbours.
    pub fn band_weights(&self, band_um: &[f64], efficiency: &Spectrum) -> Vec<f64> {
        (0..band_um.len())
            .map(|band| hat(band_um, band).map_or(0.0, |hat| self.electrons(&hat, efficiency)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral::Illuminant;
    use crate::spectral::luminous;

    fn optics() -> PixelOptics {
        PixelOptics { pixel_um: 5.0, f_number: 4.0, time_s: 0.01, transmission: None }
    }

    fn all_photons() -> Spectrum {
        Spectrum::new(vec![0.3, 1.1], vec![1.0, 1.0]).unwrap()
    }

    #[test]
    fn a_narrow_line_gives_the_photons_of_the_closed_form() {
        // A tent of 1 W m-2 sr-1 around 555 nm; its mean wavelength is the centre.
        let line = Spectrum::new(vec![0.554, 0.555, 0.556], vec![0.0, 1.0, 0.0]).unwrap();
        let expected = 25e-12 * 0.01 * std::f64::consts::PI / 64.0 * 555e-9 / (6.62607015e-34 * 299792458.0);
        let got = optics().electrons(&line, &all_photons());
        assert!((got / expected - 1.0).abs() < 1e-12, "{got} {expected}");

        // The same through glass of 80 % and an efficiency of 60 %.
        let half = |v: f64| Spectrum::new(vec![0.4, 0.7], vec![v, v]).unwrap();
        let dimmer = PixelOptics { transmission: Some(half(0.8)), ..optics() };
        assert!((dimmer.electrons(&line, &half(0.6)) / (0.48 * expected) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_lux_of_555_nm_is_4_09e15_photons_per_second_and_square_metre() {
        // 1 lux = 1/683 W/m2 at 555 nm; photon energy h c / l = 3.579e-19 J, so 4.091e15 photons m-2 s-1.
        let line = Spectrum::new(vec![0.5549, 0.555, 0.5551], vec![0.0, 1.0, 0.0]).unwrap();
        let light = Illuminant::from_spectrum("line", line).unwrap();
        let irradiance = light.irradiance(1.0);
        assert!((luminous(&irradiance) - 1.0).abs() < 1e-9);
        // A pixel of 1 m2 that sees 1 W m-2 sr-1 as an irradiance of 1 W m-2.
        let square_metre = PixelOptics {
            pixel_um: 1e6,
            f_number: 0.5 * std::f64::consts::PI.sqrt(),
            time_s: 1.0,
            transmission: None,
        };
        let photons = square_metre.electrons(&irradiance, &all_photons());
        assert!((photons / 4.0909e15 - 1.0).abs() < 1e-3, "{photons:e}");
    }

    #[test]
    fn weights_of_bands_sum_to_the_integral() {
        let radiance = Illuminant::named("D65").unwrap().white_radiance(500.0);
        let efficiency = Spectrum::new(vec![0.4, 0.45, 0.6, 0.7], vec![0.1, 0.5, 0.7, 0.2]).unwrap();
        let whole = optics().electrons(&radiance, &efficiency);
        let weights = optics().band_weights(radiance.wavelength_um(), &efficiency);
        let sum: f64 = weights.iter().zip(radiance.value()).map(|(w, l)| w * l).sum();
        assert!((sum / whole - 1.0).abs() < 1e-12, "{sum} {whole}");
    }

    #[test]
    fn validation_names_a_setting_that_is_not_positive() {
        let error = PixelOptics { f_number: 0.0, ..optics() }.validate().unwrap_err();
        assert!(error.to_string().contains("f-number is 0"));
        assert!(PixelOptics { time_s: f64::NAN, ..optics() }.validate().is_err());
        assert!(optics().validate().is_ok());
    }
}
