//! The settings of one exposure, and the raw frame that comes out of it.

use serde::{Deserialize, Serialize};

use crate::render::Placement;

/// Exposure settings. A sensor sees `white_e` electrons where the picture is white.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exposure {
    /// Electrons that linear value 1.0 gives in a green pixel, before gain.
    pub white_e: f32,
    /// Exposure time, s; it sets the dark current's share.
    pub time_s: f32,
    /// Linear gain g, 1 = the sensor's system gain.
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

/// Raw frame: one digital number per pixel, and how it was taken.
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

/// Why a frame cannot be exposed or developed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SensorError {
    /// The sensor description is out of range.
    #[error("sensor: {0}")]
    Model(#[from] super::OutOfRange),
    /// An exposure setting is not finite or out of range.
    #[error("exposure setting {what} is {value}; it must be {need}")]
    Exposure {
        /// Which setting.
        what: &'static str,
        /// Its value.
        value: f32,
        /// What it must be.
        need: &'static str,
    },
    /// The sensor does not offer this gain.
    #[error("linear gain {value} is none of the sensor's steps; the nearest is {nearest}")]
    GainStep {
        /// The gain asked for.
        value: f32,
        /// The sensor's step nearest to it, in stops.
        nearest: f64,
    },
    /// The share of a gradient that saturated pixels let through is out of range.
    #[error("the leak of saturated pixels is {value}; it must be between 0 and 1")]
    Leak {
        /// The leak given.
        value: f32,
    },
    /// A picture cannot be developed because the sensor does not see a colour.
    #[error(
        "the colour filter array {cfa} has neither {colour} nor clear pixels to develop a colour picture from"
    )]
    UnseenColour {
        /// The array.
        cfa: super::CfaPattern,
        /// The missing colour.
        colour: &'static str,
    },
    /// A buffer does not have the needed shape.
    #[error("{what}: expected {expected}, got {got}")]
    Shape {
        /// Which buffer.
        what: &'static str,
        /// Needed shape.
        expected: String,
        /// Shape found.
        got: String,
    },
    /// The picture leaves the sensor.
    #[error(
        "picture of {height}x{width} at row {row}, column {col} leaves the {sensor_height}x{sensor_width} sensor"
    )]
    OffSensor {
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
        /// First sensor row.
        row: usize,
        /// First sensor column.
        col: usize,
        /// Sensor rows.
        sensor_height: usize,
        /// Sensor columns.
        sensor_width: usize,
    },
    /// The floor of the shading correction is out of range.
    #[error("the floor of the shading correction is {value}; it must be above 0 and at most 1")]
    ShadingFloor {
        /// The floor given.
        value: f32,
    },
    /// The irradiance has a value that is not finite.
    #[error("the irradiance of row {row}, column {col} is {value}")]
    Irradiance {
        /// Row in the picture.
        row: usize,
        /// Column in the picture.
        col: usize,
        /// The value.
        value: f32,
    },
}

impl Exposure {
    /// The exposure changed by so many stops (factors of two): `gain` of the linear gain, `exposure` of the light and the
    /// time together.
    pub fn with_stops(&self, gain: f32, exposure: f32) -> Self {
        Self {
            white_e: self.white_e * exposure.exp2(),
            time_s: self.time_s * exposure.exp2(),
            linear_gain: self.linear_gain * gain.exp2(),
        }
    }

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
