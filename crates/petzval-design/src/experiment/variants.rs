//! The variants of an experiment as they stand in its file.

use std::collections::BTreeMap;

use petzval_base::FileError;
use petzval_base::parameter::Parameters;
use petzval_camera::sensor::NoiseMode;
use petzval_optics::psf::PerfectImage;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::OpticsConfig;
use super::derived_lens::PERFECT_LENS;
use crate::experiment::{BlockName, DetectorInput, FieldOfView, LensGoal, StepMethod};

/// Letters of the longest name of a variant: names of files are longer than that by what they hold.
const LONGEST_NAME: usize = 100;

/// A camera of the comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VariantConfig {
    /// Its name in tables and folders: letters, digits, `-` and `_`.
    #[schemars(regex(pattern = r"^[A-Za-z0-9_-]+$"))]
    pub name: String,
    /// The lens from which it starts; the experiment's if none is named. Beside `from`, the lens alone is its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens: Option<String>,
    /// The variant, earlier in the file, whose finished lens, ISP and network it starts from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// The description of a [network](crate::camera::optics_proxy) from which its PSFs come while its lens moves for the task, in place of exact
    /// tracing. Lenses at rest and every score are traced.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub optics_proxy: Option<String>,
    /// How noise is sampled while it is made, where that differs from `training.noise`; `"off"` for a camera that knows no noise until it is
    /// scored. Scores have exact noise in any case.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<NoiseMode>,
    /// Whether its lens keeps its field of view and focal length while it moves for the task. Stages with another goal keep the field of view in
    /// any case.
    #[serde(default, skip_serializing_if = "is_held")]
    pub field: FieldOfView,
    /// The variant, earlier in the file, whose magnification its detector sees: finished pictures are enlarged by the ratio of the focal
    /// lengths, for a lens that stays. The control for a lens whose field of view is free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zoomed_like: Option<String>,
    /// What its detector sees, in training and in scores: its finished pictures, or the truth, which is the scenes without blur and noise. These are
    /// seen through the chief rays of the lens, and developed by the ISP with its values of the start.
    #[serde(default, skip_serializing_if = "is_picture")]
    pub sees: DetectorInput,
    /// What its lens makes of a point, if the lens is `"perfect"`: a `"point"`, as where PSFs are by rays, or an `"airy-disk"`, as where they are by
    /// waves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perfect_image: Option<PerfectImage>,
    /// What is done with it, in this order.
    #[schemars(length(min = 1))]
    pub stage: Vec<StageConfig>,
}

fn is_held(field: &FieldOfView) -> bool {
    *field == FieldOfView::Held
}

fn is_picture(sees: &DetectorInput) -> bool {
    *sees == DetectorInput::Picture
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
    /// The expected error of the best linear restoration of raw frames, from the PSFs of the lens, the sensor and the exposure; no network
    /// is trained for it.
    Restored,
}

impl Goal {
    /// The goal of the lens alone, if it is one.
    pub fn of_lens(self) -> Option<LensGoal> {
        match self {
            Self::Task => None,
            Self::Spot => Some(LensGoal::Spot),
            Self::Restored => Some(LensGoal::Restored),
        }
    }
}

/// Blocks that move for one goal. What a stage leaves out comes from the experiment's tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageConfig {
    /// What the stage improves.
    #[serde(default)]
    pub goal: Goal,
    /// The blocks that move.
    #[schemars(length(min = 1))]
    pub moves: Vec<BlockName>,
    /// How blocks step in this stage, by block.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub schedule: BTreeMap<BlockName, ScheduleConfig>,
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
    #[schemars(range(min = 1e-8, max = 1.0))]
    pub learning_rate: Option<f64>,
    /// Learning rate at the end over that at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub final_learning_rate: Option<f64>,
    /// Share of the stage's network steps over which the steps of this block are spread.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub share: Option<f64>,
    /// Weight of the proximal term.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub proximal: Option<f64>,
    /// How steps are found; a hardware ISP can do without a gradient, and a lens with curvatures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<StepMethod>,
    /// Standard deviation of the random errors of the lens in each of its steps, as a share of the range of each of its numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 0.1))]
    pub error_share: Option<f64>,
}

