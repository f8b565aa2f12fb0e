//! Where a run stands, and what its checkpoints hold of it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use petzval_base::reason_and_hint;
use serde::{Deserialize, Serialize};

use crate::block::Blocks;
use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, Stage, Variant};
use crate::pace::UnitsLeft;
use crate::run::{
    ChangedFile, DigestCheck, Digests, EventLog, EventsDigest, Kept, RunFolder, SCORE, all_checkpoints,
    load_blocks, read_json,
};
use crate::setup::Setup;
use crate::validation::{Course, Validations};

/// The file of a checkpoint that holds the position.
pub(crate) const POSITION_FILE: &str = "position.json";

/// Where a run stands: what a checkpoint holds apart from its blocks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Position {
    /// Steps taken by all blocks of all variants; scoring a variant counts as one.
    pub step: u64,
    /// The variant in work; none when all are made.
    pub variant: Option<String>,
    /// Its stage, from 0.
    pub stage: usize,
    /// Steps that each block has taken in this stage.
    pub taken: BTreeMap<BlockName, usize>,
    /// Steps that each block has taken for the task in earlier stages of the variant.
    pub before: BTreeMap<BlockName, usize>,
    /// What the finished cameras have behind them.
    pub finished: BTreeMap<String, Done>,
    /// The first loss of each block in this stage.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub first_losses: BTreeMap<BlockName, f64>,
    /// How the validations of this stage have gone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub validation: Option<Course>,
    /// Wall-clock seconds of the steps.
    pub seconds: f64,
}

/// What a finished camera has behind it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "KeptDone")]
pub(crate) struct Done {
    /// Stages: fewer than its variant has if the run was extended since.
    pub stages: usize,
    /// Steps that its blocks have taken for the task, in the variants that it started from, too: fewer than planned where
    /// `validation.patience` ended a stage. None if a version finished it that counted planned steps.
    pub steps: Option<BTreeMap<BlockName, usize>>,
}

/// The same as a checkpoint has it; earlier versions kept the stages alone.
#[derive(Deserialize)]
#[serde(untagged)]
enum KeptDone {
    Stages(usize),
    Done { stages: usize, steps: Option<BTreeMap<BlockName, usize>> },
}

impl From<KeptDone> for Done {
    fn from(kept: KeptDone) -> Self {
        match kept {
            KeptDone::Stages(stages) => Self { stages, steps: None },
            KeptDone::Done { stages, steps } => Self { stages, steps },
        }
    }
}

impl Position {
    pub fn taken(&self, block: BlockName) -> usize {
        self.taken.get(&block).copied().unwrap_or(0)
    }

    pub fn before(&self, block: BlockName) -> usize {
        self.before.get(&block).copied().unwrap_or(0)
    }

