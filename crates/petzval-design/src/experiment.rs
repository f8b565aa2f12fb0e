//! An experiment: everything that a run depends on, as one TOML file.

use petzval_base::FileError;
use petzval_camera::sensor::{Exposure, NoiseMode};
use petzval_learn::loss::ImageLoss;
use petzval_optics::constraint::Clearances;
use petzval_optics::psf::PsfKind;
use serde::{Deserialize, Serialize};

use crate::block::BlockName;
use crate::error::DesignError;
use crate::variant::{Variant, variants};

/// A joint design of lens and network, and the two controls it is compared with.
///
/// Names of lenses and sensors are those of the built-in library, or paths of files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Title of the report.
    pub name: String,
    /// What the camera is for.
    pub task: TaskKind,
    /// The nominal lens.
    pub lens: String,
    /// The sensor.
    pub sensor: String,
    /// `built-in`, or a folder of pictures.
    pub photos: String,
    /// Seed of everything random.
    pub seed: u64,
    /// How the picture is exposed, the same for every camera.
    pub exposure: ExposureConfig,
    /// Point-spread functions.
    pub psf: PsfConfig,
    /// The network.
    pub network: NetworkConfig,
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
    /// How often the run can be resumed from.
    pub checkpoint: CheckpointConfig,
    /// The cameras that are made and compared, in this order.
    #[serde(default = "standard_variants")]
    pub variant: Vec<VariantConfig>,
}

/// A camera of the comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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

/// Blocks that move for one goal. What a stage leaves out comes from the experiment's tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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

/// What a stage improves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Goal {
    /// The objective of the experiment.
    #[default]
    Task,
    /// The RMS spot of the lens, whatever the rest of the camera is.
    Spot,
}

/// How a block steps in one stage, where that differs from the experiment's tables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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

/// What the camera is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TaskKind {
    /// A picture for people to look at, made by a network from the developed raw frame.
    ImageQuality,
}

/// Exposure of every camera of the experiment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExposureConfig {
    /// Photoelectrons that white gives in a green pixel on the axis.
    pub white_e: f32,
    /// Exposure time, s.
    pub time_s: f32,
    /// Linear analogue gain.
    pub linear_gain: f32,
}

/// How PSFs are made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PsfConfig {
    /// Rays or waves.
    #[serde(default)]
    pub kind: PsfKind,
    /// Number of fields from the axis to the sensor's corner.
    pub fields: usize,
    /// Wavelengths of the red, green and blue channel, um.
    pub wavelengths_um: [f64; 3],
    /// Cells a side of a PSF.
    pub grid: usize,
    /// Cell size, um.
    pub pitch_um: f64,
    /// Patches of constant PSF on the sensor: rows, columns.
    pub patches: [usize; 2],
    /// Pupil cells a side while the lens moves.
    pub pupil_cells: usize,
    /// Pupil cells a side for fixed lenses and for scoring.
    pub scoring_pupil_cells: usize,
}

/// The U-Net.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkConfig {
    /// Channels of the first level.
    pub base_channels: usize,
    /// Levels of halved resolution.
    pub levels: usize,
}

/// Training of the network, the same for every camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingConfig {
    /// Network steps of each camera.
    pub steps: usize,
    /// Crops a step.
    pub batch: usize,
    /// Side of a crop, pixels.
    pub crop: usize,
    /// First learning rate of Adam; it falls along a half cosine.
    pub learning_rate: f64,
    /// Learning rate at the end over that at the start.
    pub final_learning_rate: f64,
    /// How noise is sampled and differentiated.
    pub noise: NoiseMode,
    /// Weight of the network's proximal term.
    #[serde(default)]
    pub proximal: f64,
}

/// How the lens moves for the task.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpticsConfig {
    /// Lens steps, spread evenly over the first part of the network's training.
    pub steps: usize,
    /// Share of the network's training during which the lens moves, 0..1; then it rests.
    pub moving_share: f64,
    /// First learning rate of Adam in the bounded coordinates (rad of the bounding sine).
    pub learning_rate: f64,
    /// Learning rate at the end over that at the start.
    pub final_learning_rate: f64,
    /// Half-range of the image plane around the paraxial focus, mm.
    pub defocus_mm: f64,
    /// Weight of the proximal term of the lens, per squared coordinate.
    #[serde(default)]
    pub proximal: f64,
}

/// How the lens moves for its RMS spot alone, within the same bounds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpotConfig {
    /// Lens steps.
    pub steps: usize,
    /// First learning rate of Adam in the bounded coordinates.
    pub learning_rate: f64,
    /// Learning rate at the end over that at the start.
    pub final_learning_rate: f64,
}

/// Manufacturing constraints as penalties.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstraintConfig {
    /// Weight of the penalty in the loss, 1/mm^2.
    pub weight: f64,
    /// Least edge thickness of an element, mm.
    pub element_edge_mm: f64,
    /// Least air gap, mm.
    pub air_gap_mm: f64,
    /// Least distance of the last vertex from the image, mm.
    pub back_focal_mm: f64,
    /// How far the image of the sensor corner's field may move from where the nominal lens has it, as a share of
    /// its height: the field of view is held.
    pub distortion_tolerance: f64,
}