/// The comparison that makes a gain a gain: the lens of the file, fixed; the same lens optimised for its spot alone, then
/// fixed; and lens and network together, from the lens whose frames can be restored best.
pub fn standard_variants() -> Vec<VariantConfig> {
    let stage =
        |goal, moves: &[BlockName]| StageConfig { goal, moves: moves.to_vec(), schedule: BTreeMap::new() };
    let variant = |name: &str, stage| VariantConfig {
        name: name.to_owned(),
        lens: None,
        from: None,
        optics_proxy: None,
        noise: None,
        field: FieldOfView::Held,
        zoomed_like: None,
        sees: DetectorInput::Picture,
        perfect_image: None,
        stage,
    };
    let network = stage(Goal::Task, &[BlockName::Network]);
    let [spot, restored] = [Goal::Spot, Goal::Restored].map(|goal| stage(goal, &[BlockName::Optics]));
    // By curvature: what Adam gains on training windows does not carry over to other pictures.
    let by_curvature = ScheduleConfig {
        method: Some(StepMethod::Levenberg),
        learning_rate: Some(0.3),
        ..ScheduleConfig::default()
    };
    let together = StageConfig {
        schedule: BTreeMap::from([(BlockName::Optics, by_curvature)]),
        ..stage(Goal::Task, &[BlockName::Optics, BlockName::Network])
    };
    vec![
        variant("nominal", vec![network.clone()]),
        variant("spot-optimised", vec![spot.clone(), network]),
        variant("end-to-end", vec![spot, restored, together]),
    ]
}

/// Refuses variants that cannot be made, and variants with the same name; `text` is their file, for messages.
pub(super) fn check_variants(variants: &[VariantConfig], text: &str) -> Result<(), FileError> {
    if variants.is_empty() {
        let none = FileError::at_key(text, &["variant"], "there are no variants");
        return Err(none.hint("add a [[variant]] with a name and a [[variant.stage]]"));
    }
    for (i, variant) in variants.iter().enumerate() {
        let place = i.to_string();
        check_origin(variant, &variants[..i])
            .map_err(|(key, message, hint)| at(text, &["variant", &place, key], message).hint(hint))?;
        for (k, stage) in variant.stage.iter().enumerate() {
            let stage_place = k.to_string();
            check_stage(stage).map_err(|(keys, message, hint)| {
                let path = [&["variant", &place, "stage", &stage_place], &keys[..]].concat();
                at(text, &path, format!("variant `{}`: {message}", variant.name)).hint(hint)
            })?;
            let is_idle =
                |block: &&BlockName| variant.sees == DetectorInput::Truth && **block != BlockName::Network;
            if let Some(idle) = stage.moves.iter().find(is_idle) {
                let message = format!(
                    "variant `{}`: its detector sees the truth, which `{}` cannot change",
                    variant.name,
                    idle.name()
                );
                let path = ["variant", &place, "stage", &stage_place, "moves"];
                return Err(
                    at(text, &path, message).hint("write `moves = [\"network\"]`, or leave `sees` out")
                );
            }
        }
    }
    Ok(())
}

/// Refuses stages that move a block which the camera does not have, such as an ISP where none is named.
pub(super) fn check_blocks(
    variants: &[VariantConfig],
    blocks: &[BlockName],
    text: &str,
) -> Result<(), FileError> {
    for (i, variant) in variants.iter().enumerate() {
        for (k, stage) in variant.stage.iter().enumerate() {
            if let Some(unused) = stage.moves.iter().find(|block| !blocks.contains(block)) {
                let hint = match unused {
                    BlockName::Network => {
                        "a hardware ISP has no network for pictures behind it: write \"isp\", or isp.preset = \"none\""
                    }
                    BlockName::Exposure => "name what moves in exposure.vary, such as [\"time\"]",
                    _ => "name a preset for isp.preset, or write \"network\"",
                };
                let message =
                    format!("variant `{}`: the camera has no block `{}`", variant.name, unused.name());
                let path = ["variant", &i.to_string(), "stage", &k.to_string(), "moves"];
                return Err(at(text, &path, message).hint(hint));
            }
        }
    }
    Ok(())
}

/// An error at a path of keys, or at the nearest place above it that the file has.
pub(super) fn at(text: &str, path: &[&str], message: String) -> FileError {
    let mut found = (1..=path.len()).rev().map(|end| FileError::at_key(text, &path[..end], message.clone()));
    let error = found.find(|error| error.line.is_some());
    error.unwrap_or_else(|| FileError::at_key(text, path, message))
}

/// Stands in the name of a picture where others have the camera: the scene as it lies on the sensor.
pub const SCENE: &str = "scene";

