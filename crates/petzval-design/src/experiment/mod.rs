//! An experiment: everything that a run depends on, as one TOML file. Every key has a default.

mod commented;
mod derived_lens;
mod names;
mod plan;
mod resolve;
mod tables;
mod task_facts;
mod variants;

pub use commented::{commented_toml, reference_markdown};
pub use derived_lens::{BOX_CENTRE_LENS, PERFECT_LENS, is_derived_lens};
pub use names::{BUILT_IN_PHOTOS, BlockName, DetectorInput, FieldOfView, LensGoal, STREET, StepMethod};
pub use plan::{LensSearch, Schedule, Stage, StepRule, Variant, cosine_rate, turn_of};
pub use tables::{
    CheckpointConfig, ConstraintConfig, DetectorConfig, DevelopmentConfig, ExposureConfig, ExposureSetting,
    IspConfig, Keep, NO_ISP, NetworkConfig, OpticsConfig, PsfConfig, SameOf, ScoringConfig, SpotConfig,
    StreetConfig, TrainingConfig, ValidationConfig,
};
pub(crate) use tables::{OF_THE_WHOLE_FRAME, places_of};
pub use task_facts::{NetworkRole, PicturesKey, TaskFacts};
pub use variants::{Goal, SCENE, ScheduleConfig, StageConfig, VariantConfig, standard_variants};

use std::collections::{BTreeMap, BTreeSet};

use petzval_base::parameter::Parameters;
use petzval_base::{FileError, nearest, quote};
use petzval_camera::isp::IspSettings;
use petzval_camera::sensor::NoiseMode;
use petzval_files::coco::LIGHT_STATES;
use petzval_learn::dataset::{Classes, ObjectClass};
use petzval_learn::loss::ImageLoss;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::DesignError;

/// The task of an experiment that names none.
const DEFAULT_TASK: &str = "image-quality";

/// Most steps of a camera's network, or of its hardware ISP, in the full size of an experiment, see [`Experiment::to_full_size`].
pub const FULL_STEPS: usize = 40_000;

/// Windows a step in the full size.
pub const FULL_BATCH: usize = 16;

/// Steps between checkpoints in the full size, unless the experiment has more.
const FULL_CHECKPOINT: usize = 2000;

/// Most channels of a network.
const MOST_CHANNELS: usize = 256;

/// A joint design of lens and network, and the two controls it is compared with.
///
/// Names of lenses and sensors are those of the built-in library, or paths of files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Experiment {
    /// Title of the report.
    pub name: String,
    /// What the camera is for: a task, or a preset of one with its classes.
    pub task: String,
    /// The nominal lens.
    pub lens: String,
    /// The sensor.
    pub sensor: String,
    /// `built-in`, or a folder of pictures.
    pub photos: String,
    /// Scenes in which objects are to be found: `street`, or a folder of pictures with boxes in COCO format.
    pub data: String,
    /// Seed of everything random, but for the windows of scenes in which objects are looked for.
    pub seed: u64,
    /// How the picture is exposed, the same for every camera.
    pub exposure: ExposureConfig,
    /// Point-spread functions.
    pub psf: PsfConfig,
    /// How raw frames become pictures before the network.
    pub development: DevelopmentConfig,
    /// A hardware ISP in place of development and network.
    pub isp: IspConfig,
    /// The network that makes pictures for people.
    pub network: NetworkConfig,
    /// The detector, where objects are to be found; it takes the network's place.
    pub detector: DetectorConfig,
    /// The streets in which objects are to be found.
    pub street: StreetConfig,
    /// How the network is trained.
    pub training: TrainingConfig,
    /// What a picture's loss is made of.
    pub loss: ImageLoss,
    /// How the lens moves with the network.
    pub optics: OpticsConfig,
    /// The spot goal of a stage.
    pub spot: SpotConfig,
    /// What the lens must keep.
    pub constraints: ConstraintConfig,
    /// How cameras are scored.
    pub scoring: ScoringConfig,
    /// How training is validated, and when it stops.
    pub validation: ValidationConfig,
    /// How often the run can be resumed from.
    pub checkpoint: CheckpointConfig,
    /// The classes of a task that has them, in the order of their numbers; those of its preset where none are stated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub class: Vec<ObjectClass>,
    /// The cameras that are made and compared, in this order.
    #[schemars(length(min = 1))]
    pub variant: Vec<VariantConfig>,
}

