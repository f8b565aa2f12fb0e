//! White balance: white light gives equal values of all colours, and highlights end at one level.
//!
//! `light * gain / response`, cut off at the light of white at which the first colour saturates; beyond it colours would be wrong.

use burn::prelude::*;

use super::super::fixed::{GAIN, LINEAR};
use super::super::tape_grid::{Theta, colour_mask};
use crate::isp::FrameData;
use crate::sensor::{CfaPattern, Colour};

petzval_base::parameters! {
    /// White balance, on top of the sensor's own answer to white.
    pub struct WhiteBalance {
        /// Gain of red.
        red: f64 = 1.0, "", 0.25..4.0, Log, "1 is the white of the calibration";
        /// Gain of blue.
        blue: f64 = 1.0, "", 0.25..4.0, Log, "1 is the white of the calibration";
    }
}

impl WhiteBalance {
    /// Gains of red, green, blue.
    pub fn gains(&self, about: &FrameData) -> [f64; 3] {
        let gains = [self.red, 1.0, self.blue];
        std::array::from_fn(|c| gains[c] / about.response[c])
    }

    /// Gains of red, green, blue, [`GAIN`].
    pub fn registers(&self, about: &FrameData) -> [i32; 3] {
        self.gains(about).map(|gain| GAIN.of(gain))
    }

    /// The gain of every pixel of a mosaic on the tape.
    pub fn smooth(about: &FrameData, cfa: CfaPattern, like: &Tensor<4>, theta: &Theta) -> Tensor<4> {
        let [red, green, blue] = about.response;
        colour_mask(cfa, Colour::Red, like) * theta.number("white_balance.red") / red
            + colour_mask(cfa, Colour::Green, like) / green
            + colour_mask(cfa, Colour::Blue, like) * theta.number("white_balance.blue") / blue
    }
}

/// Light at which highlights end after a digital gain.
pub fn highest(about: &FrameData, gain: f64) -> f64 {
    (about.saturation * gain).min(LINEAR.value(LINEAR.max))
}