/// Name and origin of a variant behind others: key, message and hint of what is wrong.
fn check_origin(
    variant: &VariantConfig,
    earlier: &[VariantConfig],
) -> Result<(), (&'static str, String, String)> {
    let name = variant.name.as_str();
    let is_folder_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || !name.chars().all(is_folder_name) {
        let message = format!("`{name}` cannot be the name of a folder");
        return Err(("name", message, "use letters, digits, `-` and `_`".to_owned()));
    }
    if name.len() > LONGEST_NAME {
        let message = format!("this name has {} letters", name.len());
        return Err(("name", message, format!("use at most {LONGEST_NAME}: files are named by it")));
    }
    if let Some(same) = earlier.iter().find(|v| v.name.eq_ignore_ascii_case(name)) {
        let message = if same.name == name {
            format!("two variants are called `{name}`")
        } else {
            format!("`{name}` and `{}` are one folder on some systems", same.name)
        };
        return Err(("name", message, "give each a name of its own".to_owned()));
    }
    if name.eq_ignore_ascii_case(SCENE) {
        let message =
            format!("`{name}` is no name for a camera: NAME-{SCENE}.png is the scene in front of it");
        return Err(("name", message, "give it another name".to_owned()));
    }
    if let Some(from) = &variant.from
        && !earlier.iter().any(|v| v.name == *from)
    {
        let message = format!("`{name}` starts from `{from}`, which is no earlier variant");
        let names: Vec<&str> = earlier.iter().map(|v| v.name.as_str()).collect();
        let hint = if names.is_empty() {
            "the first variant starts from a lens".to_owned()
        } else {
            format!("earlier variants: {}", names.join(", "))
        };
        return Err(("from", message, hint));
    }
    let moves_for_task = |s: &StageConfig| s.goal == Goal::Task && s.moves.contains(&BlockName::Optics);
    if variant.optics_proxy.is_some() && !variant.stage.iter().any(moves_for_task) {
        let message =
            format!("the lens of `{name}` does not move for the task, so nothing would use the network");
        return Err(("optics_proxy", message, "leave it out, or add \"optics\" to a stage".to_owned()));
    }
    let by_rays = |s: &StageConfig| {
        let method = s.schedule.get(&BlockName::Optics).and_then(|s| s.method);
        matches!(method, Some(StepMethod::Levenberg | StepMethod::Evolution))
    };
    if variant.optics_proxy.is_some() && variant.stage.iter().any(by_rays) {
        let message = format!(
            "the lens of `{name}` steps by a method that traces rays, which the network in place of tracing does not have"
        );
        let hint = "leave schedule.optics.method and its learning rate out of its stages";
        return Err(("optics_proxy", message, hint.to_owned()));
    }
    if variant.field == FieldOfView::Free && !variant.stage.iter().any(moves_for_task) {
        let message =
            format!("the lens of `{name}` does not move for the task, so its field of view is held");
        return Err(("field", message, "leave it out, or add \"optics\" to a stage".to_owned()));
    }
    let parent = earlier.iter().find(|v| Some(&v.name) == variant.from.as_ref());
    if let Some(parent) = parent.filter(|parent| variant.lens.is_none() && parent.field != variant.field) {
        let word = |field: FieldOfView| if field == FieldOfView::Held { "held" } else { "free" };
        let message = format!(
            "`{name}` has a field that is {}, and takes its lens from `{}`, whose field is {}",
            word(variant.field),
            parent.name,
            word(parent.field)
        );
        let hint = "name the lens from which it starts, such as lens = \"cooke-triplet-nominal\", or give both the same field";
        return Err(("field", message, hint.to_owned()));
    }
    if let Some(other) = &variant.zoomed_like {
        let (message, hint) = if !earlier.iter().any(|v| v.name == *other) {
            (
                format!("`{name}` is zoomed like `{other}`, which is no earlier variant"),
                "name an earlier variant",
            )
        } else if variant.stage.iter().any(|s| s.moves.contains(&BlockName::Optics)) {
            (
                format!("the lens of `{name}` moves, and has no magnification of its own yet"),
                "leave \"optics\" out of its stages, and start from a variant that has the lens",
            )
        } else {
            (String::new(), "")
        };
        if !message.is_empty() {
            return Err(("zoomed_like", message, hint.to_owned()));
        }
    }
    if variant.perfect_image.is_some() && variant.lens.as_deref() != Some(PERFECT_LENS) {
        let message = format!("the lens of `{name}` is not said to be without aberrations");
        let hint = format!("leave it out, or write `lens = \"{PERFECT_LENS}\"`");
        return Err(("perfect_image", message, hint));
    }
    if variant.stage.is_empty() {
        let hint = "add a [[variant.stage]] with `moves = [\"network\"]`".to_owned();
        return Err(("stage", format!("`{name}` has no stages"), hint));
    }
    Ok(())
}