impl Default for Experiment {
    /// The main job: the nominal Cooke triplet and a small network on a Sony IMX249, against two controls.
    fn default() -> Self {
        Self {
            name: "Camera design".to_owned(),
            task: DEFAULT_TASK.to_owned(),
            lens: "cooke-triplet-nominal".to_owned(),
            sensor: "imx249-fitted".to_owned(),
            photos: BUILT_IN_PHOTOS.to_owned(),
            data: STREET.to_owned(),
            seed: 1,
            exposure: ExposureConfig::default(),
            psf: PsfConfig::default(),
            development: DevelopmentConfig::default(),
            isp: IspConfig::default(),
            network: NetworkConfig::default(),
            detector: DetectorConfig::default(),
            street: StreetConfig::default(),
            training: TrainingConfig::default(),
            loss: ImageLoss::default(),
            optics: OpticsConfig::default(),
            spot: SpotConfig::default(),
            constraints: ConstraintConfig::default(),
            scoring: ScoringConfig::default(),
            validation: ValidationConfig::default(),
            checkpoint: CheckpointConfig::default(),
            class: Vec::new(),
            variant: standard_variants(),
        }
    }
}

impl Experiment {
    /// Reads an experiment without a check. Errors name line, key, value and a hint.
    pub(crate) fn read(text: &str) -> Result<Self, FileError> {
        toml::from_str(text).map_err(|e| FileError::from_toml(text, &e))
    }

    /// The experiment with the scores of its task if its text names none.
    pub(crate) fn with_default_scores(mut self, text: &str, facts: &TaskFacts) -> Self {
        if let Some(scores) = facts.default_scores.filter(|_| !names_scores(text)) {
            self.scoring.scores = scores.iter().map(|score| (*score).to_owned()).collect();
        }
        self
    }

    /// Checks that the scores are among those that are known. One who scores by others, with scorers of their own, leaves this out.
    pub(crate) fn check_scores(
        &self,
        text: &str,
        known: &[String],
        facts: &TaskFacts,
    ) -> Result<(), FileError> {
        let unknown = self.scoring.scores.iter().enumerate().find(|(_, name)| !known.contains(name));
        let Some((i, unknown)) = unknown else { return Ok(()) };
        let of = format!("of {}", facts.scored);
        let message = format!("`{unknown}` is no score {of}");
        let error = variants::at(text, &["scoring", "scores", &i.to_string()], message);
        let words: Vec<&str> = known.iter().map(String::as_str).collect();
        let near = nearest(unknown, &words).map(|near| format!("did you mean \"{near}\"? "));
        let hint = format!("{}scores {of} are {}", near.unwrap_or_default(), known.join(", "));
        Err(FileError { key: "scores".to_owned(), ..error }.hint(hint))
    }

    /// Refuses the text of a run's `config.toml` that lacks a key of its record, the `complete`: a default in place of a key that was lost would
    /// make another run of it. Keys that are younger than a run are not in its record.
    pub(crate) fn check_complete(text: &str, complete: &serde_json::Value) -> Result<(), FileError> {
        let found: serde_json::Value = toml::from_str(text).map_err(|e| FileError::from_toml(text, &e))?;
        match missing_key(&found, complete) {
            None => Ok(()),
            Some(key) => Err(FileError::at_key(text, &[&key], "is missing")
                .hint("the config.toml of a run holds every key; put it back as it was")),
        }
    }

    /// The classes of its task.
    pub fn classes(&self) -> Classes {
        self.class.clone().into()
    }

    /// The experiment as a file that [`Tasks::parse`](crate::task::Tasks::parse) reads back to the same values.
    pub fn to_toml(&self) -> Result<String, DesignError> {
        toml::to_string(self)
            .map_err(|e| DesignError::Unwritable { what: "the experiment", problem: e.to_string() })
    }

