//! Digital gain: `light * 2^stops`.

use burn::prelude::*;

use crate::isp::fixed::{GAIN, LINEAR, scaled};
use crate::isp::tape_grid::Theta;

petzval_base::parameters! {
    /// Digital gain.
    pub struct Gain {
        /// Gain.
        stops: f64 = 0.0, "EV", 0.0..4.0, Linear, "0 leaves the light as it is";
    }
}

impl Gain {
    /// The factor of the light.
    pub fn factor(&self) -> f64 {
        self.stops.exp2()
    }

    /// The factor as a whole number.
    pub fn register(&self) -> i32 {
        GAIN.of(self.factor())
    }

    /// The factor on the tape.
    pub fn smooth_factor(theta: &Theta) -> Tensor<4> {
        (theta.number("gain.stops") * std::f64::consts::LN_2).exp()
    }
}

/// Light, [`LINEAR`], times a factor, [`GAIN`].
#[inline(always)]
pub fn amplified(light: i32, factor: i32) -> i32 {
    LINEAR.clamp(scaled(light, factor))
}

/// Light on the tape times a factor, cut off where [`LINEAR`] ends.
pub fn smooth_amplified(light: Tensor<4>, factor: Tensor<4>) -> Tensor<4> {
    (light * factor).clamp(LINEAR.value(LINEAR.min), LINEAR.value(LINEAR.max))
}