/// A stage by itself: keys, message and hint of what is wrong.
fn check_stage(stage: &StageConfig) -> Result<(), (Vec<&'static str>, String, String)> {
    if stage.moves.is_empty() {
        let hint = "write `moves = [\"network\"]`, or leave the stage out".to_owned();
        return Err((vec!["moves"], "the stage moves no block".to_owned(), hint));
    }
    if let Some(twice) = stage.moves.iter().enumerate().find(|(i, block)| stage.moves[..*i].contains(block)) {
        let message = format!("`{}` moves twice", twice.1.name());
        return Err((vec!["moves"], message, "name each block once".to_owned()));
    }
    if let Some(goal) = stage.goal.of_lens() {
        let name = goal.event();
        if stage.moves != [BlockName::Optics] {
            let message = format!("the {name} goal moves the lens alone");
            return Err((vec!["moves"], message, "write `moves = [\"optics\"]`".to_owned()));
        }
        if !stage.schedule.is_empty() {
            let hint =
                "leave it out; the stage ends where it converges, or after `spot.iterations`".to_owned();
            return Err((vec!["schedule"], format!("the {name} goal takes no schedule"), hint));
        }
    }
    let is_random =
        |block: &BlockName| stage.schedule.get(block).is_some_and(|s| s.method == Some(StepMethod::Random));
    if stage.moves.iter().all(is_random) {
        let message = "the stage moves blocks at random, and nothing learns".to_owned();
        return Err((vec!["moves"], message, "add \"network\" to `moves`".to_owned()));
    }
    for (block, schedule) in &stage.schedule {
        let name = block.name();
        if !stage.moves.contains(block) {
            let message = format!("`{name}` has a schedule and does not move");
            let hint = "add it to `moves`, or leave its schedule out".to_owned();
            return Err((vec!["schedule", name], message, hint));
        }
        let fits = match schedule.method {
            None | Some(StepMethod::Gradient) => true,
            Some(StepMethod::Evolution) => matches!(block, BlockName::Optics | BlockName::Isp),
            Some(StepMethod::Proxy) => *block == BlockName::Isp,
            Some(StepMethod::Levenberg) => *block == BlockName::Optics,
            Some(StepMethod::Random) => matches!(block, BlockName::Optics | BlockName::Exposure),
        };
        if !fits {
            let message = format!("`{name}` does not step by this method");
            let hint = "\"evolution\" is for the lens and the hardware ISP, \"proxy\" for the hardware ISP, \"levenberg\" for the lens, \"random\" for lens \
                        and exposure"
                .to_owned();
            return Err((vec!["schedule", name, "method"], message, hint));
        }
        if schedule.error_share.is_some() && *block != BlockName::Optics {
            let message = format!("`{name}` is not made in a workshop, and has no errors");
            let hint = "give error_share to the lens alone".to_owned();
            return Err((vec!["schedule", name, "error_share"], message, hint));
        }
        if schedule.method == Some(StepMethod::Evolution) {
            let rates = [
                ("learning_rate", schedule.learning_rate),
                ("final_learning_rate", schedule.final_learning_rate),
            ];
            if let Some((key, _)) = rates.into_iter().find(|(_, value)| value.is_some()) {
                let message = format!("`{name}` steps by evolution, which has no {key}");
                return Err((vec!["schedule", name, key], message, "leave it out".to_owned()));
            }
        }
        if schedule.method == Some(StepMethod::Levenberg) && schedule.learning_rate.is_none() {
            let message = format!("`{name}`: method \"levenberg\" needs learning_rate");
            let hint = "give learning_rate the share of the way to the least of the paraboloid, such as 0.3"
                .to_owned();
            return Err((vec!["schedule", name], message, hint));
        }
        if schedule.method == Some(StepMethod::Random) {
            let unused = [("error_share", schedule.error_share), ("proximal", schedule.proximal)];
            if let Some((key, _)) = unused.into_iter().find(|(_, value)| value.is_some()) {
                let message = format!("random steps of `{name}` have no {key}");
                return Err((vec!["schedule", name, key], message, "leave it out".to_owned()));
            }
            if schedule.learning_rate.is_none() {
                let message = format!("random steps of `{name}` need a reach");
                let hint = "give learning_rate the share of the way to the bounds, such as 0.5".to_owned();
                return Err((vec!["schedule", name], message, hint));
            }
        }
        if let Some((key, message)) = schedule.out_of_range() {
            let hint = "leave it out for the experiment's own value".to_owned();
            return Err((vec!["schedule", name, key], message, hint));
        }
    }
    Ok(())
}

impl ScheduleConfig {
    /// The first key out of range, with a message. The ranges are those of the tables whose values it replaces.
    fn out_of_range(&self) -> Option<(&'static str, String)> {
        let numbers = [
            ("steps", self.steps.map(|v| v as f64), "steps"),
            ("learning_rate", self.learning_rate, "learning_rate"),
            ("final_learning_rate", self.final_learning_rate, "final_learning_rate"),
            ("share", self.share, "moving_share"),
            ("proximal", self.proximal, "proximal"),
            ("error_share", self.error_share, "error_share"),
        ];
        let ranges = OpticsConfig::table();
        numbers.into_iter().find_map(|(key, value, of_table)| {
            let range = ranges.parameters.iter().find(|p| p.name == of_table)?;
            let value = value.filter(|v| !(*v >= range.min && *v <= range.max))?;
            Some((key, format!("{value}: must lie between {} and {}", range.min, range.max)))
        })
    }
}