    /// Checks everything that does not depend on the scores that are known.
    pub(crate) fn check(&self, text: &str, facts: &TaskFacts) -> Result<(), FileError> {
        let tables = [
            ("exposure", self.exposure.out_of_range()),
            ("psf", self.psf.out_of_range()),
            ("isp", self.isp.out_of_range()),
            ("network", self.network.out_of_range()),
            ("street", self.street.out_of_range()),
            ("training", self.training.out_of_range()),
            ("loss", self.loss.out_of_range()),
            ("optics", self.optics.out_of_range()),
            ("spot", self.spot.out_of_range()),
            ("constraints", self.constraints.out_of_range()),
            ("scoring", self.scoring.out_of_range()),
            ("validation", self.validation.out_of_range()),
            ("checkpoint", self.checkpoint.out_of_range()),
        ];
        for (table, wrong) in tables {
            if let Some(wrong) = wrong {
                let error = FileError::at_key(text, &[table, wrong.parameter.name], wrong.message());
                return Err(error.hint(wrong.parameter.hint));
            }
        }
        let needs_gradient =
            |v: &Variant| v.stages.iter().any(|stage| stage.steps_down_a_gradient(BlockName::Optics));
        let has_no_gradient = |v: &Variant| v.noise == NoiseMode::Exact && needs_gradient(v);
        if let Some(i) = self.variants().iter().position(has_no_gradient) {
            let place = i.to_string();
            let key = match self.variant[i].noise {
                Some(_) => ["variant", &place, "noise"].to_vec(),
                None => vec!["training", "noise"],
            };
            let error = FileError::at_key(text, &key, "exact noise has no gradient to the lens");
            return Err(error.hint("write \"dequantised\", or 0 for optics.steps"));
        }
        let first = |has: &dyn Fn(&VariantConfig) -> bool| self.variant.iter().position(has);
        let for_detectors = [
            ("zoomed_like", "only a detector sees zoomed pictures", first(&|v| v.zoomed_like.is_some())),
            ("sees", "only a detector can see the truth", first(&|v| v.sees == DetectorInput::Truth)),
        ];
        for (key, message, first) in for_detectors {
            if let Some(i) = first.filter(|_| facts.network == NetworkRole::Finishes) {
                let message = format!("{message}; where pictures are scored they stay as they are");
                let error = FileError::at_key(text, &["variant", &i.to_string(), key], message);
                return Err(error.hint("leave it out"));
            }
        }
        if !self.development.demosaic.is_differentiable() && self.variants().iter().any(needs_gradient) {
            let error = FileError::at_key(
                text,
                &["development", "demosaic"],
                "this method has no gradient to the lens",
            );
            return Err(error.hint("write \"menon\", \"malvar\" or \"bilinear\", or 0 for optics.steps"));
        }
        if facts.network == NetworkRole::Finishes
            && self.network.kind.needs_restoration()
            && !self.development.restore
        {
            let error =
                FileError::at_key(text, &["network", "kind"], "this network needs a restored picture");
            return Err(error.hint("write true for development.restore, or \"u-net\""));
        }
        if self.isp.is_used() {
            self.check_isp(text)?;
        }
        if !self.has_picture_network(facts.network)
            && !self.network.draws_weights()
            && !self.network.has_built_in_weights()
        {
            let message = "there is no network for pictures that could start from them";
            let error = FileError::at_key(text, &["network", "weights"], message);
            return Err(error.hint("leave it out; a detector starts from detector.weights"));
        }
        self.check_exposure(text, facts)?;
        self.check_classes(text, facts)?;
        let waits =
            [("patience", self.validation.patience > 0), ("keep", self.validation.keep == Keep::Best)];
        if let Some((key, _)) = waits.into_iter().find(|(_, waits)| *waits && !self.validation.is_used()) {
            let error = FileError::at_key(text, &["validation", key], "there are no validations");
            return Err(error.hint("give validation.every the steps between two of them, such as 25"));
        }
        variants::check_variants(&self.variant, text)?;
        variants::check_blocks(&self.variant, &self.blocks(facts.network), text)?;
        if self.loss.is_empty() {
            let error = FileError::at_key(text, &["loss", "l1_weight"], "all weights of the loss are zero");
            return Err(error.hint("give at least one part a positive weight"));
        }
        let scores = &self.scoring.scores;
        let twice = scores.iter().enumerate().find(|(i, name)| scores[..*i].contains(name));
        let wrong = match twice {
            Some((_, name)) => Some((format!("`{name}` is named twice"), "name each score once")),
            None if scores.is_empty() => Some(("names no score".to_owned(), "for example [\"psnr_db\"]")),
            None => None,
        };
        if let Some((message, hint)) = wrong {
            return Err(FileError::at_key(text, &["scoring", "scores"], message).hint(hint));
        }
        for (table, key, value) in [
            ("psf", "pupil_cells", self.psf.pupil_cells),
            ("psf", "scoring_pupil_cells", self.psf.scoring_pupil_cells),
            ("psf", "grid", self.psf.grid),
        ] {
            if !value.is_multiple_of(2) {
                return Err(FileError::at_key(text, &[table, key], "must be even")
                    .hint(format!("take {}", value + 1)));
            }
        }
        Ok(())
    }

