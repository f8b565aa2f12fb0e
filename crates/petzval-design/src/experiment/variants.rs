//! The variants of an experiment, as its file says them.

use petzval_base::FileError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::block::BlockName;

/// A camera of the comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VariantConfig {
    /// Its name in tables and folders.
    pub name: String,
    /// The lens from which it starts; the experiment's if none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens: Option<String>,
    /// The variant, earlier in the file, whose finished lens and network it starts from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// What is done with it, in this order.
    pub stage: Vec<StageConfig>,
}

/// What a stage improves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Goal {
    /// The objective of the experiment.
    #[default]
    Task,
    /// The RMS spot of the lens, whatever the rest of the camera is.
    Spot,
}

/// Blocks that move for one goal. What a stage leaves out comes from the experiment's tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageConfig {
    /// What the stage improves.
    #[serde(default)]
    pub goal: Goal,
    /// The blocks that move.
    pub moves: Vec<BlockName>,
    /// How the lens steps in this stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub optics: Option<ScheduleConfig>,
    /// How the network steps in this stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub network: Option<ScheduleConfig>,
}

/// How a block steps in one stage, where that differs from the experiment's tables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScheduleConfig {
    /// Steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// First learning rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learning_rate: Option<f64>,
    /// Learning rate at the end over that at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub final_learning_rate: Option<f64>,
    /// Share of the stage's network steps over which the steps of this block are spread.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share: Option<f64>,
    /// Weight of the proximal term.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proximal: Option<f64>,
}

/// The comparison that makes a gain a gain: the lens of the file, fixed; the same lens optimised for its spot alone, then
/// fixed; and lens and network together.
pub fn standard_variants() -> Vec<VariantConfig> {
    let stage =
        |goal, moves: &[BlockName]| StageConfig { goal, moves: moves.to_vec(), optics: None, network: None };
    let variant = |name: &str, stage| VariantConfig { name: name.to_owned(), lens: None, from: None, stage };
    let network = stage(Goal::Task, &[BlockName::Network]);
    vec![
        variant("nominal", vec![network.clone()]),
        variant("spot-optimised", vec![stage(Goal::Spot, &[BlockName::Optics]), network]),
        variant("end-to-end", vec![stage(Goal::Task, &[BlockName::Optics, BlockName::Network])]),
    ]
}

/// Refuses variants that cannot be made or told apart; `text` is their file, for messages.
pub(super) fn check_variants(variants: &[VariantConfig], text: &str) -> Result<(), FileError> {
    let error = |key: &str, message: String| FileError::at_key(text, &["variant", key], message);
    if variants.is_empty() {
        let none = FileError::at_key(text, &["variant"], "there are no variants");
        return Err(none.hint("add a [[variant]] with a name and a [[variant.stage]]"));
    }
    let mut known: Vec<&str> = Vec::new();
    for variant in variants {
        let name = variant.name.as_str();
        let is_folder_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || !name.chars().all(is_folder_name) {
            let message = format!("`{name}` cannot be the name of a folder");
            return Err(error("name", message).hint("use letters, digits, `-` and `_`"));
        }
        if known.contains(&name) {
            return Err(error("name", format!("two variants are called `{name}`"))
                .hint("give each a name of its own"));
        }
        if let Some(from) = &variant.from {
            if !known.contains(&from.as_str()) {
                let message = format!("`{name}` starts from `{from}`, which is no earlier variant");
                let hint = match known.is_empty() {
                    true => "the first variant starts from a lens".to_owned(),
                    false => format!("earlier variants: {}", known.join(", ")),
                };
                return Err(error("from", message).hint(hint));
            }
            if variant.lens.is_some() {
                let message = format!("`{name}` starts from a lens and from a variant");
                return Err(error("from", message).hint("leave out `lens` or `from`"));
            }
        }
        if variant.stage.is_empty() {
            return Err(error("stage", format!("`{name}` has no stages"))
                .hint("add a [[variant.stage]] with `moves = [\"network\"]`"));
        }
        for stage in &variant.stage {
            if stage.moves.is_empty() {
                return Err(error("stage", format!("a stage of `{name}` moves no block"))
                    .hint("write `moves = [\"network\"]`, or leave the stage out"));
            }
            if stage.goal == Goal::Spot && stage.moves != [BlockName::Optics] {
                return Err(error("stage", format!("the spot goal of `{name}` moves the lens alone"))
                    .hint("write `moves = [\"optics\"]`"));
            }
            if stage.goal == Goal::Spot && stage.optics.is_some() {
                return Err(error("stage", format!("the spot goal of `{name}` has no schedule"))
                    .hint("leave `optics` out; `iterations` in [spot] ends it at the latest"));
            }
        }
        known.push(name);
    }
    Ok(())
}
