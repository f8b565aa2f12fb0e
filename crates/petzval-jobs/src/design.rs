//! `design`: the joint optimisation of a camera, and the comparison with its controls.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_design::design_loop::{DesignLoop, Ending, Observer};
use petzval_design::experiment::{BUILT_IN_PHOTOS, Experiment};
use petzval_design::inputs::{check_inputs, keep_inputs};
use petzval_design::run::{CameraMetrics, Event, RunFolder, write_file};
use petzval_design::scoring::Scorer;
use petzval_design::setup::Setup;
use petzval_learn::score::{ScoreDescription, standard_scores};
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::{JobError, json};
use crate::machine::environment;

pub use petzval_design::run::Metrics;

/// The experiment that runs when none is named.
pub const DEFAULT_EXPERIMENT: &str = "cooke-triplet-image-quality";

/// A run to begin, or to go on with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Begin a run, or go on with one.
    pub run: Run,
    /// Where tensors live.
    pub device: String,
}

/// Which run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Run {
    /// A new one.
    New(NewRun),
    /// The one in this folder.
    Resume(PathBuf),
}

/// A run to begin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NewRun {
    /// Experiment file, or the name of a built-in one.
    pub experiment: String,
    /// Folder of the run; `runs/EXPERIMENT-seed-SEED` if none is given.
    #[serde(default)]
    pub out: Option<PathBuf>,
    /// What differs from the experiment's file.
    #[serde(default)]
    pub changes: Changes,
}

/// What differs from the file of an experiment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Changes {
    /// Seed of everything random.
    pub seed: Option<u64>,
    /// Folder of pictures in place of the experiment's.
    pub photos: Option<PathBuf>,
    /// Network steps of each variant in place of `training.steps`; lens steps in proportion. At least 1.
    pub steps: Option<usize>,
    /// Make this variant alone, and those from which it starts.
    pub variant: Option<String>,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// Folder of the run.
    pub run: PathBuf,
    /// Finished or stopped.
    pub ending: RunEnding,
}

/// Finished or stopped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RunEnding {
    /// Every camera is made and scored.
    Finished {
        /// The figures.
        metrics: Box<Metrics>,
        /// The report.
        report: PathBuf,
    },
    /// The run was cancelled; it left a checkpoint at this step.
    Stopped {
        /// Steps taken.
        step: u64,
    },
}

/// Starts or continues a run, until it is finished or cancelled.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    let device = context.device(&request.device)?;
    let (scorer, folder) = match &request.run {
        Run::Resume(root) => {
            let folder = RunFolder::open(root)?;
            let experiment = context.assets.experiment_of_run(&folder)?;
            let setup = Setup::new(experiment, &context.assets, device)?;
            check_inputs(&setup, &folder)?;
            (scorer(setup)?, folder)
        }
        Run::New(new) => {
            let experiment = resolved(new, context)?;
            // Everything is checked before the folder is made, so that a mistake leaves nothing behind.
            let setup = Setup::new(experiment, &context.assets, device)?;
            let scorer = scorer(setup)?;
            let setup = scorer.setup();
            let root = new.out.clone().unwrap_or_else(|| default_root(&new.experiment, &setup.experiment));
            let folder = RunFolder::create(&root)?;
            write_file(&folder.environment(), json(&environment(context))?.as_bytes())?;
            keep_inputs(setup, &context.assets, &folder)?;
            (scorer, folder)
        }
    };
    let setup = scorer.setup().clone();
    let _only_one = folder.lock()?;
    context.note(&setup.experiment.name);
    context.note(format!("run folder: {}", folder.root().display()));
    let mut watch = Watch { context, scores: scorer.scores(), total: 0 };
    let ending = DesignLoop::new(folder.clone(), scorer)?.run(&mut watch, context.cancellation())?;
    let ending = match ending {
        Ending::Stopped(step) => RunEnding::Stopped { step },
        Ending::Finished(metrics) => {
            RunEnding::Finished { report: crate::report::write(&setup, &folder)?, metrics }
        }
    };
    Ok(Response { run: folder.root().to_path_buf(), ending })
}

/// What scores the cameras of an experiment.
pub(crate) fn scorer(setup: Setup) -> Result<Scorer, JobError> {
    let scores = standard_scores(&setup.lpips()?);
    Ok(Scorer::new(Arc::new(setup), scores)?)
}

/// The experiment of a new run, complete: every default and every change is in it.
///
/// Paths are made absolute, so that its text can be run again from any folder.
pub fn resolved(new: &NewRun, context: &Context) -> Result<Experiment, JobError> {
    let mut experiment = context.assets.experiment(&new.experiment)?;
    let changes = &new.changes;
    if let Some(seed) = changes.seed {
        experiment.seed = seed;
    }
    if let Some(photos) = &changes.photos {
        experiment.photos = absolute(photos)?;
    }
    let own = experiment.variant.iter_mut().filter_map(|v| v.lens.as_mut());
    for name in [&mut experiment.lens, &mut experiment.sensor].into_iter().chain(own) {
        if Path::new(name.as_str()).is_file() {
            *name = absolute(Path::new(name.as_str()))?;
        }
    }
    if experiment.photos != BUILT_IN_PHOTOS && Path::new(&experiment.photos).is_dir() {
        experiment.photos = absolute(Path::new(&experiment.photos))?;
    }
    if let Some(steps) = changes.steps {
        if steps == 0 {
            let hint = "give at least one network step";
            return Err(JobError::setting("steps", 0, "nothing to do", hint));
        }
        experiment.scale_steps(steps);
    }
    if let Some(name) = &changes.variant {
        let known: Vec<&str> = experiment.variant.iter().map(|v| v.name.as_str()).collect();
        let unknown = || {
            JobError::setting("variant", name, "no such variant", format!("there are {}", known.join(", ")))
        };
        experiment = experiment.only(name).ok_or_else(unknown)?;
    }
    Ok(experiment)
}

fn absolute(path: &Path) -> Result<String, JobError> {
    let path = std::fs::canonicalize(path).map_err(|error| {
        JobError::input(format!("{}: {error}", path.display()), "give a folder or file that exists")
    })?;
    Ok(path.display().to_string())
}

fn default_root(name: &str, experiment: &Experiment) -> PathBuf {
    let stem = Path::new(name).file_stem().map_or_else(|| "run".into(), |s| s.to_string_lossy().into_owned());
    Path::new("runs").join(format!("{stem}-seed-{}", experiment.seed))
}

/// Reports a run's steps and finished cameras to the watcher of the job.
struct Watch<'a> {
    context: &'a Context,
    scores: Vec<ScoreDescription>,
    total: u64,
}

impl Observer for Watch<'_> {
    fn start(&mut self, done: u64, total: u64) {
        self.total = total;
        self.context.progress(done, total, "");
        if done > 0 {
            self.context.note(format!("going on from step {done} of {total}"));
        }
    }

    fn step(&mut self, event: &Event) {
        let losses: Vec<String> =
            event.losses.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
        let text = format!("{} | {} | {}", event.camera, event.block, losses.join("  "));
        self.context.progress(event.step, self.total, text);
    }

    fn camera(&mut self, m: &CameraMetrics) {
        let scores: Vec<String> = (self.scores.iter())
            .filter_map(|c| {
                m.scores
                    .get(&c.name)
                    .map(|v| format!("{} {v:.*} {}", c.title, c.decimals, c.unit).trim_end().to_owned())
            })
            .collect();
        self.context.note(format!("{}: {}, RMS spot {:.2} um", m.camera, scores.join(", "), m.rms_spot_um));
    }
}
