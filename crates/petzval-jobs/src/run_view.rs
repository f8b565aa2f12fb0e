//! `run-view`: a run at work, stopped or finished, as values: how far it has come, its losses, lenses, cameras and pictures.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use petzval_design::experiment::{BlockName, Stage, Variant};
use petzval_design::pace::TimeLeft;
use petzval_design::report::run_report::read_metrics;
use petzval_design::run::{CameraMetrics, Event, Holder, RunFolder, SCORE};
use petzval_design::run_progress::time_left;
use petzval_design::run_row::{RunFiles, RunRow, finished_cameras, scores_so_far};
use petzval_learn::score::ScoreDescription;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::Result;
use crate::range::check_ranges;

petzval_base::parameters! {
    /// A run, and which of its steps are given.
    pub struct Request {
        /// Most steps that are given; of more, every second, third, and so on of each camera's block.
        most: usize = 4000, "steps", 100..1_000_000, Log, "4000 are as many as a screen shows";
    }
    also {
        /// Folder of the run.
        run: PathBuf = PathBuf::new();
        /// Steps are given that come after this one.
        after: u64 = 0;
    }
}

/// A run as it stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// How it stands, in one row.
    pub row: RunRow,
    /// How long the rest takes at the pace of the latest steps; none before the first step and at the end.
    pub time_left: Option<TimeLeft>,
    /// The process that works on it.
    pub holder: Option<Holder>,
    /// The cameras that it makes, in this order.
    pub variants: Vec<PlannedCamera>,
    /// Steps after the one of the request.
    pub steps: Vec<Step>,
    /// Of each camera's block, one in so many steps is given.
    pub every: usize,
    /// The lenses of its history, by step.
    pub lenses: Vec<StepLens>,
    /// The cameras that are finished, with their figures.
    pub cameras: Vec<CameraMetrics>,
    /// The scores of the cameras, in the order of the experiment.
    pub scores: Vec<ScoreDescription>,
    /// Names of the pictures in its folder `pictures`.
    pub pictures: Vec<String>,
    /// Its report, once it is written.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub report: Option<PathBuf>,
    /// Its resolved experiment.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub config: PathBuf,
}

/// A camera that a run makes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlannedCamera {
    /// Its name.
    pub name: String,
    /// The first step of the run that belongs to it.
    pub first_step: u64,
    /// Its stages.
    pub stages: Vec<PlannedStage>,
    /// Whether it is finished.
    pub is_finished: bool,
}

/// A stage of a camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlannedStage {
    /// `spot` or `restored` for a lens alone, `task` for the objective of the experiment.
    pub goal: String,
    /// Steps of each block that moves.
    pub steps: BTreeMap<String, usize>,
    /// Most iterations of a lens alone, with the rounds of its search; 0 for the task.
    pub iterations: usize,
}

/// A step of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Step {
    /// Its number, from 1.
    pub step: u64,
    /// Its camera.
    pub camera: String,
    /// The block that moved; the goal of a lens alone; or `score`.
    pub block: String,
    /// Losses by name, before the step; those of a score or a validation, after it. What is no number is null.
    pub losses: BTreeMap<String, Option<f64>>,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// A lens of the history of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StepLens {
    /// The step after which it was written.
    pub step: u64,
    /// Its camera; empty if the step is not in the log.
    pub camera: String,
    /// Its file.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub lens: PathBuf,
}

/// Looks at the run. Nothing in its folder is changed.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    let files = RunFiles::read(&request.run, &context.assets)?;
    let row = files.row();
    let RunFiles { folder, record, experiment, events } = files;
    let (experiment, events) = (experiment?, events?);
    let variants = experiment.variants();
    let cameras = finished_cameras(&folder, &experiment)?;
    let scores = if folder.metrics().is_file() {
        read_metrics(&folder)?.scores
    } else {
        scores_so_far(record?.as_ref(), &experiment)
    };
    let (steps, every) = thinned(&events, request);
    Ok(Response {
        row,
        time_left: time_left(&folder, &variants, &events),
        holder: folder.holder(),
        variants: planned(&variants, &cameras),
        steps,
        every,
        lenses: lenses(&folder, &events),
        cameras,
        scores,
        pictures: names_in(&folder.picture(""), ".png"),
        report: Some(folder.report()).filter(|report| report.is_file()),
        config: folder.config(),
    })
}