    /// Refuses parameters that cannot move, and windows that a Bayer array does not fill evenly.
    fn check_isp(&self, text: &str) -> Result<(), FileError> {
        let vary = |message: String, hint: &'static str| {
            Err(FileError::at_key(text, &["isp", "vary"], message).hint(hint))
        };
        if self.isp.vary.is_empty() {
            return vary("names no parameter".to_owned(), "name parameters or stages, such as \"sharpen\"");
        }
        if self.isp.vary.iter().any(|name| name == OF_THE_WHOLE_FRAME) {
            let message = format!(
                "`{OF_THE_WHOLE_FRAME}` depends on the place in the whole frame, and windows have none"
            );
            return vary(message, "leave it out; the other parameters of its stage may move");
        }
        // Those of a file are known when it is read.
        let parameters = IspSettings::parameters();
        let is_unknown = |name: &&String| !self.isp.is_in_file() && places_of(name, &parameters).is_empty();
        if let Some(name) = self.isp.vary.iter().find(is_unknown) {
            let message = format!("no parameter or stage of the ISP is called `{name}`");
            return vary(message, "`petzval isp show` lists them");
        }
        for (table, crop) in [("training", self.training.crop), ("scoring", self.scoring.crop)] {
            if !crop.is_multiple_of(2) {
                let error = FileError::at_key(text, &[table, "crop"], "must be even for a hardware ISP");
                return Err(error.hint(format!("take {}", crop + 1)));
            }
        }
        Ok(())
    }

    /// Refuses settings of the exposure that cannot move, and ranges that do not hold what is stated.
    fn check_exposure(&self, text: &str, facts: &TaskFacts) -> Result<(), FileError> {
        let e = &self.exposure;
        let wrong = |key: &str, message: String, hint: &'static str| {
            Err(variants::at(text, &["exposure", key], message).hint(hint))
        };
        if e.vary.iter().enumerate().any(|(i, setting)| e.vary[..i].contains(setting)) {
            return wrong("vary", "names a setting twice".to_owned(), "name each once");
        }
        if !e.vary.is_empty() && self.sees_streets(facts) {
            let message = "streets are exposed automatically, each for its own light".to_owned();
            return wrong("vary", message, "leave it out, or give photographs with boxes as `data`");
        }
        let ranges = [
            (ExposureSetting::Time, "times_s", e.times_s, e.time_s),
            (ExposureSetting::Gain, "gains", e.gains, e.linear_gain),
        ];
        for (_, key, [min, max], stated) in ranges.into_iter().filter(|(s, ..)| e.vary.contains(s)) {
            // A stated value may be a bound in another precision.
            let stated = f64::from(stated);
            if !(min < max && stated >= min * (1.0 - 1e-6) && stated <= max * (1.0 + 1e-6)) {
                let message =
                    format!("the range {min} to {max} of exposure.{key} does not hold the stated {stated}");
                return wrong(
                    key,
                    message,
                    "give the smaller bound first, and the stated value between them",
                );
            }
        }
        Ok(())
    }

    /// Refuses classes that a task cannot have, that have no name or the same one, and lights that show what no light shows.
    fn check_classes(&self, text: &str, facts: &TaskFacts) -> Result<(), FileError> {
        let wrong = |i: usize, key: &str, message: String, hint: &str| {
            Err(variants::at(text, &["class", &i.to_string(), key], message).hint(hint))
        };
        if !facts.has_classes && !self.class.is_empty() {
            let message = format!("the task `{}` has no classes", self.task);
            return wrong(0, "name", message, "leave [[class]] out, or name a task that has classes");
        }
        if facts.has_classes && self.class.is_empty() {
            let message = format!("the task `{}` needs classes", self.task);
            let hint = "add a table [[class]] with a name for each of them";
            return Err(FileError::at_key(text, &["task"], message).hint(hint));
        }
        for (i, class) in self.class.iter().enumerate() {
            let name = &class.name;
            if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || "-_".contains(c)) {
                let message = format!("`{name}` is no name of a class");
                let hint = "letters, digits, - and _: it stands in the names of scores, such as ap50_car";
                return wrong(i, "name", message, hint);
            }
            if self.class[..i].iter().any(|other| other.name == *name) {
                return wrong(i, "name", format!("`{name}` is named twice"), "name each class once");
            }
            if let Some(number) = class.coco.filter(|number| !(1..=90).contains(number)) {
                let message = format!("COCO has no class {number}");
                return wrong(i, "coco", message, "1 to 90; a person is 1, a car is 3");
            }
            let state = class.state.as_ref().filter(|state| !LIGHT_STATES.contains(&state.as_str()));
            if let Some(state) = state {
                let message = format!("`{state}` is no state of a traffic light");
                return wrong(i, "state", message, "red, yellow, green or off");
            }
        }
        Ok(())
    }

    /// The pictures of its task, by name or path.
    pub fn pictures(&self, key: PicturesKey) -> &String {
        match key {
            PicturesKey::Photos => &self.photos,
            PicturesKey::Data => &self.data,
        }
    }

    /// The same, to name others.
    pub fn pictures_mut(&mut self, key: PicturesKey) -> &mut String {
        match key {
            PicturesKey::Photos => &mut self.photos,
            PicturesKey::Data => &mut self.data,
        }
    }

    /// Whether a task of these facts sees generated streets.
    pub fn sees_streets(&self, facts: &TaskFacts) -> bool {
        facts.pictures == PicturesKey::Data && self.data == STREET
    }

    /// Whether a network finishes the pictures of its cameras.
    pub fn has_picture_network(&self, role: NetworkRole) -> bool {
        role == NetworkRole::Finishes && !self.isp.is_used()
    }

    /// The blocks that a camera of the experiment has: a hardware ISP takes the place of a network for pictures, but stands before one that reads
    /// them.
    pub fn blocks(&self, role: NetworkRole) -> Vec<BlockName> {
        let has = |block: &BlockName| match block {
            BlockName::Optics => true,
            BlockName::Exposure => !self.exposure.vary.is_empty(),
            BlockName::Isp => self.isp.is_used(),
            BlockName::Network => role == NetworkRole::Reads || !self.isp.is_used(),
        };
        BlockName::ALL.into_iter().filter(has).collect()
    }

    /// The last block of the camera: the network, or the hardware ISP in its place.
    pub fn last_block(&self, role: NetworkRole) -> BlockName {
        if self.blocks(role).contains(&BlockName::Network) { BlockName::Network } else { BlockName::Isp }
    }

    /// Sets the steps of the network, or of the hardware ISP, in every stage that has no number of its own, and changes all other steps in
    /// proportion, rounded up. A longer training of the network has a limit to its gradients.
    pub fn scale_steps(&mut self, steps: usize, role: NetworkRole) {
        let (is_isp, last_block) = (self.isp.is_used(), self.last_block(role));
        let last = match last_block {
            BlockName::Isp => &mut self.isp.steps,
            _ => &mut self.training.steps,
        };
        let share = steps as f64 / (*last).max(1) as f64;
        *last = steps;
        // Longer schedules keep the high rate longer and diverge without gradient clipping.
        if share > 1.0 && last_block == BlockName::Network && self.training.largest_gradient == 0.0 {
            self.training.largest_gradient = TrainingConfig::default().largest_gradient;
        }
        let scaled = |steps: usize| (steps as f64 * share).ceil() as usize;
        self.optics.steps = scaled(self.optics.steps);
        if !self.exposure.vary.is_empty() {
            self.exposure.steps = scaled(self.exposure.steps);
        }
        if is_isp {
            self.isp.proxy_warm_up = scaled(self.isp.proxy_warm_up);
            if last_block != BlockName::Isp {
                self.isp.steps = scaled(self.isp.steps);
            }
        }
        let stages = self.variant.iter_mut().flat_map(|v| &mut v.stage);
        let own = stages.flat_map(|stage| stage.schedule.values_mut());
        own.filter_map(|s| s.steps.as_mut()).for_each(|steps| *steps = scaled(*steps));
    }

    /// Gives the experiment the budget of a night on a GPU in place of minutes on two cores. The camera with the most steps gets
    /// [`FULL_STEPS`] steps of the network or of the hardware ISP; all other steps grow in proportion. Batches have [`FULL_BATCH`] windows,
    /// and the network is twice as wide, which no built-in weights fit. Nothing else changes.
    pub fn to_full_size(&mut self, role: NetworkRole) {
        let last_block = self.last_block(role);
        let own = if last_block == BlockName::Isp { self.isp.steps } else { self.training.steps };
        self.scale_steps((FULL_STEPS * own).div_ceil(self.most_steps_of(last_block).max(1)), role);
        self.training.batch = FULL_BATCH;
        self.network.base_channels = (2 * self.network.base_channels).min(MOST_CHANNELS);
        self.checkpoint.every = self.checkpoint.every.max(FULL_CHECKPOINT);
    }

    /// Steps that a block takes for the task in the variant that takes the most, those of the variants from which it starts among them.
    fn most_steps_of(&self, block: BlockName) -> usize {
        let variants = self.variants();
        let with_parents = |variant: &Variant| {
            let chain = std::iter::successors(Some(variant), |child| {
                variants.iter().find(|v| child.from.as_ref() == Some(&v.name))
            });
            chain.map(|v| v.task_steps_of(block)).sum()
        };
        variants.iter().map(with_parents).max().unwrap_or(0)
    }

    /// The experiment with one more stage for each variant, so that its network, or hardware ISP, takes `network_steps` steps in all; the same blocks
    /// move as in the variant's last stage with the network, the lens in proportion. The error is a message and a hint.
    ///
    /// A stage of its own leaves the steps before it as they are: a run that is extended after its end and one that has this
    /// experiment from the beginning make the same cameras.
    pub fn extended_to(&self, network_steps: usize, role: NetworkRole) -> Result<Self, (String, String)> {
        if let Some((name, from)) = self.variant.iter().find_map(|v| Some((&v.name, v.from.as_ref()?))) {
            let message =
                format!("`{name}` starts from the finished `{from}`, which an extension would change");
            return Err((message, "start a new run with more --steps".to_owned()));
        }
        if let Some((name, like)) = self.variant.iter().find_map(|v| Some((&v.name, v.zoomed_like.as_ref()?)))
        {
            let message = format!(
                "`{name}` is zoomed like the finished `{like}`, whose lens an extension would change"
            );
            return Err((message, "start a new run with more --steps".to_owned()));
        }
        let network = self.last_block(role);
        let mut longer = self.clone();
        for (variant, config) in self.variants().iter().zip(&mut longer.variant) {
            let taken = variant.task_steps_of(network);
            let stages = variant.stages.iter().zip(&config.stage);
            let Some((stage, last)) = stages.rev().find(|(stage, _)| stage.task_steps_of(network) > 0) else {
                continue;
            };
            if network_steps < taken {
                let message =
                    format!("the variant `{}` has {taken} {} steps already", variant.name, network.name());
                return Err((message, "give a larger number".to_owned()));
            }
            let further = network_steps - taken;
            if further == 0 {
                continue;
            }
            let mut added = last.clone();
            for block in &last.moves {
                let steps = (stage.steps_of(*block) * further).div_ceil(stage.steps_of(network));
                added.schedule.entry(*block).or_default().steps = Some(steps);
            }
            config.stage.push(added);
        }
        Ok(longer)
    }

    /// The keys in which this experiment differs from another, each with the value there: `training.steps`, `60`.
    pub fn differences(&self, other: &Self) -> Vec<(String, String)> {
        let whole = |e: &Self| toml::Value::Table(toml::Table::try_from(e).unwrap_or_default());
        let mut found = Vec::new();
        differences("", Some(&whole(self)), Some(&whole(other)), &mut found);
        found
    }

    /// Every value by its key, such as `psf.grid` and `variant.0.name`.
    pub fn values(&self) -> BTreeMap<String, String> {
        let whole = toml::Value::Table(toml::Table::try_from(self).unwrap_or_default());
        let mut found = BTreeMap::new();
        add_values("", &whole, &mut found);
        found
    }

    /// The experiment with one variant alone, and those that it needs: from which it starts, or like whose pictures its own are zoomed.
    /// `None` if it has none of that name.
    pub fn only(&self, name: &str) -> Option<Self> {
        let mut wanted = vec![name];
        let mut variants = Vec::new();
        // A variant needs earlier ones alone.
        for variant in self.variant.iter().rev() {
            if wanted.contains(&variant.name.as_str()) {
                wanted.extend(variant.from.as_deref());
                wanted.extend(variant.zoomed_like.as_deref());
                variants.insert(0, variant.clone());
            }
        }
        (!variants.is_empty()).then(|| Self { variant: variants, ..self.clone() })
    }

    /// Every lens, sensor, ISP, network and data set that the experiment names, each with its key. What is derived from the experiment itself
    /// (the perfect lens, no ISP) is not among them.
    pub fn inputs_mut(&mut self) -> impl Iterator<Item = (Vec<String>, &mut String)> {
        let key = |parts: &[&str]| parts.iter().map(|part| (*part).to_owned()).collect::<Vec<_>>();
        let of_variants = self.variant.iter_mut().enumerate().flat_map(move |(i, v)| {
            let key = |name: &str| vec!["variant".to_owned(), i.to_string(), name.to_owned()];
            let lens = v.lens.as_mut().filter(|name| !is_derived_lens(name)).map(|lens| (key("lens"), lens));
            lens.into_iter().chain(v.optics_proxy.as_mut().map(|proxy| (key("optics_proxy"), proxy)))
        });
        let is_file = !self.network.draws_weights() && !self.network.has_built_in_weights();
        let weights = Some(&mut self.network.weights).filter(|_| is_file);
        let preset = Some(&mut self.isp.preset).filter(|preset| *preset != NO_ISP);
        [
            (key(&["lens"]), &mut self.lens),
            (key(&["sensor"]), &mut self.sensor),
            (key(&["photos"]), &mut self.photos),
            (key(&["data"]), &mut self.data),
        ]
        .into_iter()
        .chain(weights.map(|weights| (key(&["network", "weights"]), weights)))
        .chain(preset.map(|preset| (key(&["isp", "preset"]), preset)))
        .chain(self.detector.weights.as_mut().map(|weights| (key(&["detector", "weights"]), weights)))
        .chain(of_variants)
    }
}

