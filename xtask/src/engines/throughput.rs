//! What a unit costs beside its work: a thousand units that do next to nothing, in one process; and fewer as tasks of Slurm, one a unit. Times are
//! reported, not judged.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use super::cluster::{Cluster, missing};
use super::units::unit_run;
use super::{Ended, Tools};

/// Units in one process.
const UNITS: usize = 1000;

/// Units as tasks of Slurm.
const TASKS: usize = 100;

pub fn run(tools: &Tools) -> Result<Ended, String> {
    let alone = alone(tools)?;
    let missing = missing();
    if !missing.is_empty() {
        return Ok(Ended::Passed(format!("{alone}; Slurm: NOT RUN, no {}", missing.join(", "))));
    }
    let began = Instant::now();
    let cluster = Cluster::start(&tools.folder.join("slurm"), 2, true)?;
    let started = began.elapsed();
    let (file, store) = (trivial(&tools.folder.join("tasks.jsonl"), TASKS)?, tools.folder.join("tasks"));
    let script = tools.folder.join("array.sh");
    let line = format!("{:?}", unit_run(&tools.petzval, &file, &store));
    let text = format!("#!/bin/bash\n#SBATCH --array=0-{} --output=/dev/null\n{line}\n", TASKS - 1);
    fs::write(&script, text).map_err(|e| format!("{}: {e}", script.display()))?;
    cluster.submit(&[&script.display().to_string()])?;
    cluster.wait_for_all(Duration::from_secs(600))?;
    let seconds = (began.elapsed() - started).as_secs_f64();
    let done = results(&store);
    if done != TASKS {
        return Err(format!("{done} of {TASKS} tasks have a result"));
    }
    Ok(Ended::Passed(format!("{alone}; Slurm, {TASKS} tasks on 2 CPUs: {}", rate(TASKS, seconds))))
}

/// Runs all units in one process, and says what it took.
fn alone(tools: &Tools) -> Result<String, String> {
    let (file, store) = (trivial(&tools.folder.join("units.jsonl"), UNITS)?, tools.folder.join("alone"));
    let words = unit_run(&tools.petzval, &file, &store);
    let mut command = Command::new("bash");
    command.args(["-c", r#"time -p "$@""#, "bash"]).arg(words.get_program()).args(words.get_args());
    let began = Instant::now();
    let output = command.output().map_err(|e| format!("bash: {e}"))?;
    let seconds = began.elapsed().as_secs_f64();
    let said = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() || results(&store) != UNITS {
        return Err(format!("{}: {} of {UNITS} results\n{said}", output.status, results(&store)));
    }
    let seconds_of = |name: &str| {
        let line = said.lines().rev().find_map(|line| line.strip_prefix(name));
        line.and_then(|text| text.trim().parse::<f64>().ok()).unwrap_or(f64::NAN)
    };
    let cpu_ms = 1000.0 * (seconds_of("user ") + seconds_of("sys ")) / UNITS as f64;
    Ok(format!("{UNITS} units in one process: {}, {cpu_ms:.1} ms of CPU a unit", rate(UNITS, seconds)))
}

/// Writes units that do next to nothing, all different.
fn trivial(file: &Path, count: usize) -> Result<PathBuf, String> {
    let mut text = String::new();
    for unit in 0..count {
        let request = format!(r#"{{"name": "N-BK7", "temperature": {}}}"#, 20.0 + 0.01 * unit as f64);
        let call = format!(r#"{{"format": 1, "job": "glass-show", "request": {request}}}"#);
        writeln!(text, r#"{{"name": "glass-{unit}", "call": {call}}}"#).map_err(|e| e.to_string())?;
    }
    fs::write(file, text).map_err(|e| format!("{}: {e}", file.display()))?;
    Ok(file.to_path_buf())
}

/// How many units of a store have a result.
fn results(store: &Path) -> usize {
    let entries = fs::read_dir(store).into_iter().flatten().flatten();
    entries.filter(|entry| entry.path().join("result.json").is_file()).count()
}

fn rate(units: usize, seconds: f64) -> String {
    format!(
        "{:.1} s, {:.0} units a minute, {:.1} ms a unit",
        seconds,
        60.0 * units as f64 / seconds,
        1000.0 * seconds / units as f64
    )
}