/// Scoring on held-out pictures with exact noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScoringConfig {
    /// Each held-out picture is scored at this many places squared, on a grid over a quadrant of the sensor, from its
    /// centre to its corner.
    pub places_per_side: usize,
    /// Side of a scored crop, pixels.
    pub crop: usize,
    /// Names of the scores, see `petzval_learn::score`.
    #[serde(default = "standard_scores")]
    pub scores: Vec<String>,
}

/// The scores that results of image quality are published in.
pub fn standard_scores() -> Vec<String> {
    ["one_minus_lpips", "psnr_db", "ssim"].map(str::to_owned).to_vec()
}

/// Checkpoints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckpointConfig {
    /// Steps between checkpoints.
    pub every: usize,
    /// Checkpoints kept.
    pub keep: usize,
}

impl ExposureConfig {
    /// As the sensor takes it.
    pub fn exposure(&self) -> Exposure {
        Exposure { white_e: self.white_e, time_s: self.time_s, linear_gain: self.linear_gain }
    }
}

impl ConstraintConfig {
    /// The clearances without their weight.
    pub fn clearances(&self) -> Clearances {
        Clearances {
            element_edge_mm: self.element_edge_mm,
            air_gap_mm: self.air_gap_mm,
            back_focal_mm: self.back_focal_mm,
        }
    }
}

/// A number of the experiment with the range it must lie in.
struct Range {
    table: &'static str,
    key: &'static str,
    value: f64,
    min: f64,
    max: f64,
    hint: &'static str,
}

