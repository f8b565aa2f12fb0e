//! Second-order statistics of natural scenes.

use crate::develop::{MEAN_LIGHT, NATURAL_POWER};
use crate::image::CHANNELS;

/// Second-order statistics of natural scenes in linear light: `S_ab(f) = power (0.1 / f)^2 (correlation + (1 - correlation) [a = b])`.
///
/// The power falls with the square of the frequency f (Field 1987; Ruderman and Bialek 1994). Colours differ little in their details:
/// the correlation of red, green and blue there is above 0.9 in most pictures (Gunturk, Altunbasak, Mersereau 2002).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NaturalScenes {
    /// Mean light, 1 = white.
    pub mean: f64,
    /// Power at a tenth of a cycle per pixel, squares of white per square cycle per pixel.
    pub power: f64,
    /// Correlation of two colours.
    pub correlation: f64,
}

impl Default for NaturalScenes {
    fn default() -> Self {
        Self { mean: MEAN_LIGHT, power: NATURAL_POWER, correlation: 0.95 }
    }
}

impl NaturalScenes {
    /// Power of each colour at a frequency, cycles per pixel; that of `least` below it.
    pub(super) fn spectrum(&self, frequency: f64, least: f64) -> f64 {
        self.power * (0.1 / frequency.max(least)).powi(2)
    }

    /// The covariance of the colours over the variance of one.
    pub(super) fn colours(&self) -> [[f64; CHANNELS]; CHANNELS] {
        [0, 1, 2].map(|a| [0, 1, 2].map(|b| if a == b { 1.0 } else { self.correlation }))
    }
}
