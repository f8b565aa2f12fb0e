//! An experiment: everything that a run depends on, as one TOML file. Every key has a default.

mod check;
mod commented;
mod derived_lens;
mod former_keys;
mod idle_keys;
mod keys;
mod names;
mod plan;
mod python;
mod resolve;
mod scores;
mod settings;
mod size;
mod tables;
mod task_facts;
mod variants;

pub use commented::commented_toml;
pub use derived_lens::{BOX_CENTRE_LENS, PERFECT_LENS, is_derived_lens};
pub use keys::is_input;
pub use names::{
    BUILT_IN_PHOTOS, BlockName, DetectorInput, FieldOfView, LensGoal, NetworkKind, PsfsBy, STREET, StepMethod,
};
pub use plan::{LensSearch, Schedule, Stage, StepRule, Variant, cosine_rate, turn_of};
pub(crate) use python::PYTHON;
pub use python::PythonConfig;
pub use settings::Settings;
pub(crate) use settings::WithSettings;
pub use size::{FULL_BATCH, FULL_STEPS};
pub use tables::{
    CheckpointConfig, ConstraintConfig, DetectorConfig, DevelopmentConfig, ExposureConfig, ExposureSetting,
    IspConfig, Keep, NO_ISP, NetworkConfig, OpticsConfig, PsfConfig, ReadingConfig, SameOf, ScoringConfig,
    SpotConfig, StreetConfig, TrainingConfig, ValidationConfig,
};
pub(crate) use tables::{NO_FILE, OF_THE_WHOLE_FRAME, places_of};
pub use task_facts::{NetworkRole, PicturesKey, TaskFacts};
pub use variants::{Goal, SCENE, ScheduleConfig, StageConfig, VariantConfig, standard_variants};

use petzval_base::FileError;
use petzval_learn::dataset::{Classes, ObjectClass};
use petzval_learn::loss::ImageLoss;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{DesignError, Result};

/// The task of an experiment that names none.
const DEFAULT_TASK: &str = "image-quality";

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
    /// `built-in`, or a folder of pictures, a folder of tar shards, a shard, or a list with one path a line.
    pub photos: String,
    /// Labelled scenes: `street`, or a folder of pictures with boxes in COCO format, or with label images for a segmentation.
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
    /// Classes in Python: a network or a loss of one's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub python: Option<PythonConfig>,
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
    /// How pictures are read.
    pub reading: ReadingConfig,
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
            python: None,
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
            reading: ReadingConfig::default(),
            class: Vec::new(),
            variant: standard_variants(),
        }
    }
}

impl Experiment {
    /// Reads an experiment without a check. Errors name line, key, value and a hint.
    pub(crate) fn read(text: &str) -> Result<Self, FileError> {
        let read = FileError::read_toml(text).map_err(|error| former_keys::with_hint(error, text))?;
        // A run writes its experiment as TOML, which cannot hold every number of 64 bits without a sign.
        FileError::read_toml::<toml::Table>(text)?;
        Ok(read)
    }

    /// The classes of its task.
    pub fn classes(&self) -> Classes {
        self.class.clone().into()
    }

    /// The experiment as a file that [`Tasks::parse`](crate::task::Tasks::parse) reads back to the same values.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self)
            .map_err(|e| DesignError::Unwritable { what: "the experiment", problem: e.to_string() })
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
}
