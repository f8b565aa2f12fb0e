//! `experiment` and `schema`: the built-in experiments, and what may stand in a file.

use petzval_camera::sensor::SensorModel;
use petzval_design::experiment::{Experiment, commented_toml};
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::Result;

/// The experiment that runs when none is named.
pub const DEFAULT_EXPERIMENT: &str = "cooke-triplet-image-quality";

/// A built-in experiment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Entry {
    /// Name by which `petzval design` runs it.
    pub name: String,
    /// Its title.
    pub title: String,
    /// Names of its variants.
    pub variants: Vec<String>,
}

/// An empty request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ListRequest {}

/// The built-in experiments, by name.
pub fn list(_: &ListRequest, context: &Context) -> Result<Vec<Entry>> {
    let entry = |name: &str| {
        let experiment = context.assets.experiment(name)?;
        let variants = experiment.variant.iter().map(|v| v.name.clone()).collect();
        Ok(Entry { name: name.to_owned(), title: experiment.name, variants })
    };
    context.assets.names("experiments").into_iter().map(entry).collect()
}

/// Which experiment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShowRequest {
    /// Experiment file, or the name of a built-in one.
    pub name: String,
}

/// The text of an experiment.
pub fn show(request: &ShowRequest, context: &Context) -> Result<String> {
    Ok(context.assets.text("experiment", "experiments", &request.name)?.text)
}

/// An experiment as a file with every key, its unit and range in a comment, and its default where it differs.
pub fn with_every_key(experiment: &Experiment) -> Result<String> {
    Ok(commented_toml(experiment)?)
}

/// A kind of file that a user writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FileKind {
    /// An experiment of `petzval design`.
    Experiment,
    /// A lens.
    Lens,
    /// A sensor.
    Sensor,
}

/// Which files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SchemaRequest {
    /// Their kind.
    pub kind: FileKind,
}

/// The JSON Schema of a kind of file: editors complete and check from it.
pub fn schema(request: &SchemaRequest, _: &Context) -> Result<serde_json::Value> {
    let schema = match request.kind {
        FileKind::Experiment => schema_for!(Experiment),
        FileKind::Lens => petzval_files::lens_schema(),
        FileKind::Sensor => schema_for!(SensorModel),
    };
    Ok(schema.to_value())
}
