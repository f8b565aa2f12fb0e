//! HyperQueue, Ray and submitit: packages of PyPI. What is done with each is a script beside these sources.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::units::Units;
use super::{Ended, Tools};

/// Units of each test, and rounds of each: long enough to be interrupted.
const UNITS: usize = 4;
const ROUNDS: usize = 12;

pub fn hyperqueue(tools: &Tools) -> Result<Ended, String> {
    with_script(tools, "hyperqueue", |units, store| {
        vec![tools.petzval.clone(), units.file.clone(), store.into()]
    })
}

pub fn ray(tools: &Tools) -> Result<Ended, String> {
    with_script(tools, "ray", |units, store| vec![units.file.clone(), store.into()])
}

pub fn submitit(tools: &Tools) -> Result<Ended, String> {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/petzval-python/examples");
    with_script(tools, "submitit", |units, store| vec![examples.clone(), units.file.clone(), store.into()])
}

/// Runs the script of an engine, which may interrupt units but has to finish them, and compares the store.
fn with_script(
    tools: &Tools,
    engine: &str,
    words: impl Fn(&Units, &Path) -> Vec<PathBuf>,
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
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("engines/{engine}_units.py"));
    let mut command = Command::new(python);
    command.arg(script).args(words(&units, &store)).current_dir(&tools.folder);
    let output = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    let said = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        return Err(format!("{}: {said}{}", output.status, String::from_utf8_lossy(&output.stderr)));
    }
    units.compare(&store)?;
    Ok(Ended::Passed(said.lines().last().unwrap_or_default().to_owned()))
}
