//! Slurm: an array of units is preempted by a job of another partition, put back into the queue, and finishes. Both ways in which Slurm announces a
//! preemption are tried. A cancelled array stays out of the queue.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use super::cluster::{Cluster, missing};
use super::units::{Units, checkpoints};
use super::wait::until;
use super::{Ended, Tools};

/// Tasks of the array; as many CPUs has the node.
const TASKS: usize = 2;

/// Rounds of a search. A task without a signal of its own goes on in the time of grace and until Slurm looks whether that has passed, which it does
/// each half minute: two searches take longer than both.
const ROUNDS: usize = 120;

pub fn run(tools: &Tools) -> Result<Ended, String> {
    let missing = missing();
    if !missing.is_empty() {
        let names = missing.join(", ");
        return Ok(Ended::NotRun(format!("no {names} here; Debian: munge slurmctld slurmd slurm-client")));
    }
    let units = Units::new(&tools.petzval, &tools.folder, 2 * TASKS, ROUNDS)?;
    let mut seen = Vec::new();
    for (name, warned) in [("own-signal", true), ("term", false)] {
        let folder = tools.folder.join(name);
        let seconds = preempted(tools, &units, &folder, warned).map_err(|e| format!("{name}: {e}"))?;
        seen.push(format!("{name} {seconds:.0} s"));
    }
    Ok(Ended::Passed(format!(
        "{} units as {TASKS} tasks, preempted and put back, equal to the bit ({})",
        units.count,
        seen.join(", ")
    )))
}

/// Submits the array, preempts it when its first units have checkpoints, and waits for the end. Returns the seconds.
fn preempted(tools: &Tools, units: &Units, folder: &Path, warned: bool) -> Result<f64, String> {
    let began = Instant::now();
    let cluster = Cluster::start(&folder.join("slurm"), TASKS, warned)?;
    let store = folder.join("store");
    let tasks = TASKS.to_string();
    let script =
        units.script(&tools.petzval, "slurm.sh", &store, &["--tasks", &tasks, "--option=--partition=low"])?;
    let array = cluster.submit(&[&script.display().to_string()])?;
    until("checkpoints of both tasks", Duration::from_secs(120), || Ok(checkpoints(&store).len() == TASKS))?;
    // It takes all CPUs: Slurm preempts both tasks.
    let log = folder.join("high.log");
    let log = format!("--output={}", log.display());
    let high = ["--partition=high", "--exclusive", &log, "--wrap=sleep 2"];
    cluster.submit(&high)?;
    cluster.wait_for_all(Duration::from_secs(600))?;
    let shown = cluster.says("scontrol", &["show", "job", &array])?;
    fs::write(folder.join("jobs.txt"), &shown).map_err(|e| e.to_string())?;
    for needle in ["Restarts=1", "JobState=COMPLETED", "ExitCode=0:0"] {
        let times = shown.matches(needle).count();
        if times != TASKS {
            return Err(format!("{times} of {TASKS} tasks have {needle}:\n{shown}"));
        }
    }
    units.compare(&store)?;
    let log = store.join("logs/0.log");
    let said = fs::read_to_string(&log).map_err(|e| format!("{}: {e}", log.display()))?;
    println!("{said}");
    for needle in ["with a checkpoint", "attempt 2", "going on from a checkpoint"] {
        if !said.contains(needle) {
            return Err(format!("the log of a preempted task does not say \"{needle}\":\n{said}"));
        }
    }
    cancelled(tools, units, &cluster, folder)?;
    Ok(began.elapsed().as_secs_f64())
}

/// Cancels an array whose tasks run: it leaves checkpoints, and does not come back into the queue.
fn cancelled(tools: &Tools, units: &Units, cluster: &Cluster, folder: &Path) -> Result<(), String> {
    let store = folder.join("cancelled");
    let tasks = TASKS.to_string();
    let script = units.script(&tools.petzval, "slurm.sh", &store, &["--tasks", &tasks])?;
    let array = cluster.submit(&[&script.display().to_string()])?;
    until("checkpoints of both tasks", Duration::from_secs(120), || Ok(checkpoints(&store).len() == TASKS))?;
    cluster.says("scancel", &[&array])?;
    cluster.wait_for_all(Duration::from_secs(120))?;
    let shown = cluster.says("scontrol", &["show", "job", &array])?;
    let ended = shown.matches("JobState=CANCELLED").count();
    if ended != TASKS || shown.matches("Restarts=0").count() != TASKS || checkpoints(&store).len() != TASKS {
        return Err(format!("{ended} of {TASKS} tasks are cancelled for good, with a checkpoint:\n{shown}"));
    }
    Ok(())
}