    /// The variant in work.
    pub fn variant<'s>(&self, setup: &'s Setup) -> Option<&'s Variant> {
        let name = self.variant.as_ref()?;
        setup.variants.iter().find(|v| v.name == *name)
    }

    /// Stages of a variant that its finished camera has behind it.
    pub fn finished(&self, variant: &Variant) -> usize {
        self.finished.get(&variant.name).map_or(0, |done| done.stages)
    }

    /// Steps for the task that the blocks of a finished camera have behind them.
    pub fn steps_behind(&self, camera: &str, setup: &Setup) -> BTreeMap<BlockName, usize> {
        let Some(done) = self.finished.get(camera) else { return BTreeMap::new() };
        let planned = || {
            let variant = setup.variants.iter().find(|v| v.name == camera)?;
            let steps = |block| (block, setup.task_steps_until(variant, done.stages, block));
            Some(BlockName::ALL.into_iter().map(steps).collect())
        };
        done.steps.clone().or_else(planned).unwrap_or_default()
    }

    /// The first variant that has stages left.
    pub fn next<'s>(&self, setup: &'s Setup) -> Option<&'s Variant> {
        setup.variants.iter().find(|v| self.finished(v) < v.stages.len())
    }

    /// Steps that are left to take, scores included.
    pub fn left(&self, setup: &Setup) -> usize {
        let of = |v: &Variant| {
            let (done, taken) = match self.variant.as_ref() == Some(&v.name) {
                true => (self.stage, self.taken.values().sum()),
                false if self.finished(v) == v.stages.len() => return 0,
                false => (self.finished(v), 0),
            };
            v.stages[done..].iter().map(Stage::steps).sum::<usize>() + 1 - taken
        };
        setup.variants.iter().map(of).sum()
    }

    /// The same by what moves: camera by camera, stage by stage.
    pub fn units_left(&self, variants: &[Variant]) -> Vec<UnitsLeft> {
        let of = |v: &Variant| -> Vec<UnitsLeft> {
            let is_at_work = self.variant.as_ref() == Some(&v.name);
            let done = if is_at_work { self.stage } else { self.finished(v) };
            if !is_at_work && done == v.stages.len() {
                return Vec::new();
            }
            let part = |stage: usize, block: &str, units: usize, is_one_step: bool| UnitsLeft {
                camera: v.name.clone(),
                stage,
                block: block.to_owned(),
                units,
                is_one_step,
            };
            let taken = |stage: usize, block: BlockName| {
                if is_at_work && stage == done { self.taken(block) } else { 0 }
            };
            let mut parts = Vec::new();
            for (i, stage) in v.stages.iter().enumerate().skip(done) {
                match stage {
                    Stage::Lens { goal, iterations, search } => {
                        let is_done = taken(i, BlockName::Optics) > 0;
                        let units = if is_done { 0 } else { iterations + search.rounds };
                        parts.push(part(i, goal.event(), units, true));
                    }
                    Stage::Task(_) => parts.extend(BlockName::ALL.into_iter().map(|block| {
                        let units = stage.steps_of(block).saturating_sub(taken(i, block));
                        part(i, block.name(), units, false)
                    })),
                }
            }
            parts.push(part(v.stages.len(), SCORE, 1, false));
            parts.retain(|part| part.units > 0);
            parts
        };
        variants.iter().flat_map(of).collect()
    }

    /// Refuses a position that the run of this setup cannot have at this step.
    pub fn check(&self, setup: &Setup, step: u64) -> Result<(), &'static str> {
        if self.step != step {
            return Err("the checkpoint is of another step than its folder says");
        }
        if setup.variants.iter().any(|v| self.finished(v) > v.stages.len()) {
            return Err("a finished camera has more stages than its variant; has config.toml been changed?");
        }
        let Some(name) = &self.variant else { return Ok(()) };
        let Some(variant) = setup.variants.iter().find(|v| v.name == *name) else {
            return Err("the experiment has no such variant; has config.toml been changed?");
        };
        if self.stage > variant.stages.len() {
            return Err("the variant has fewer stages; has config.toml been changed?");
        }
        let steps = |block: BlockName| variant.stages.get(self.stage).map_or(0, |s| s.steps_of(block));
        if self.taken.iter().any(|(block, taken)| *taken > steps(*block)) {
            return Err("more steps were taken than config.toml states; has it been changed?");
        }
        Ok(())
    }
}

/// What a checkpoint holds.
pub(crate) struct Restored {
    pub position: Position,
    pub blocks: Blocks,
    pub validations: Validations,
    /// The digest of the events until then; none of an earlier version.
    pub events: Option<EventsDigest>,
}