impl Experiment {
    /// Reads and checks an experiment. Errors name line, key, value and a hint.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let experiment: Self = toml::from_str(text).map_err(|e| FileError::from_toml(text, &e))?;
        experiment.check(text)?;
        Ok(experiment)
    }

    /// The experiment as a file that [`Experiment::parse`] reads back to the same values.
    pub fn to_toml(&self) -> Result<String, DesignError> {
        toml::to_string(self)
            .map_err(|e| DesignError::Unwritable { what: "the experiment", problem: e.to_string() })
    }

    fn check(&self, text: &str) -> Result<(), FileError> {
        for r in self.ranges() {
            if !(r.value >= r.min && r.value <= r.max) {
                let message = format!("must lie between {} and {}", r.min, r.max);
                return Err(FileError::at_key(text, &[r.table, r.key], message).hint(r.hint));
            }
        }
        let moves_lens_for_task =
            |v: &Variant| v.stages.iter().any(|s| s.goal == Goal::Task && s.steps_of(BlockName::Optics) > 0);
        if self.training.noise == NoiseMode::Exact && variants(self).iter().any(moves_lens_for_task) {
            let error =
                FileError::at_key(text, &["training", "noise"], "exact noise has no gradient to the lens");
            return Err(error.hint("write \"dequantised\", or 0 for optics.steps"));
        }
        self.check_variants(text)?;
        if self.loss.l1_weight + self.loss.lpips_weight <= 0.0 {
            let error = FileError::at_key(text, &["loss", "l1_weight"], "all weights of the loss are zero");
            return Err(error.hint("give at least one part a positive weight"));
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

    /// Refuses variants that cannot be made or told apart.
    fn check_variants(&self, text: &str) -> Result<(), FileError> {
        let error = |key: &str, message: String| FileError::at_key(text, &["variant", key], message);
        if self.variant.is_empty() {
            let none = FileError::at_key(text, &["variant"], "there are no variants");
            return Err(none.hint("add a [[variant]] with a name and a [[variant.stage]]"));
        }
        let mut known: Vec<&str> = Vec::new();
        for variant in &self.variant {
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
            }
            known.push(name);
        }
        Ok(())
    }

    /// Sets the network steps of every stage that trains for `training.steps` steps, and changes all other steps in proportion,
    /// rounded up.
    pub fn scale_steps(&mut self, network_steps: usize) {
        let share = network_steps as f64 / self.training.steps as f64;
        let scaled = |steps: usize| (steps as f64 * share).ceil() as usize;
        self.optics.steps = scaled(self.optics.steps);
        self.spot.steps = scaled(self.spot.steps);
        self.training.steps = network_steps;
        for stage in self.variant.iter_mut().flat_map(|v| &mut v.stage) {
            let own = [&mut stage.optics, &mut stage.network].into_iter().flatten();
            own.filter_map(|s| s.steps.as_mut()).for_each(|steps| *steps = scaled(*steps));
        }
    }

    /// The experiment with one variant alone, and those from which it starts. `None` if it has none of that name.
    pub fn only(&self, name: &str) -> Option<Self> {
        let mut wanted = vec![self.variant.iter().find(|v| v.name == name)?];
        while let Some(from) = wanted.last().and_then(|v| v.from.as_deref()) {
            wanted.push(self.variant.iter().find(|v| v.name == from)?);
        }
        let is_wanted = |v: &&VariantConfig| wanted.iter().any(|w| w.name == v.name);
        Some(Self { variant: self.variant.iter().filter(is_wanted).cloned().collect(), ..self.clone() })
    }

    fn ranges(&self) -> Vec<Range> {
        let mut all = Vec::new();
        let mut add = |table, key, value, min, max, hint| {
            all.push(Range { table, key, value, min, max, hint });
        };
        let e = &self.exposure;
        add("exposure", "white_e", f64::from(e.white_e), 1.0, 1e7, "photoelectrons of white in green");
        add("exposure", "time_s", f64::from(e.time_s), 1e-6, 1e4, "seconds; 5 ms is 0.005");
        add("exposure", "linear_gain", f64::from(e.linear_gain), 0.1, 1e3, "1 is 0 dB, 31.62 is 30 dB");
        let p = &self.psf;
        add("psf", "fields", p.fields as f64, 2.0, 201.0, "the paper takes 13");
        for w in p.wavelengths_um {
            add("psf", "wavelengths_um", w, 0.2, 20.0, "wavelengths are in um: 550 nm is 0.55");
        }
        add("psf", "grid", p.grid as f64, 16.0, 1024.0, "the paper takes 128");
        add("psf", "pitch_um", p.pitch_um, 0.05, 50.0, "the paper takes 1");
        for n in p.patches {
            add("psf", "patches", n as f64, 1.0, 101.0, "the paper takes 7 x 7");
        }
        for (key, cells) in [("pupil_cells", p.pupil_cells), ("scoring_pupil_cells", p.scoring_pupil_cells)] {
            add("psf", key, cells as f64, 16.0, 1024.0, "32 is quick, 256 is accurate");
        }
        let n = &self.network;
        add("network", "base_channels", n.base_channels as f64, 1.0, 256.0, "16 trains in minutes on a CPU");
        add("network", "levels", n.levels as f64, 1.0, 6.0, "3 or 4");
        let t = &self.training;
        add("training", "steps", t.steps as f64, 1.0, 1e8, "a few hundred on a CPU");
        add("training", "batch", t.batch as f64, 1.0, 1024.0, "2 to 8 on a CPU");
        add("training", "crop", t.crop as f64, 32.0, 1200.0, "64 to 256 pixels");
        add("training", "learning_rate", t.learning_rate, 1e-8, 1.0, "1e-3 is Adam's usual start");
        add("training", "final_learning_rate", t.final_learning_rate, 0.0, 1.0, "a share of the first");
        for (key, weight) in [("l1_weight", self.loss.l1_weight), ("lpips_weight", self.loss.lpips_weight)] {
            add("loss", key, f64::from(weight), 0.0, 1e6, "a weight of 0 leaves the part out");
        }
        let o = &self.optics;
        add("optics", "steps", o.steps as f64, 0.0, 1e8, "0 keeps the lens");
        add("optics", "moving_share", o.moving_share, 0.0, 1.0, "0.7 leaves the network time to settle");
        add("optics", "learning_rate", o.learning_rate, 1e-8, 1.0, "0.01 of a coordinate's range of 3.1");
        add("optics", "final_learning_rate", o.final_learning_rate, 0.0, 1.0, "a share of the first");
        add("optics", "defocus_mm", o.defocus_mm, 1e-3, 10.0, "half-range around the paraxial focus");
        let s = &self.spot;
        add("spot", "steps", s.steps as f64, 0.0, 1e8, "a few hundred");
        add("spot", "learning_rate", s.learning_rate, 1e-8, 1.0, "0.02 of a coordinate's range of 3.1");
        add("spot", "final_learning_rate", s.final_learning_rate, 0.0, 1.0, "a share of the first");
        let c = &self.constraints;
        add("constraints", "weight", c.weight, 0.0, 1e9, "1 is one unit of loss per mm^2");
        for (key, value) in [
            ("element_edge_mm", c.element_edge_mm),
            ("air_gap_mm", c.air_gap_mm),
            ("back_focal_mm", c.back_focal_mm),
        ] {
            add("constraints", key, value, 0.0, 1e3, "a length in mm");
        }
        add("constraints", "distortion_tolerance", c.distortion_tolerance, 0.0, 1.0, "0.003 is 0.3 %");
        add("optics", "proximal", o.proximal, 0.0, 1e6, "0 leaves the proximal term out");
        add("training", "proximal", t.proximal, 0.0, 1e6, "0 leaves the proximal term out");
        add("scoring", "places_per_side", self.scoring.places_per_side as f64, 1.0, 15.0, "3 gives 9 places");
        add("scoring", "crop", self.scoring.crop as f64, 64.0, 1200.0, "LPIPS needs at least 64 pixels");
        add("checkpoint", "every", self.checkpoint.every as f64, 1.0, 1e8, "steps between checkpoints");
        add("checkpoint", "keep", self.checkpoint.keep as f64, 1.0, 1e4, "checkpoints kept");
        all
    }
}
