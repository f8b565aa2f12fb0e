//! How noisy a developed picture is, from sensor and exposure alone.
//!
//! A pixel of light x (1 = white) of a colour that collects n electrons of white has the variance `(n x + d + sigma^2) / n^2`, with d
//! electrons of dark current and the noise sigma of the readout.

use crate::render::Wiener;
use crate::sensor::{Colour, Exposure, SensorModel};

/// Light of a natural picture in the mean, 1 = white: middle grey.
pub(crate) const MEAN_LIGHT: f64 = 0.2;

/// Power of natural pictures at a tenth of a cycle per pixel, per square cycle per pixel, white squared: chosen so that the IMX249 at
/// 16,000 electrons of white has the noise 3e-3 of [`Wiener::default`], which was found on photographs.
pub(crate) const NATURAL_POWER: f64 = 4.29e-3;

/// Electrons of a pixel, colour by colour.
pub(crate) struct Electrons {
    /// Variance of a pixel in the dark, with that of the readout, e^2.
    pub dark: f64,
    /// Electrons of white of the colours of the array.
    pub white: Vec<f64>,
}

impl Electrons {
    pub fn of_sensor(sensor: &SensorModel, exposure: &Exposure) -> Self {
        let gain = sensor.gain_dn_per_e * f64::from(exposure.linear_gain);
        let dark_e = sensor.dark_current_e_per_s * f64::from(exposure.time_s);
        let electronics_e = sensor.electronics_noise_dn / gain;
        let colours = sensor.cfa.colours();
        let white =
            |colour: &Colour| f64::from(exposure.white_e) * sensor.response(*colour).iter().sum::<f64>();
        Self {
            dark: dark_e + sensor.read_noise_e.powi(2) + electronics_e.powi(2),
            white: colours.iter().map(white).collect(),
        }
    }

    /// The mean over the colours.
    pub fn mean(&self, of_white: impl Fn(f64) -> f64) -> f64 {
        self.white.iter().map(|white| of_white(*white)).sum::<f64>() / self.white.len().max(1) as f64
    }
}

/// Standard deviation of the noise after [stabilisation](super::Stabiliser), in roots of white: `1 / (2 sqrt(n))`, the mean over the
/// colours. 0.004 at 16,000 electrons of white, 0.05 at 100.
pub fn stabilised_noise(sensor: &SensorModel, exposure: &Exposure) -> f32 {
    Electrons::of_sensor(sensor, exposure).mean(|white_e| 0.5 / white_e.sqrt()) as f32
}

impl Wiener {
    /// The filter for pictures of a sensor at an exposure: the variance of middle grey over the power of natural pictures.
    pub fn of_exposure(sensor: &SensorModel, exposure: &Exposure) -> Self {
        let electrons = Electrons::of_sensor(sensor, exposure);
        let variance = electrons.mean(|white_e| (MEAN_LIGHT * white_e + electrons.dark) / white_e.powi(2));
        Self { noise: (variance / NATURAL_POWER) as f32, ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(white_e: f32, time_s: f32) -> (SensorModel, Exposure) {
        let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
        (toml::from_str(text).unwrap(), Exposure { white_e, time_s, linear_gain: 1.0 })
    }

    #[test]
    fn the_filter_of_an_exposure_grows_with_its_noise() {
        let noise = |white_e: f32, time_s: f32| {
            let (sensor, exposure) = at(white_e, time_s);
            f64::from(Wiener::of_exposure(&sensor, &exposure).noise)
        };
        let calibrated = noise(16_000.0, 0.005);
        assert!((calibrated / f64::from(Wiener::default().noise) - 1.0).abs() < 0.01, "{calibrated}");
        // Where light is plenty the noise of the photons counts, whose variance goes with one over their number.
        assert!((noise(1_600_000.0, 0.005) * 100.0 / calibrated - 1.0).abs() < 0.03);
        // In the dark that of the readout, which goes with one over its square; dark current adds to it.
        assert!((noise(1.0, 0.005) / noise(10.0, 0.005) - 100.0).abs() < 5.0);
        assert!(noise(100.0, 100.0) > 5.0 * noise(100.0, 0.005));
    }

    #[test]
    fn the_stabilised_noise_is_that_of_the_photons() {
        let (sensor, exposure) = at(16_000.0, 0.005);
        let sigma = f64::from(stabilised_noise(&sensor, &exposure));
        assert!((sigma / (0.5 / 16_000f64.sqrt()) - 1.0).abs() < 0.03, "{sigma}");
    }
}
