//! The settings of one exposure, and the raw frame that it gives.

use serde::{Deserialize, Serialize};

use super::error::SensorError;
use crate::render::Placement;

/// Exposure settings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exposure {
    /// Electrons in a green pixel where the picture is white (1.0), before gain; positive.
    pub white_e: f32,
    /// Exposure time, s, not negative. It sets the electrons of the dark current.
    pub time_s: f32,
    /// Linear gain g, positive; 1 = the sensor's system gain.
    pub linear_gain: f32,
}

/// One exposure of a (part of a) sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capture {
    /// Exposure settings.
    pub exposure: Exposure,
    /// Sensor position of the top-left pixel; it sets the phase of the mosaic and the noise of each pixel.
    pub placement: Placement,
    /// Number of the frame: frames of one seed have independent noise.
    pub frame: u64,
}

/// Raw frame: one digital number per pixel, and the settings of its exposure.
#[derive(Debug, Clone, PartialEq)]
pub struct Raw {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Digital numbers, row by row; whole numbers unless the noise mode is `Off`.
    pub dn: Vec<f32>,
    /// The exposure.
    pub capture: Capture,
}

impl Exposure {
    /// Checks that the settings are finite and in range.
    pub fn validate(&self) -> Result<(), SensorError> {
        let bad = |what, value, need| Err(SensorError::Exposure { what, value, need });
        if !self.white_e.is_finite() || self.white_e <= 0.0 {
            return bad("white_e", self.white_e, "positive");
        }
        if !self.time_s.is_finite() || self.time_s < 0.0 {
            return bad("time_s", self.time_s, "zero or positive");
        }
        if !self.linear_gain.is_finite() || self.linear_gain <= 0.0 {
            return bad("linear_gain", self.linear_gain, "positive");
        }
        Ok(())
    }
}
