//! `isp show`: the parameters of an ISP.

use petzval_base::parameter::Scale;
use petzval_camera::isp::IspParameter;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::Result;
use crate::named_isp::isp_by_name;
use crate::range::check_ranges;

petzval_base::parameters! {
    /// An ISP to show.
    pub struct Request {
        /// Gain of the sensor above its lowest at which to show the values of a preset, EV.
        gain_ev: f64 = 0.0, "EV", -100..100, Linear, "0 is the lowest gain";
    }
    also {
        /// Name of a preset, or a file of settings or of the description of an external ISP.
        isp: String = super::NEUTRAL.to_owned();
    }
}

/// An ISP and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Name of the ISP.
    pub name: String,
    /// Its parameters, in its order.
    pub parameters: Vec<ShownParameter>,
    /// All values as a settings file.
    #[serde(skip)]
    pub settings: String,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShownParameter {
    /// Its name, `stage.key`.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its default.
    pub default: f64,
    /// Its unit; empty for a plain number.
    pub unit: String,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
    /// `linear` or `log`: whether it is best varied by differences or by ratios.
    pub scale: String,
    /// What it is.
    pub sentence: String,
}

impl ShownParameter {
    /// A parameter with its present value.
    pub fn new(parameter: &IspParameter, value: f64) -> Self {
        let IspParameter { name, about } = parameter;
        Self {
            name: name.clone(),
            value,
            default: parameter.default_value(),
            unit: about.unit.to_owned(),
            min: about.min,
            max: about.max,
            scale: match about.scale {
                Scale::Linear => "linear",
                Scale::Log => "log",
            }
            .to_owned(),
            sentence: about.sentence.clone(),
        }
    }
}

/// Reads the settings of an ISP.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let named = isp_by_name(&request.isp, &context.assets, context.cancel())?;
    check_ranges(request)?;
    let values = named.values(request.gain_ev)?;
    let shown = named.parameters.iter().zip(&values).map(|(p, value)| ShownParameter::new(p, *value));
    Ok(Response {
        name: named.isp().name().to_owned(),
        parameters: shown.collect(),
        settings: named.settings_toml(&format!("Settings of {}.", request.isp), &values)?,
    })
}
