//! What a sweep will cost: from units that are finished, or from one unit that is timed.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use cpu_time::ProcessTime;
use petzval_base::simd::level;
use petzval_design::experiment::{BlockName, Experiment};
use petzval_design::run::read_events;
use petzval_jobs::design::{self, Changes, Request, Run};
use petzval_jobs::{Context, JobError, Result, Stopped, TemporaryFolder};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::kept::KeptSweep;
use super::plan::{DESIGN, Plan, PlannedUnit};
use crate::store::{Outcome, RunOptions, Seen, State, Store, StoredResult, run_unit};
use crate::unit::Unit;

/// Network steps of a design that is timed.
const STEPS: usize = 4;

/// The file that makes a folder a store.
const STORE: &str = "store.json";

/// What a sweep will cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Estimate {
    /// Units whose result is there already.
    pub done: usize,
    /// CPU time of the units that are left, s.
    pub cpu_seconds: f64,
    /// Disk space of the units that are left, GB.
    pub disk_gb: f64,
    /// What the estimate was made from, in words.
    pub basis: String,
}

/// Estimates what is left of a sweep.
///
/// Units of the sweep that the store has a result of give the mean. Otherwise the first unit is timed in a folder of its own, which is removed
/// afterwards. A design is made with a few network steps, which takes a minute or two; every unit then costs by its own number of steps. A key
/// that makes single steps longer, such as `training.batch`, is not seen. A unit of any other job is run whole, and every unit counts as much.
///
/// Fails if the first unit cannot be run, and with [`JobError::Stopped`] if it is cancelled.
pub fn estimate(plan: &Plan, kept: &KeptSweep, store: &Path, context: &Context) -> Result<Estimate> {
    let mut costs = Vec::new();
    if store.join(STORE).is_file() {
        let store_there = Store::open(store)?;
        let status = super::status::status(kept, store, &mut Seen::default(), context.cancel())?;
        for unit in status.units.iter().filter(|unit| unit.state == State::Done) {
            let folder = store_there.root().join(&unit.key);
            costs.push((unit.cpu_seconds.unwrap_or(0.0), bytes_of(&folder)));
        }
    }
    let (done, all) = (costs.len(), plan.units.len());
    if done > 0 {
        let mean = |of: fn(&(f64, u64)) -> f64| costs.iter().map(of).sum::<f64>() / done as f64;
        let left = (all - done) as f64;
        return Ok(Estimate {
            done,
            cpu_seconds: left * mean(|cost| cost.0),
            disk_gb: left * mean(|cost| cost.1 as f64) / 1e9,
            basis: format!("the mean of {done} finished units"),
        });
    }
    let Some(first) = plan.units.first() else {
        return Err(JobError::input("the sweep has no unit", "let a key vary in [grid], [list] or [random]"));
    };
    if plan.job != DESIGN {
        let (cpu_seconds, bytes) = cost_of(first, context)?;
        return Ok(Estimate {
            done,
            cpu_seconds: all as f64 * cpu_seconds,
            disk_gb: all as f64 * bytes as f64 / 1e9,
            basis: format!("the unit `{}`, timed here", first.name),
        });
    }
    let timed = timed(&first.call.request, context)?;
    let mut seconds = 0.0;
    for unit in &plan.units {
        seconds += timed.seconds_of(&experiment_of(&unit.call.request, context)?);
    }
    Ok(Estimate {
        done,
        cpu_seconds: seconds,
        disk_gb: all as f64 * timed.bytes as f64 / 1e9,
        basis: format!("the unit `{}` with {STEPS} network steps, timed here", first.name),
    })
}

