//! All runs below a folder in one table, and all units of the stores there.

use std::fs;
use std::path::{Path, PathBuf};

pub use petzval_design::run_row::{RunRow, RunState, is_run};
use petzval_design::run_row::{note_differences, run_row};
use petzval_jobs::{Context, JobError, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::store::{STORE, Seen, Store, UnitState};

/// The folder in which runs are looked for where none is named.
pub const USUAL_FOLDER: &str = "runs";

/// How deep folders are looked into.
const DEEPEST: usize = 12;

/// All runs and units below a folder.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Runs {
    /// Runs outside of stores, by path.
    pub runs: Vec<RunRow>,
    /// Units of stores, by store and name.
    pub units: Vec<UnitRow>,
}

/// A unit of a store; of a store that cannot be read, the store.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UnitRow {
    /// The store.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub store: PathBuf,
    /// Name of the unit; empty where it cannot be read.
    pub name: String,
    /// Its job.
    pub job: String,
    /// `done`, `running`, `stale`, `stopped`, `failed`, `waiting` or `damaged`.
    pub state: String,
    /// Why it failed, or what is damaged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Seconds of the attempt that ended it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Its run, if its job is a design that has begun.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<RunRow>,
}

/// Every run and every unit of a store in a folder and below it; a folder that is a run itself is the only row. A damaged run or unit
/// has a row with the reason. Links are not followed.
pub fn runs_in(folder: &Path, context: &Context) -> Result<Runs> {
    if !folder.is_dir() {
        let what = if folder.exists() { "is no folder" } else { "there is no such folder" };
        return Err(JobError::input(
            format!("{}: {what}", folder.display()),
            "give a folder with runs, such as runs",
        ));
    }
    let (mut found, mut stores) = (Vec::new(), Vec::new());
    collect(folder, 0, &mut found, &mut stores, context)?;
    found.sort();
    stores.sort();
    let mut rows = Vec::with_capacity(found.len());
    for path in found {
        context.check(|| format!("stopped after {} runs", rows.len()))?;
        rows.push(run_row(&path, &context.assets));
    }
    let of_runs = rows.len();
    let mut units = Vec::new();
    for store in stores {
        units.extend(units_of(&store, context)?);
    }
    // Runs of units differ from all others of their title.
    rows.extend(units.iter().filter_map(|unit| unit.run.clone()));
    note_differences(&mut rows);
    let mut own = rows.split_off(of_runs).into_iter();
    for unit in units.iter_mut().filter(|unit| unit.run.is_some()) {
        unit.run = own.next();
    }
    Ok(Runs { runs: rows, units })
}

/// Adds the runs and the stores in a folder and below it. A folder that cannot be read holds none.
fn collect(
    folder: &Path,
    depth: usize,
    found: &mut Vec<PathBuf>,
    stores: &mut Vec<PathBuf>,
    context: &Context,
) -> Result<()> {
    if is_run(folder) {
        found.push(folder.to_path_buf());
        return Ok(());
    }
    if folder.join(STORE).is_file() {
        stores.push(folder.to_path_buf());
        return Ok(());
    }
    context.check(|| "stopped while looking for runs")?;
    if depth == DEEPEST {
        return Ok(());
    }
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            collect(&entry.path(), depth + 1, found, stores, context)?;
        }
    }
    Ok(())
}

/// The units of a store that were ever begun. A store of another version is a row.
fn units_of(root: &Path, context: &Context) -> Result<Vec<UnitRow>> {
    let damaged = |reason: String| UnitRow {
        store: root.to_path_buf(),
        name: String::new(),
        job: String::new(),
        state: "damaged".to_owned(),
        reason: Some(reason),
        seconds: None,
        run: None,
    };
    let (store, keys) = match Store::open(root).and_then(|store| store.keys().map(|keys| (store, keys))) {
        Ok(found) => found,
        Err(error) => return Ok(vec![damaged(error.to_string())]),
    };
    let (mut rows, mut seen) = (Vec::new(), Seen::default());
    for key in keys {
        context.check(|| "stopped while looking at units")?;
        let bare = match store.unit(&key) {
            Ok(unit) => {
                let (name, job) = unit.map_or_else(Default::default, |unit| (unit.name, unit.call.job));
                UnitRow { name, job, state: String::new(), reason: None, ..damaged(String::new()) }
            }
            Err(error) => {
                rows.push(damaged(error.to_string()));
                continue;
            }
        };
        let mut files = None;
        let row = match store.state(&key, &mut seen) {
            Ok(state) => {
                let row = UnitRow { state: state.state().word().to_owned(), ..bare };
                match state {
                    UnitState::Failed(failure) => UnitRow {
                        reason: Some(failure.error.message),
                        seconds: Some(failure.cost.seconds),
                        ..row
                    },
                    UnitState::Damaged(error) => UnitRow { reason: Some(error.message), ..row },
                    UnitState::Done(result) => {
                        files = store.files(&result);
                        UnitRow { seconds: Some(result.cost.seconds), ..row }
                    }
                    _ => row,
                }
            }
            Err(error) => UnitRow { state: "damaged".to_owned(), reason: Some(error.to_string()), ..bare },
        };
        let folder = files.or_else(|| newest_work(&store.folder(&key)));
        let run = folder.filter(|folder| is_run(folder)).map(|folder| run_row(&folder, &context.assets));
        rows.push(UnitRow { run, ..row });
    }
    rows.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(rows)
}

/// The folder in which the latest attempt of a unit works or worked.
fn newest_work(folder: &Path) -> Option<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_work = |path: &PathBuf| {
        path.is_dir() && path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("work-"))
    };
    entries.filter(is_work).max()
}
