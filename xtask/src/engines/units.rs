//! The units that every engine runs: searches of a few seconds each, and a store of an uninterrupted run with which the others are compared.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// The units of a test, and the results of a run that nothing interrupted.
pub struct Units {
    /// The file of the sweep whose units they are.
    sweep: PathBuf,
    /// The file of the units.
    pub file: PathBuf,
    /// How many there are.
    pub count: usize,
    /// The results of the uninterrupted run, by name.
    wanted: BTreeMap<String, Outcome>,
}

/// What a unit leaves: its response, and the bytes of its best lens.
#[derive(Debug, PartialEq)]
struct Outcome {
    response: Value,
    lens: Vec<u8>,
}

impl Units {
    /// Writes a sweep of `count` searches of `rounds` rounds each, and runs it in a process for each core, at least two.
    pub fn new(petzval: &Path, folder: &Path, count: usize, rounds: usize) -> Result<Self, String> {
        let sweep = folder.join("searches.toml");
        fs::write(&sweep, searches(count, rounds)).map_err(|e| format!("{}: {e}", sweep.display()))?;
        let store = folder.join("uninterrupted");
        let mut command = Command::new(petzval);
        let jobs = std::thread::available_parallelism().map_or(2, |cores| cores.get().max(2)).to_string();
        command
            .arg("sweep")
            .arg(&sweep)
            .arg("--store")
            .arg(&store)
            .args(["--submit", "here", "--jobs", &jobs]);
        succeeds(&mut command)?;
        let wanted = outcomes(&store)?;
        if wanted.len() != count {
            return Err(format!("the uninterrupted run has {} results of {count}", wanted.len()));
        }
        Ok(Self { sweep, file: store.join("units.jsonl"), count, wanted })
    }

    /// Writes the scripts with which schedulers run the units as so many tasks, and returns one of them. They are in the store.
    pub fn script(
        &self,
        petzval: &Path,
        name: &str,
        store: &Path,
        options: &[&str],
    ) -> Result<PathBuf, String> {
        let mut command = Command::new(petzval);
        command.arg("sweep").arg(&self.sweep).arg("--store").arg(store).args(options);
        succeeds(&mut command)?;
        Ok(store.join(name))
    }

    /// Compares a store with the uninterrupted run: every unit once, and the same bits.
    pub fn compare(&self, store: &Path) -> Result<(), String> {
        self.compare_some(store, self.count)
    }

    /// The same where only so many units were run.
    pub fn compare_some(&self, store: &Path, count: usize) -> Result<(), String> {
        let found = outcomes(store)?;
        if found.len() != count {
            return Err(format!("{}: {} results of {count}", store.display(), found.len()));
        }
        match found.iter().find(|(name, outcome)| self.wanted.get(*name) != Some(outcome)) {
            Some((name, _)) => Err(format!("{}: {name} differs from the uninterrupted run", store.display())),
            None => Ok(()),
        }
    }
}

/// A sweep of searches from random starts.
fn searches(count: usize, rounds: usize) -> String {
    let seeds: Vec<String> = (1..=count).map(|seed| seed.to_string()).collect();
    format!(
        r#"job = "lens-optimize"
threads = 1

[request]
rounds = {rounds}
start.new = {{ lens = "cooke-triplet-nominal", out = "found", global = true, goal = {{ wavelengths = [0.5876], efl = "25" }} }}

[grid]
start.new.seed = [{}]
"#,
        seeds.join(", ")
    )
}

/// Runs a command, which must succeed; what it prints is part of the error.
fn succeeds(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    if output.status.success() {
        return Ok(());
    }
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    Err(format!("{command:?}: {}\n{out}{err}", output.status))
}

/// The command that runs the units of a file.
pub fn unit_run(petzval: &Path, file: &Path, store: &Path) -> Command {
    let mut command = Command::new(petzval);
    command.args(["unit", "run"]).arg(file).arg("--store").arg(store);
    command
}

/// The results in a store by the names of their units. A second result of one unit is an error.
fn outcomes(store: &Path) -> Result<BTreeMap<String, Outcome>, String> {
    let mut found = BTreeMap::new();
    for folder in folders(store) {
        let Ok(text) = fs::read_to_string(folder.join("result.json")) else { continue };
        let result: Value = serde_json::from_str(&text).map_err(|e| format!("{}: {e}", folder.display()))?;
        let name = result["unit"]["name"].as_str().unwrap_or_default().to_owned();
        let response = result["response"].clone();
        let lens = response["found"]["lens"].as_str().unwrap_or_default();
        let lens = fs::read(folder.join(lens)).map_err(|e| format!("{name}: {lens}: {e}"))?;
        if found.insert(name.clone(), Outcome { response, lens }).is_some() {
            return Err(format!("{}: two results of {name}", store.display()));
        }
    }
    Ok(found)
}

/// The folders of units in a store that has checkpoints of them.
pub fn checkpoints(store: &Path) -> Vec<PathBuf> {
    let has_one = |unit: &PathBuf| folders(unit).iter().any(|work| work.join("search.json").is_file());
    let is_open = |unit: &PathBuf| !unit.join("result.json").exists();
    folders(store).into_iter().filter(is_open).filter(has_one).collect()
}

/// The folders in a folder.
fn folders(of: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(of).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(|path| path.is_dir()).collect()
}
