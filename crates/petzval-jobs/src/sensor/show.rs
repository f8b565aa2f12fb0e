//! `sensor show`: a sensor, and the EMVA 1288 figures that follow from its numbers.

use petzval_lab::emva::{Derived, derived};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::JobError;

pub use petzval_camera::sensor::{Colour, Electronics, SensorModel};

/// A sensor to look at.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Sensor file, or a built-in name.
    pub sensor: String,
    /// Linear gains of the figures, above 0 and at most 10000; if empty those that the sensor offers, or 1.
    pub gains: Vec<f64>,
}

/// The sensor in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// Everything that the sensor file holds.
    pub sensor: SensorModel,
    /// The figures at each gain.
    pub derived: Vec<Derived>,
}

/// Reads the sensor and computes its figures.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    let sensor = context.assets.sensor(&request.sensor)?;
    if let Some(wrong) = request.gains.iter().find(|g| !(**g > 0.0 && **g <= 1e4)) {
        return Err(JobError::setting("gains", wrong, "not between 0 and 10000", "positive numbers"));
    }
    let gains = match (&request.gains[..], &sensor.gain_steps[..]) {
        ([], []) => &[1.0],
        ([], steps) => steps,
        (chosen, _) => chosen,
    };
    let derived = gains.iter().map(|gain| derived(&sensor, *gain)).collect();
    Ok(Response { sensor, derived })
}
