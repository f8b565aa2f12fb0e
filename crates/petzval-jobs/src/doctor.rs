//! `doctor`: what this machine and this build offer, and whether every built-in file can be read.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::device::compiled_in_devices;
use crate::device_check::{DeviceReport, check_device};
use crate::error::Result;
use crate::machine::{Environment, environment};
use crate::range::check_ranges;

/// What the machine and the build offer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Machine and build.
    #[serde(flatten)]
    pub environment: Environment,
    /// Names of the devices on which tensors can live; [`compiled_in_devices`] describes them.
    pub devices: Vec<String>,
    /// Built-in lenses.
    pub lenses: Vec<String>,
    /// Built-in sensors.
    pub sensors: Vec<String>,
    /// Built-in experiments.
    pub experiments: Vec<String>,
    /// What the check of a device found, if one is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub check: Option<DeviceReport>,
}

petzval_base::parameters! {
    /// What is looked at beside machine, build and built-in files.
    pub struct Request {
        /// Time after which the check of a device begins nothing new; what it leaves out is listed.
        seconds: usize = 120, "s", 1..86_400, Log, "120 s; more on a device that is slow";
    }
    also {
        /// Device to check: its convolutions at the sizes of our networks, forward and back, against the CPU, and its memory over 300 steps.
        device: Option<String> = None;
    }
}

/// Looks at the machine, and reads every built-in file; one that cannot be read is an error.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let assets = &context.assets;
    let names = |folder| assets.names(folder).into_iter().map(str::to_owned).collect::<Vec<_>>();
    let (lenses, sensors, experiments) = (names("lenses"), names("sensors"), names("experiments"));
    for lens in &lenses {
        assets.import(lens)?;
    }
    for sensor in &sensors {
        assets.sensor(sensor)?;
    }
    for experiment in &experiments {
        assets.experiment(experiment)?;
    }
    check_ranges(request)?;
    let check = request.device.as_ref();
    let check = check.map(|device| check_device(device, request.seconds, context)).transpose()?;
    let devices = compiled_in_devices().into_iter().map(|(name, _)| name.to_owned());
    Ok(Response {
        environment: environment(context),
        devices: devices.collect(),
        lenses,
        sensors,
        experiments,
        check,
    })
}