/// The cameras with their stages. Steps of a camera follow those of the cameras before it, with one for its score.
fn planned(variants: &[Variant], finished: &[CameraMetrics]) -> Vec<PlannedCamera> {
    let mut first_step = 1;
    let mut all = Vec::with_capacity(variants.len());
    for variant in variants {
        let camera = PlannedCamera {
            name: variant.name.clone(),
            first_step,
            stages: variant.stages.iter().map(stage).collect(),
            is_finished: finished.iter().any(|camera| camera.camera == variant.name),
        };
        first_step += variant.stages.iter().map(|stage| stage.steps() as u64).sum::<u64>() + 1;
        all.push(camera);
    }
    all
}

fn stage(of: &Stage) -> PlannedStage {
    let (goal, iterations) = match of {
        Stage::Lens { goal, iterations, search } => (goal.event(), iterations + search.rounds),
        Stage::Task(_) => ("task", 0),
    };
    let moved = BlockName::ALL.into_iter().filter(|block| of.steps_of(*block) > 0);
    let steps = moved.map(|block| (block.name().to_owned(), of.steps_of(block)));
    PlannedStage { goal: goal.to_owned(), steps: steps.collect(), iterations }
}

/// The steps after the one of the request, and one in how many they are. Scores and validations are always given.
fn thinned(events: &[Event], request: &Request) -> (Vec<Step>, usize) {
    let every = events.len().div_ceil(request.most).max(1);
    let mut seen: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    let mut steps = Vec::new();
    for event in events {
        let count = seen.entry((&event.camera, &event.block)).or_default();
        let is_one_of_them = count.is_multiple_of(every);
        *count += 1;
        let is_rare = event.block == SCORE || !event.losses.contains_key("total");
        if event.step > request.after && (is_one_of_them || is_rare) {
            let finite = |(name, value): (&String, &f64)| (name.clone(), value.is_finite().then_some(*value));
            steps.push(Step {
                step: event.step,
                camera: event.camera.clone(),
                block: event.block.clone(),
                losses: event.losses.iter().map(finite).collect(),
                seconds: event.seconds,
            });
        }
    }
    (steps, every)
}

/// The lenses of the folder `lens`, by step.
fn lenses(folder: &RunFolder, events: &[Event]) -> Vec<StepLens> {
    let cameras: BTreeMap<u64, &str> =
        events.iter().map(|event| (event.step, event.camera.as_str())).collect();
    let step_of = |name: &String| name.strip_prefix("step-")?.strip_suffix(".toml")?.parse::<u64>().ok();
    let mut steps: Vec<u64> =
        names_in(&folder.root().join("lens"), ".toml").iter().filter_map(step_of).collect();
    steps.sort_unstable();
    let lens = |step| StepLens {
        step,
        camera: cameras.get(&step).map_or_else(String::new, |camera| (*camera).to_owned()),
        lens: folder.lens_at_step(step),
    };
    steps.into_iter().map(lens).collect()
}

/// Names of the files in a folder with an ending, in the order of the alphabet.
fn names_in(folder: &Path, ending: &str) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.retain(|name| name.ends_with(ending));
    names.sort();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_steps_one_in_so_many_of_each_block_is_given_and_every_score() {
        let event = |step: u64, block: &str, loss: &str| Event {
            step,
            camera: "a".to_owned(),
            block: block.to_owned(),
            losses: BTreeMap::from([(loss.to_owned(), if step == 4 { f64::NAN } else { 1.0 })]),
            lowered: Vec::new(),
            learning_rate: 0.1,
            seconds: 1.0,
        };
        let mut events: Vec<Event> = (1..=400).map(|step| event(step, "network", "total")).collect();
        events.push(event(401, SCORE, "psnr_db"));
        let given = |most, after| {
            let (steps, every) = thinned(&events, &Request { most, after, ..Request::default() });
            (steps.iter().map(|step| step.step).collect::<Vec<_>>(), every)
        };
        assert_eq!(given(4000, 398), (vec![399, 400, 401], 1));
        let (steps, every) = given(100, 0);
        assert_eq!((steps.len(), every), (81, 5));
        assert_eq!((steps[0], steps[1], steps[80]), (1, 6, 401));
        // What follows fits to what was given before.
        assert_eq!(given(100, 396).0, [401]);
        let (steps, _) = thinned(&events, &Request::default());
        assert_eq!(steps[3].losses["total"], None);
    }
}
