//! `doctor`: what this machine and this build offer, and whether every built-in file can be read.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::device::compiled_in_devices;
use crate::error::JobError;
use crate::machine::{Environment, environment};

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
}

/// An empty request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {}

/// Looks at the machine, and reads every built-in file; one that cannot be read is an error.
pub fn run(_: &Request, context: &Context) -> Result<Response, JobError> {
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
    let devices = compiled_in_devices().into_iter().map(|(name, _)| name.to_owned());
    Ok(Response {
        environment: environment(context),
        devices: devices.collect(),
        lenses,
        sensors,
        experiments,
    })
}
