//! `sensor list`: the built-in sensors.

use petzval_camera::sensor::CfaPattern;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::Result;

/// The built-in sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {}

/// All of them, by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The sensors in the order of their names.
    pub sensors: Vec<Entry>,
}

/// A sensor in a few numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Entry {
    /// The name by which other requests find it.
    pub name: String,
    /// Maker and model.
    pub sensor: String,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pixel pitch, um.
    pub pixel_um: f64,
    /// Bits of the converter.
    pub bits: u32,
    /// Colour filter array.
    pub cfa: CfaPattern,
    /// Full well, e-.
    pub full_well_e: f64,
    /// Read noise, e-.
    pub read_noise_e: f64,
    /// Where the numbers come from.
    pub source: String,
}

/// Lists the built-in sensors.
pub fn run(_: &Request, context: &Context) -> Result<Response> {
    let entry = |name: &str| {
        let sensor = context.assets.sensor(name)?;
        Ok(Entry {
            name: name.to_owned(),
            sensor: sensor.name,
            width: sensor.width,
            height: sensor.height,
            pixel_um: sensor.pixel_um,
            bits: sensor.bits,
            cfa: sensor.cfa,
            full_well_e: sensor.full_well_e,
            read_noise_e: sensor.read_noise_e,
            source: sensor.source,
        })
    };
    let sensors = context.assets.names("sensors").into_iter().map(entry).collect::<Result<_>>()?;
    Ok(Response { sensors })
}
