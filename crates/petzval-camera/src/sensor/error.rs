//! What can be wrong with a sensor, an exposure or a frame.

use super::cfa::CfaPattern;
use crate::render::OffSensor;

/// A number of a sensor outside its physical range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{key} is {value}, outside {low}..{high}")]
pub struct OutOfRange {
    /// Key of the number in the file; a key inside a table is written `table.key`.
    pub key: &'static str,
    /// Its value.
    pub value: f64,
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Description of the number.
    pub meaning: &'static str,
}

/// Why a frame cannot be exposed or developed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SensorError {
    /// The sensor description is out of range.
    #[error("sensor: {0}")]
    Model(#[from] OutOfRange),
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
    #[error("linear gain {value} is not one of the sensor's steps; the nearest is {nearest}")]
    GainStep {
        /// The requested gain.
        value: f32,
        /// The sensor's step nearest to it, in stops.
        nearest: f64,
    },
    /// A picture cannot be developed because no pixel of the sensor measures a colour.
    #[error(
        "the colour filter array {cfa} has neither {colour} nor clear pixels to develop a colour picture from"
    )]
    UnseenColour {
        /// The array.
        cfa: CfaPattern,
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
    #[error(transparent)]
    OffSensor(#[from] OffSensor),
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

impl SensorError {
    /// A picture or a frame of another shape than is needed.
    pub(crate) fn shape(what: &'static str, expected: impl Into<String>, got: impl Into<String>) -> Self {
        Self::Shape { what, expected: expected.into(), got: got.into() }
    }
}
