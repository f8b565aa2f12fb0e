//! HyperQueue, Ray and submitit: packages of PyPI. What is done with each is a script beside these sources.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use super::units::Units;
use super::wait::until;
use super::{Ended, Tools};

/// Units of each test, and rounds of each: long enough to be interrupted.
const UNITS: usize = 4;
const ROUNDS: usize = 12;

/// Longest time of a script.
const PATIENCE: Duration = Duration::from_secs(900);

pub fn hyperqueue(tools: &Tools) -> Result<Ended, String> {
    with_script(tools, "hyperqueue", |units, store| {
        Ok(vec![tools.petzval.clone(), units.file.clone(), store.into()])
    })
}

pub fn ray(tools: &Tools) -> Result<Ended, String> {
    with_script(tools, "ray", |units, store| {
        let scripted = tools.folder.join("scripted");
        let script = units.script(&tools.petzval, "ray_sweep.py", &scripted, &["--tasks", "2"])?;
        Ok(vec![units.file.clone(), store.into(), script])
    })
}

pub fn submitit(tools: &Tools) -> Result<Ended, String> {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/petzval-python/examples");
    with_script(tools, "submitit", |units, store| {
        Ok(vec![examples.clone(), units.file.clone(), store.into()])
    })
}

/// Runs the script of an engine, which may interrupt units but has to finish them, and compares the store.
fn with_script(
    tools: &Tools,
    engine: &str,
    words: impl Fn(&Units, &Path) -> Result<Vec<PathBuf>, String>,
) -> Result<Ended, String> {
    let python = match &tools.python {
        Some(python) => python.clone(),
        None => match crate::python::with_packages(&[engine]) {
            Ok(python) => python,
            Err(problem) => return Ok(Ended::NotRun(problem)),
        },
    };
    let has_it = Command::new(&python).args(["-c", &format!("import petzval, {engine}")]).output();
    if !has_it.is_ok_and(|output| output.status.success()) {
        return Ok(Ended::NotRun(format!("{} has no {engine}, or no petzval", python.display())));
    }
    let units = Units::new(&tools.petzval, &tools.folder, UNITS, ROUNDS)?;
    let store = tools.folder.join("store");
    let words = words(&units, &store)?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("engines/{engine}_units.py"));
    let log = tools.folder.join("script.log");
    let file = File::create(&log).map_err(|e| format!("{}: {e}", log.display()))?;
    let again = file.try_clone().map_err(|e| e.to_string())?;
    let mut command = Command::new(python);
    command.arg(script).args(words).current_dir(&tools.folder).stdout(again).stderr(file);
    let mut child = command.spawn().map_err(|e| format!("{command:?}: {e}"))?;
    let ended = until("the end of the script", PATIENCE, || {
        child.try_wait().map(|status| status.is_some()).map_err(|e| e.to_string())
    });
    // One that has ended is not killed.
    let _ = child.kill();
    let status = child.wait().map_err(|e| e.to_string())?;
    let said = fs::read_to_string(&log).unwrap_or_default();
    ended.map_err(|problem| format!("{problem}\n{said}"))?;
    if !status.success() {
        return Err(format!("{status}\n{said}"));
    }
    units.compare(&store)?;
    Ok(Ended::Passed(said.lines().last().unwrap_or_default().to_owned()))
}
