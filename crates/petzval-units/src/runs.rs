//! All runs below a folder in one table, and all units of the stores there.

use std::collections::{BTreeMap, HashSet};
use std::fs::{self, FileType};
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

impl Runs {
    /// The keys in which a run differs from others of its title, in the order in which they are shown: first those that distinguish it from the runs that
    /// are most like it. Each other run gives a weight of one, evenly over the keys in which the two differ. So one odd run does not hide the keys in
    /// which the others differ.
    pub fn keys_in_order<'r>(&self, row: &'r RunRow) -> Vec<&'r str> {
        let units = self.units.iter().filter_map(|unit| unit.run.as_ref());
        let siblings = self.runs.iter().chain(units).filter(|other| other.experiment == row.experiment);
        let mut weights: BTreeMap<&str, f64> = row.differs.keys().map(|key| (key.as_str(), 0.0)).collect();
        for other in siblings {
            let differ = |key: &&str| row.differs.get(*key) != other.differs.get(*key);
            let keys: Vec<&str> = weights.keys().copied().filter(differ).collect();
            for key in &keys {
                *weights.entry(key).or_default() += 1.0 / keys.len() as f64;
            }
        }
        let mut keys: Vec<(&str, f64)> = weights.into_iter().collect();
        keys.sort_by(|a, b| b.1.total_cmp(&a.1));
        keys.into_iter().map(|(key, _)| key).collect()
    }
}

/// Every run and every unit of a store in a folder and below it; a folder that is a run itself is the only row. A damaged run or unit
/// has a row with the reason. Links to folders are followed one level.
pub fn runs_in(folder: &Path, context: &Context) -> Result<Runs> {
    if !folder.is_dir() {
        let what = if folder.exists() { "is no folder" } else { "there is no such folder" };
        return Err(JobError::input(
            format!("{}: {what}", folder.display()),
            "give a folder with runs, such as runs",
        ));
    }
    let Found { runs, stores, .. } = Found::below(folder, context)?;
    let mut rows = Vec::with_capacity(runs.len());
    for path in runs {
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

/// Runs, stores and links to folders that a search has met.
#[derive(Default)]
struct Found {
    runs: Vec<PathBuf>,
    stores: Vec<PathBuf>,
    links: Vec<PathBuf>,
}

impl Found {
    /// Those in a folder and below it, sorted. A link leads to its folder and to those in it. Links behind a link are not followed, so that none
    /// leads in a circle. What a link and a path without links lead to is found once, by the latter.
    fn below(folder: &Path, context: &Context) -> Result<Self> {
        let mut found = Self::default();
        found.look_in(folder, 0, context)?;
        let mut known: HashSet<PathBuf> =
            found.runs.iter().chain(&found.stores).filter_map(|path| path.canonicalize().ok()).collect();
        found.links.sort();
        for link in std::mem::take(&mut found.links) {
            let mut behind = Self::default();
            behind.look_in(&link, DEEPEST - 1, context)?;
            let mut is_new = |path: &PathBuf| path.canonicalize().is_ok_and(|path| known.insert(path));
            behind.runs.retain(&mut is_new);
            behind.stores.retain(&mut is_new);
            found.runs.extend(behind.runs);
            found.stores.extend(behind.stores);
        }
        found.runs.sort();
        found.stores.sort();
        Ok(found)
    }

    /// Adds what is in a folder and below it. A folder that cannot be read holds nothing.
    fn look_in(&mut self, folder: &Path, depth: usize, context: &Context) -> Result<()> {
        if is_run(folder) {
            self.runs.push(folder.to_path_buf());
            return Ok(());
        }
        if folder.join(STORE).is_file() {
            self.stores.push(folder.to_path_buf());
            return Ok(());
        }
        context.check(|| "stopped while looking for runs")?;
        if depth == DEEPEST {
            return Ok(());
        }
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let (path, kind) = (entry.path(), entry.file_type());
            if kind.as_ref().is_ok_and(FileType::is_dir) {
                self.look_in(&path, depth + 1, context)?;
            } else if kind.is_ok_and(|kind| kind.is_symlink()) && path.is_dir() {
                self.links.push(path);
            }
        }
        Ok(())
    }
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
                        reason: Some(failure.error.in_words()),
                        seconds: Some(failure.cost.seconds),
                        ..row
                    },
                    UnitState::Damaged(error) => UnitRow { reason: Some(error.in_words()), ..row },
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

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;
    use std::sync::Arc;

    use petzval_jobs::{Silent, built_in_assets};

    use super::*;

    /// A run of an experiment that differs in these keys.
    fn row(differs: &[(&str, &str)]) -> RunRow {
        let text = |text: &&str| (*text).to_owned();
        RunRow {
            run: PathBuf::new(),
            experiment: "street".to_owned(),
            state: RunState::Finished,
            reason: None,
            step: 0,
            total: 0,
            camera: None,
            scores: Vec::new(),
            seconds: 0.0,
            begun: String::new(),
            differs: differs.iter().map(|(key, value)| (text(key), text(value))).collect(),
            values: BTreeMap::new(),
        }
    }

    #[test]
    fn an_odd_run_does_not_hide_the_keys_in_which_the_others_differ() {
        let of = |crop, noise, seed| row(&[("crop", crop), ("noise", noise), ("seed", seed)]);
        let rows = vec![of("96", "on", "1"), of("96", "on", "2"), of("96", "on", "1"), of("64", "off", "1")];
        let runs = Runs { runs: rows, ..Runs::default() };
        let keys = |i: usize| runs.keys_in_order(&runs.runs[i]);
        assert_eq!([keys(0), keys(1), keys(2)], [["seed", "crop", "noise"]; 3]);
        assert_eq!(keys(3), ["crop", "noise", "seed"]);
    }

    #[test]
    fn links_are_followed_one_level_and_never_in_circles() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for run in ["elsewhere/one", "elsewhere/deep/two/three", "runs/own", "fourth"] {
            fs::create_dir_all(at(run)).unwrap();
            for file in ["config.toml", "run.json"] {
                fs::write(at(run).join(file), "").unwrap();
            }
        }
        for (target, link) in [
            (at("fourth"), "runs/alone"),
            (at("elsewhere"), "runs/all"),
            // The same runs again, the folder itself, and nothing.
            (at("runs/own"), "runs/latest"),
            (at("elsewhere/one"), "runs/one-again"),
            (at("runs"), "runs/circle"),
            (at("runs"), "elsewhere/circle"),
            (at("gone"), "runs/broken"),
        ] {
            symlink(target, at(link)).unwrap();
        }
        let context = Context::new(built_in_assets(), Arc::new(Silent));
        let found = Found::below(&at("runs"), &context).unwrap();
        assert_eq!(found.runs, ["runs/all/one", "runs/alone", "runs/own"].map(at));
        assert!(found.stores.is_empty() && found.links.is_empty());
    }
}