/// CPU seconds and bytes of a unit, which is run whole in a store of its own that is removed afterwards.
fn cost_of(first: &PlannedUnit, context: &Context) -> Result<(f64, u64)> {
    let folder = own_folder()?;
    let store = Store::open_or_new(&folder.path().join("store"))?;
    // This process computes with its own instruction set, whatever that of the sweep is.
    let unit = Unit { simd: level().to_owned(), ..Unit::new(&first.name, first.call.clone()) };
    context.note(format!("timing the unit `{}`, which is run to its end", first.name));
    let error = match run_unit(&unit, &store, &context.silent(), RunOptions::default())? {
        Outcome::Done(result) | Outcome::There(result) => {
            let StoredResult { key, cost, .. } = *result;
            return Ok((cost.all_cpu_seconds, bytes_of(&store.folder(&key))));
        }
        Outcome::Stopped(_) => return Err(stopped()),
        Outcome::Elsewhere => return Err(JobError::failed("another process has the unit that is timed")),
        Outcome::Failed(failure) => failure.error,
        Outcome::Damaged(error) => *error,
    };
    let message = format!("the unit `{}`, which was timed, failed: {}", first.name, error.in_words());
    let hint = "let a unit that can be run come first, or run the sweep without --dry-run".to_owned();
    Err(JobError::input(message, if error.hint.is_empty() { hint } else { error.hint }))
}

/// A folder for the unit that is timed. It is removed when the value is dropped.
fn own_folder() -> Result<TemporaryFolder> {
    TemporaryFolder::sweep_left();
    TemporaryFolder::new("estimate")
        .map_err(|e| JobError::failed(format!("a folder for the unit that is timed: {e}")))
}

/// How the estimate ends that was cancelled: the folder of its unit is removed.
fn stopped() -> JobError {
    Stopped::new("stopped while a unit was timed; nothing is written").into()
}

/// What a short run has shown.
struct Timed {
    /// CPU seconds of a step by camera and block.
    of_step: BTreeMap<(String, String), f64>,
    /// CPU seconds of all that does not depend on the number of steps.
    rest: f64,
    /// Bytes of its folder.
    bytes: u64,
}

impl Timed {
    /// CPU seconds of the unit of an experiment.
    fn seconds_of(&self, experiment: &Experiment) -> f64 {
        let of_block = |block: &str| {
            let all: Vec<f64> = self
                .of_step
                .iter()
                .filter(|((_, other), _)| other == block)
                .map(|(_, seconds)| *seconds)
                .collect();
            if all.is_empty() { 0.0 } else { all.iter().sum::<f64>() / all.len() as f64 }
        };
        let steps = experiment.variants().into_iter().flat_map(|variant| {
            BlockName::ALL.into_iter().map(move |block| {
                (variant.name.clone(), block.name().to_owned(), variant.task_steps_of(block))
            })
        });
        let of_steps: f64 = steps
            .map(|(camera, block, steps)| {
                let known = self.of_step.get(&(camera, block.clone())).copied();
                steps as f64 * known.unwrap_or_else(|| of_block(&block))
            })
            .sum();
        self.rest + of_steps
    }
}

/// Makes a unit with a few steps and times its parts.
fn timed(request: &Value, context: &Context) -> Result<Timed> {
    let folder = own_folder()?;
    let request: Request =
        serde_json::from_value(request.clone()).map_err(|e| JobError::failed(e.to_string()))?;
    let Run::New(new) = request.run else {
        return Err(JobError::failed("a unit of a sweep begins a new run"));
    };
    let root = folder.path().join("run");
    let changes = Changes { steps: Some(STEPS), ..Changes::default() };
    let new = design::NewRun { out: Some(root.clone()), changes, ..new };
    let request = Request { run: Run::New(new), ..Request { device: request.device, ..Request::default() } };
    context.note("timing a unit with a few steps");
    let (cpu, wall) = (ProcessTime::now(), Instant::now());
    // Its steps are no steps of a unit: nobody is to take them for that.
    design::run(&request, &context.silent()).map_err(|error| match error {
        JobError::Stopped(_) => stopped(),
        other => other,
    })?;
    let (cpu, wall) = (cpu.elapsed().as_secs_f64(), wall.elapsed().as_secs_f64());
    let events = read_events(&root.join("events.jsonl")).map_err(JobError::from)?;
    let mut steps: BTreeMap<(String, String), Vec<f64>> = BTreeMap::new();
    for event in &events {
        if BlockName::ALL.iter().any(|block| block.name() == event.block) {
            steps.entry((event.camera.clone(), event.block.clone())).or_default().push(event.seconds);
        }
    }
    let per_wall = cpu / wall.max(1e-9);
    let of_step: BTreeMap<_, _> =
        steps.iter().map(|(key, seconds)| (key.clone(), usual_step(seconds) * per_wall)).collect();
    let in_steps: f64 = steps.iter().map(|(key, seconds)| of_step[key] * seconds.len() as f64).sum();
    Ok(Timed { of_step, rest: (cpu - in_steps).max(0.0), bytes: bytes_of(&root) })
}