/// Whether the text of an experiment names scores.
fn names_scores(text: &str) -> bool {
    let table: Option<toml::Table> = text.parse().ok();
    table.is_some_and(|all| all.get("scoring").is_some_and(|scoring| scoring.get("scores").is_some()))
}

/// Adds the paths at which two values differ, each with the second value.
fn differences(
    path: &str,
    one: Option<&toml::Value>,
    other: Option<&toml::Value>,
    found: &mut Vec<(String, String)>,
) {
    use toml::Value;
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match (one, other) {
        (Some(Value::Table(a)), Some(Value::Table(b))) => {
            let keys: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            keys.into_iter().for_each(|key| differences(&below(key), a.get(key), b.get(key), found));
        }
        (Some(Value::Array(a)), Some(Value::Array(b))) => {
            let places = 0..a.len().max(b.len());
            places.for_each(|i| differences(&below(&i.to_string()), a.get(i), b.get(i), found));
        }
        _ if one == other => {}
        _ => found.push((path.to_owned(), other.map_or("not there".to_owned(), |v| quote(&v.to_string())))),
    }
}

/// Adds the values below a path by their keys.
fn add_values(path: &str, value: &toml::Value, found: &mut BTreeMap<String, String>) {
    use toml::Value;
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Table(table) => table.iter().for_each(|(key, value)| add_values(&below(key), value, found)),
        Value::Array(all) if all.iter().any(Value::is_table) => {
            all.iter().enumerate().for_each(|(i, value)| add_values(&below(&i.to_string()), value, found));
        }
        _ => drop(found.insert(path.to_owned(), value.to_string())),
    }
}

/// The path of the first key of `whole` that `found` does not have: `psf.grid`, `variant.0.name`.
fn missing_key(found: &serde_json::Value, complete: &serde_json::Value) -> Option<String> {
    use serde_json::Value;
    let pairs: Vec<(String, Option<&Value>, &Value)> = match (found, complete) {
        (Value::Object(found), Value::Object(complete)) => {
            complete.iter().map(|(key, value)| (key.clone(), found.get(key), value)).collect()
        }
        (Value::Array(found), Value::Array(complete)) => {
            complete.iter().enumerate().map(|(i, value)| (i.to_string(), found.get(i), value)).collect()
        }
        _ => return None,
    };
    pairs.into_iter().find_map(|(key, found, complete)| match found {
        None => Some(key),
        Some(found) => missing_key(found, complete).map(|below| format!("{key}.{below}")),
    })
}
