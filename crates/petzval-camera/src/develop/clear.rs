//! Colours that an array has no filter for, from its clear pixels.
//!
//! A clear pixel sees red, green and blue together. Scaled so that white gives 1, it has `c = w_R R + w_G G + w_B B` with `sum w = 1`. Where
//! the array measures some of the colours itself, as `RW/WB` does with red and blue, the others follow:
//!
//! ```text
//! L_missing = (c - sum_seen w_k L_k) / sum_missing w_k
//! ```
//!
//! Several missing colours are not told apart and get the same value. A monochrome array keeps `c` in all three planes.

use crate::image::{CHANNELS, LinearImage};
use crate::sensor::{Colour, SensorError, SensorModel};

/// Least share of a missing colour in the answer of a clear pixel: a smaller one would multiply noise by more than fifty.
const LEAST_SHARE: f64 = 0.02;

/// Computes red, green and blue if some of the three planes hold the value of the clear pixels.
pub(super) struct ClearColours {
    is_missing: [bool; CHANNELS],
    weights: [f64; CHANNELS],
    of_missing: f64,
}

impl ClearColours {
    /// The map of a sensor; none where every colour has a filter, or none has. Fails where clear pixels hardly see a missing colour.
    pub fn of(sensor: &SensorModel) -> Result<Option<Self>, SensorError> {
        let seen = sensor.cfa.colours();
        let colours = [Colour::Red, Colour::Green, Colour::Blue];
        let is_missing = colours.map(|colour| !seen.contains(&colour));
        if is_missing == [false; CHANNELS] || is_missing == [true; CHANNELS] || !seen.contains(&Colour::Clear)
        {
            return Ok(None);
        }
        let answer = sensor.response(Colour::Clear);
        let white: f64 = answer.iter().sum();
        let weights = answer.map(|v| v / white);
        let of_missing: f64 = (0..CHANNELS).filter(|c| is_missing[*c]).map(|c| weights[c]).sum();
        if of_missing.is_nan() || of_missing < LEAST_SHARE {
            let missing =
                colours.into_iter().zip(is_missing).find(|(_, is)| *is).map_or("green", |(c, _)| c.name());
            return Err(SensorError::UnseenColour { cfa: sensor.cfa, colour: missing });
        }
        Ok(Some(Self { is_missing, weights, of_missing }))
    }

    /// Replaces the clear pixels' values in the planes of missing colours.
    pub fn apply(&self, picture: &mut LinearImage) {
        let size = picture.height * picture.width;
        for i in 0..size {
            let given = (0..CHANNELS).filter(|c| !self.is_missing[*c]);
            let seen: f64 = given.map(|c| self.weights[c] * f64::from(picture.data[c * size + i])).sum();
            for c in (0..CHANNELS).filter(|c| self.is_missing[*c]) {
                let value = &mut picture.data[c * size + i];
                *value = ((f64::from(*value) - seen) / self.of_missing) as f32;
            }
        }
    }

    /// Transpose of [`Self::apply`], of the cotangent of the picture.
    pub fn pull_back(&self, d_picture: &mut LinearImage) {
        let size = d_picture.height * d_picture.width;
        for i in 0..size {
            let missing: f64 = (0..CHANNELS)
                .filter(|c| self.is_missing[*c])
                .map(|c| f64::from(d_picture.data[c * size + i]) / self.of_missing)
                .sum();
            for c in 0..CHANNELS {
                let value = &mut d_picture.data[c * size + i];
                *value = if self.is_missing[c] {
                    (f64::from(*value) / self.of_missing) as f32
                } else {
                    (f64::from(*value) - self.weights[c] * missing) as f32
                };
            }
        }
    }
}