/// Seconds of a step by those of the first few: without the first one, which also fills memory and caches.
fn usual_step(seconds: &[f64]) -> f64 {
    let usual = seconds.get(1..).filter(|later| !later.is_empty()).unwrap_or(seconds);
    usual.iter().sum::<f64>() / usual.len() as f64
}

/// The experiment that the request of a unit holds.
fn experiment_of(request: &Value, context: &Context) -> Result<Experiment> {
    let text = request["run"]["new"]["experiment"]["toml"].as_str().unwrap_or_default();
    context.assets.tasks().parse(text).map_err(|e| JobError::failed(e.to_string()))
}

/// Bytes of all files below a folder.
fn bytes_of(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| match entry.metadata() {
            Ok(about) if about.is_dir() => bytes_of(&entry.path()),
            Ok(about) => about.len(),
            Err(_) => 0,
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use petzval_jobs::{Call, Silent, built_in_assets};
    use serde_json::json;

    use super::*;

    #[test]
    fn a_unit_of_a_job_is_timed_whole_and_one_that_fails_is_named() {
        let context = Context::new(built_in_assets(), Arc::new(Silent));
        let unit = |lens: &str| PlannedUnit {
            name: "first".to_owned(),
            values: vec![json!(lens)],
            variant: None,
            seed: None,
            call: Call::new("lens-show", json!({"lens": lens})),
        };
        let (cpu_seconds, bytes) = cost_of(&unit("cooke-triplet-nominal"), &context).unwrap();
        // The folder of a unit holds its claim, its log and its result.
        assert!(cpu_seconds >= 0.0 && bytes > 500, "{cpu_seconds} s, {bytes} bytes");
        let folder = tempfile::tempdir().unwrap();
        let no_lens = folder.path().join("lens.toml");
        std::fs::write(&no_lens, "name = \"x\"\n").unwrap();
        let failed = cost_of(&unit(no_lens.to_str().unwrap()), &context).unwrap_err().report();
        assert!(failed.message.contains("the unit `first`, which was timed, failed: "), "{failed:?}");
        assert!(!failed.hint.is_empty(), "{failed:?}");
    }

    #[test]
    fn the_first_step_of_a_camera_is_none_of_the_usual_ones() {
        assert_eq!((usual_step(&[9.0, 2.0, 4.0]), usual_step(&[9.0])), (3.0, 9.0));
    }

    #[test]
    fn a_unit_costs_by_its_own_steps_and_what_no_step_changes() {
        let key = |camera: &str, block: &str| (camera.to_owned(), block.to_owned());
        let of_step = BTreeMap::from([
            (key("nominal", "network"), 2.0),
            (key("end-to-end", "network"), 4.0),
            (key("end-to-end", "optics"), 10.0),
        ]);
        let timed = Timed { of_step, rest: 100.0, bytes: 0 };
        let mut experiment = Experiment::default();
        experiment.training.steps = 10;
        experiment.optics.steps = 3;
        // Three cameras of ten network steps; the second one costs the mean of the others.
        assert_eq!(timed.seconds_of(&experiment), 100.0 + 10.0 * (2.0 + 3.0 + 4.0) + 3.0 * 10.0);
    }
}
