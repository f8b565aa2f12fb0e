//! `experiment run-all`: every built-in experiment with several seeds, and the page that compares them.

use std::path::{Path, PathBuf};

use petzval_base::Cancel;
use petzval_design::experiment::Experiment;
use petzval_design::inputs::check_inputs;
use petzval_design::run::{RunFolder, RunRecord};
use petzval_design::setup::Setup;
use petzval_files::write_lens;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::AsUnit;
use crate::compare;
use crate::context::Context;
use crate::design::{self, Changes, NewRun, Resume, Run};
use crate::error::{JobError, Result};
use crate::event::WarningKind;
use crate::results::check_folder;

petzval_base::parameters! {
    /// What to run.
    pub struct Request {
        /// Folder for the runs, `EXPERIMENT-seed-SEED` each, and the page. Finished runs in it are kept, interrupted ones go on.
        out: PathBuf = PathBuf::from("runs");
        /// Experiments by name or path; all built-in ones if none is named.
        experiments: Vec<String> = Vec::new();
        /// Seeds. All experiments have a run of the first before any has one of the second.
        seeds: Vec<u64> = vec![1, 2, 3];
        /// What differs from the files of the experiments; its seed is ignored.
        changes: Changes = Changes::default();
        /// Where tensors live.
        device: String = crate::usual::device();
    }
}

/// How it went.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Runs that ended with an error, each with its message.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub failed: Vec<(PathBuf, String)>,
    /// The comparison of all finished runs; none if there are none.
    pub compared: Option<compare::Response>,
}

/// The built-in experiments that compare cameras: with a single one there is no table to make.
fn comparisons(context: &Context) -> Result<Vec<String>> {
    let names = context.assets.names("experiments").into_iter();
    let compares = |name: &str| Ok(context.assets.experiment(name)?.variant.len() > 1);
    names
        .filter_map(|name| match compares(name) {
            Ok(false) => None,
            Ok(true) => Some(Ok(name.to_owned())),
            Err(error) => Some(Err(error)),
        })
        .collect()
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit {
    seed: Some(|request, seed| request.seeds = vec![seed]),
    place: Some(|request, folder| request.out = folder.to_owned()),
    // The same request keeps finished runs, and goes on with the others.
    going_on: Some(|request, folder| {
        folder.is_dir().then(|| Request { out: folder.to_owned(), ..request.clone() })
    }),
    ..AsUnit::PLAIN
};

/// Runs what is not finished yet, then compares all that is. Once it is cancelled it compares what is finished, and the same request goes on.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    if request.seeds.is_empty() {
        return Err(JobError::input("there is no seed", "give one at least"));
    }
    let names =
        if request.experiments.is_empty() { comparisons(context)? } else { request.experiments.clone() };
    let pairs: Vec<(&String, u64)> =
        request.seeds.iter().flat_map(|seed| names.iter().map(move |name| (name, *seed))).collect();
    // What is wrong shows before hours are spent.
    check_folder(&request.out, std::iter::empty::<&str>(), context)?;
    for name in &names {
        design::resolved(&new_run(request, name, request.seeds[0], &request.out), context)?;
    }
    for (i, (name, seed)) in pairs.iter().enumerate() {
        let root = root_of(request, name, *seed);
        if pairs[..i].iter().any(|(other, seed)| root_of(request, other, *seed) == root) {
            let message =
                format!("{name}, seed {seed}: another run of this command has the folder {}", root.display());
            return Err(JobError::input(
                message,
                "give each experiment another file name, and each seed once",
            ));
        }
        refuse_other_run(&root, &new_run(request, name, *seed, &root), request, context)?;
    }
    let (mut finished, mut failed) = (Vec::new(), Vec::new());
    let mut is_stopped = false;
    for (i, (name, seed)) in pairs.iter().enumerate() {
        let root = root_of(request, name, *seed);
        if !is_finished(&root) {
            if context.is_cancelled() {
                is_stopped = true;
                break;
            }
            context.note(format!("run {} of {}: {name}, seed {seed}", i + 1, pairs.len()));
            match design::run(&one(request, name, *seed, &root), context) {
                Ok(_) => {}
                Err(JobError::Stopped(_)) => {
                    is_stopped = true;
                    break;
                }
                Err(error) => {
                    context.warning(WarningKind::RunFailed, format!("{}: {error}", root.display()));
                    failed.push((root, error.to_string()));
                    continue;
                }
            }
        }
        finished.push(root);
    }
    let compared = if finished.is_empty() {
        None
    } else {
        let out = request.out.join("comparison.html");
        // The page is made anew with every run that was added.
        let context = context.clone().overwriting(true).with_cancellation(Cancel::default());
        match compare::run(
            &compare::Request { runs: finished, out: out.clone(), ..compare::Request::default() },
            &context,
        ) {
            Ok(compared) => Some(compared),
            Err(error) => {
                failed.push((out, error.to_string()));
                None
            }
        }
    };
    let response = Response { failed, compared };
    if is_stopped {
        let stopped = context.stopped("stopped");
        let stopped = if request.out.is_dir() { stopped.keeping(&request.out) } else { stopped };
        return Err(stopped.going_on_with(request).with_response(&response).into());
    }
    Ok(response)
}

