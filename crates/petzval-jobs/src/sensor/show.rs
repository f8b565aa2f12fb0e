//! `sensor show`: a sensor, and the EMVA 1288 figures that follow from its numbers.

use petzval_lab::emva::{Derived, derived};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::Result;
use crate::input::SensorInput;
use crate::range::check_ranges;

pub use petzval_camera::sensor::{Colour, Electronics, SensorModel};

petzval_base::parameters! {
    /// A sensor to look at.
    pub struct Request {
        /// Linear gains of the figures, above 0 and at most 10000; if empty those that the sensor offers, or 1.
        gains: Vec<f64> = Vec::new(), "", 1e-6..1e4, Log, "positive numbers";
    }
    also {
        /// Sensor: a built-in name, the path of a file, or the sensor itself.
        sensor: SensorInput = SensorInput::default();
    }
}

/// The sensor in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Everything that the sensor file holds.
    pub sensor: SensorModel,
    /// The figures at each gain.
    pub derived: Vec<Derived>,
}

/// Reads the sensor and computes its figures.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    let (name, context) = &request.sensor.placed(context)?;
    let sensor = context.assets.sensor(name)?;
    let gains = match (&request.gains[..], &sensor.gain_steps[..]) {
        ([], []) => &[1.0],
        ([], steps) => steps,
        (chosen, _) => chosen,
    };
    let derived = gains.iter().map(|gain| derived(&sensor, *gain)).collect();
    Ok(Response { sensor, derived })
}