impl Restored {
    /// Reads the checkpoint of a step. Fails if it does not agree with its digests, or is none of this run.
    pub fn read(setup: &Setup, step: u64, folder: &Path, check: &DigestCheck) -> Result<Self> {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        if let Some(change) = check.changes(&format!("checkpoints/{name}"))?.first() {
            return Err(DesignError::Run { path: folder.to_path_buf(), problem: change.to_string() });
        }
        let events = Digests::read(folder)?.and_then(|digests| digests.events);
        let path = folder.join(POSITION_FILE);
        let wrong = |problem: String| DesignError::Run { path: path.clone(), problem };
        let position: Position = read_json(&path)?;
        position.check(setup, step).map_err(|problem| wrong(problem.to_owned()))?;
        let variant = position.variant(setup).or(setup.variants.last());
        let variant = variant.ok_or_else(|| wrong("the experiment has no variants".to_owned()))?;
        let mut blocks = setup.blocks(variant)?;
        let mut validations = Validations::default();
        // Between two cameras nothing is under way, and the checkpoint's numbers are those of the one that finished last.
        if position.variant.is_some() {
            load_blocks(folder, blocks.all_mut(), Kept::NumbersAndProgress)?;
            let keep = setup.experiment.validation.keep;
            validations = Validations::load(folder, position.validation, keep, &blocks)?;
        }
        Ok(Self { position, blocks, validations, events })
    }

    /// Whether its digest of the events agrees with a log; true of an earlier version, which has none.
    pub fn agrees_with(&self, log: &Path) -> Result<bool> {
        self.events.as_ref().map_or(Ok(true), |events| EventLog::agrees(log, events))
    }
}

/// The latest checkpoint with which a run can go on.
pub(crate) struct Latest {
    /// It; none where no checkpoint is whole.
    pub restored: Option<Restored>,
    /// The folders of later ones, each with what is wrong there.
    pub damaged: Vec<(PathBuf, String)>,
}

impl Latest {
    /// Reads the checkpoints of a run, the latest first, until one is whole and has the digest that the events have.
    ///
    /// Where all have another digest, or the log is shorter than at the latest, the events were changed: then it is the latest whole one. So it is in
    /// a finished run, whose events stay as they are, and where the user accepts the change.
    pub fn read(setup: &Setup, run: &RunFolder, check: &DigestCheck) -> Result<Self> {
        let log = run.events();
        let (mut restored, mut damaged) = (None, Vec::new());
        // Whole ones with another digest of the events, and the latest of them.
        let (mut unlike, mut latest_unlike): (Vec<PathBuf>, Option<Restored>) = (Vec::new(), None);
        for (step, folder) in all_checkpoints(run)?.into_iter().rev() {
            match Restored::read(setup, step, &folder, check) {
                Ok(found) if found.agrees_with(&log)? => {
                    restored = Some(found);
                    break;
                }
                Ok(found) => {
                    latest_unlike.get_or_insert(found);
                    unlike.push(folder);
                }
                // A device that has no room for a network is no damage.
                Err(error) if !error.is_damage() => return Err(error),
                // What to do is said for all checkpoints together.
                Err(error) => {
                    let text = error.to_string();
                    damaged.push((folder, reason_and_hint(&text).0.to_owned()));
                }
            }
        }
        let change = ChangedFile { name: "events.jsonl".to_owned(), is_missing: !log.is_file() };
        let length = log.metadata().map_or(0, |log| log.len());
        let until = latest_unlike.as_ref().and_then(|found| found.events.as_ref());
        let is_cut = until.is_some_and(|until| length < until.bytes);
        if restored.is_none() || is_cut || run.metrics().is_file() || check.accepts(&change) {
            return Ok(Self { restored: latest_unlike.or(restored), damaged });
        }
        damaged.extend(unlike.into_iter().map(|folder| {
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let why = format!(
                "checkpoints/{name}/digests.json is not as the run wrote it, or the last events are not: an older checkpoint agrees with events.jsonl; to go \
                 on from the later one, put it back with the events.jsonl that is kept with it, and add `--accept-changed events.jsonl`"
            );
            (folder, why)
        }));
        Ok(Self { restored, damaged })
    }
}

/// The variant in work, or the last one between two cameras.
pub(crate) fn last_variant<'s>(
    setup: &'s Setup,
    position: &Position,
    run: &RunFolder,
) -> Result<&'s Variant> {
    position.variant(setup).or(setup.variants.last()).ok_or_else(|| DesignError::Run {
        path: run.config(),
        problem: "the experiment has no variants".to_owned(),
    })
}