/// Begins a run, or goes on with what is there of it.
fn one(request: &Request, name: &str, seed: u64, root: &Path) -> design::Request {
    let run = match RunFolder::open(root) {
        Ok(_) => Run::Resume(Resume { run: root.to_owned(), ..Resume::default() }),
        Err(_) => Run::New(new_run(request, name, seed, root)),
    };
    design::Request { run, device: request.device.clone(), ..design::Request::default() }
}

fn new_run(request: &Request, name: &str, seed: u64, root: &Path) -> NewRun {
    NewRun {
        experiment: name.into(),
        out: Some(root.to_owned()),
        changes: Changes { seed: Some(seed), ..request.changes.clone() },
    }
}

/// The folder of a run.
fn root_of(request: &Request, name: &str, seed: u64) -> PathBuf {
    request.out.join(format!("{}-seed-{seed}", stem(name)))
}

/// Refuses a folder that holds a run of another experiment, with another budget or from other inputs. Its figures would pass for those of
/// the requested run. Lens, sensor and most other inputs are copies in a run's folder: their names differ, and their content is compared.
fn refuse_other_run(root: &Path, new: &NewRun, request: &Request, context: &Context) -> Result<()> {
    let Ok(run) = RunFolder::open(root) else { return Ok(()) };
    let Some(record) = RunRecord::read(&run)? else { return Ok(()) };
    let wanted = design::resolved(new, context)?;
    let unnamed = |mut experiment: Experiment| {
        experiment.inputs_mut().for_each(|(_, name)| name.clear());
        experiment
    };
    let hint = "choose another folder with --out, or request the same run";
    if let Some((key, there)) = unnamed(wanted.clone()).differences(&unnamed(record.config)).first() {
        let message =
            format!("{}: the run there differs from the requested one: its {key} is {there}", root.display());
        return Err(JobError::input(message, hint));
    }
    // The lens of the experiment itself may be that of none of its cameras.
    let lens = write_lens(&context.assets.import(&wanted.lens)?.file);
    if petzval_base::read_text(run.nominal_lens()).is_ok_and(|there| there != lens) {
        let message = format!("{}: the run there has another lens than {}", root.display(), wanted.lens);
        return Err(JobError::input(message, hint));
    }
    let setup = Setup::new(wanted, &context.assets, context.device(&request.device)?)?;
    check_inputs(&setup, &run).map(|_| ()).map_err(|error| JobError::input(error.to_string(), hint))
}

fn is_finished(root: &Path) -> bool {
    RunFolder::open(root).is_ok_and(|run| run.metrics().is_file())
}

fn stem(name: &str) -> String {
    Path::new(name).file_stem().map_or_else(|| name.to_owned(), |s| s.to_string_lossy().into_owned())
}
