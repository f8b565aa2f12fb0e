//! Many processes share one store. One of them is killed again and again, as by a machine that fails: every unit is finished, and no result is
//! there twice. Before that, each signal that ends a job.

use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::units::{Units, checkpoints, unit_run};
use super::wait::until;
use super::{Ended, Length, Tools};

/// Processes on one store.
const WORKERS: usize = 8;

/// Processes that are killed at most: on a slow machine all might be killed before any has a checkpoint.
const MOST_KILLED: usize = 3 * WORKERS;

/// Signals that batch systems, terminals and people send.
const SIGNALS: [&str; 5] = ["INT", "TERM", "HUP", "USR1", "USR2"];

/// Exit code of a run that a signal has ended after a checkpoint.
const STOPPED: i32 = 75;

pub fn run(tools: &Tools) -> Result<Ended, String> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let Plan { count, rounds, pace, named } = Plan::of(tools.length, cores);
    let units = Units::new(&tools.petzval, &tools.folder, count, rounds)?;
    let longest = SIGNALS
        .iter()
        .map(|signal| signalled(tools, &units, signal).map_err(|e| format!("SIG{signal}: {e}")))
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .max()
        .unwrap_or_default();
    let store = tools.folder.join("shared");
    let named = named && has_names();
    let killed = shared(tools, &units, &store, pace, named)?;
    if killed == 0 {
        return Err(format!("the units ended within {} s, before any process was killed", pace.as_secs()));
    }
    units.compare(&store)?;
    let names = if named { "on machines of different names" } else { "on one machine" };
    Ok(Ended::Passed(format!(
        "{WORKERS} processes {names} finished {count} units, {killed} were killed; checkpoint at most {:.2} s after each of {}",
        longest.as_secs_f64(),
        SIGNALS.join(", ")
    )))
}

/// What the processes do, and how often one of them is killed.
struct Plan {
    /// Units.
    count: usize,
    /// Rounds of each; a round takes about half a second of a core.
    rounds: usize,
    /// Time between two kills.
    pace: Duration,
    /// Whether each process seems to be on a machine of its own. A unit whose process is killed then waits five minutes until its claim is stale.
    named: bool,
}

impl Plan {
    fn of(length: Length, cores: usize) -> Self {
        let minute = Duration::from_secs(60);
        match length {
            Length::Short => Self { count: 24, rounds: 4, pace: Duration::from_secs(2), named: false },
            // The work lasts two or three minutes, whatever the number of cores, so that some are killed in it.
            Length::Full => Self { count: 12 * cores.min(WORKERS), rounds: 24, pace: minute, named: true },
            Length::Long => Self { count: 64, rounds: 60, pace: minute, named: true },
        }
    }
}

/// Stops a run by a signal when it has a checkpoint, and lets it go on. Returns how long the process lived on.
fn signalled(tools: &Tools, units: &Units, signal: &str) -> Result<Duration, String> {
    let store = tools.folder.join(signal);
    let only_one = |command: &mut Command| {
        command.args(["--shard", &format!("0/{}", units.count)]).stdout(Stdio::null());
    };
    let mut command = with_all_signals(&unit_run(&tools.petzval, &units.file, &store));
    only_one(&mut command);
    let mut child = command.spawn().map_err(|e| e.to_string())?;
    until("a checkpoint", Duration::from_secs(60), || Ok(!checkpoints(&store).is_empty()))?;
    let sent = Instant::now();
    send(signal, &child);
    let status = child.wait().map_err(|e| e.to_string())?;
    let lived = sent.elapsed();
    if status.code() != Some(STOPPED) {
        return Err(format!("{status} after {:.2} s, not exit code {STOPPED}", lived.as_secs_f64()));
    }
    if checkpoints(&store).is_empty() {
        return Err("no checkpoint is left".to_owned());
    }
    let mut command = unit_run(&tools.petzval, &units.file, &store);
    only_one(&mut command);
    let status = command.status().map_err(|e| e.to_string())?;
    if !status.success() {
        return Err(format!("the second run: {status}"));
    }
    units.compare_some(&store, 1)?;
    Ok(lived)
}

/// Runs the units by several processes, of which one is killed at each `pace` and replaced. Returns how many were killed.
///
/// With names of their own the processes seem to be on different machines: that one is gone is seen only by its claim, which grows stale.
fn shared(tools: &Tools, units: &Units, store: &Path, pace: Duration, named: bool) -> Result<usize, String> {
    let started = |worker: usize, times: usize| {
        let log = File::create(tools.folder.join(format!("worker-{worker}-{times}.log")))
            .map_err(|e| e.to_string())?;
        let again = log.try_clone().map_err(|e| e.to_string())?;
        let mut command = unit_run(&tools.petzval, &units.file, store);
        if named {
            command = on_machine(&format!("worker-{worker}-{times}"), &command);
        }
        command.stdout(log).stderr(again).spawn().map_err(|e| e.to_string())
    };
    let mut workers =
        (0..WORKERS).map(|worker| started(worker, 0)).collect::<Result<Vec<Child>, String>>()?;
    let (began, mut killed) = (Instant::now(), 0);
    let patience = pace * 120 + Duration::from_secs(600);
    loop {
        std::thread::sleep(Duration::from_millis(100));
        let mut running = Vec::new();
        for (worker, child) in workers.iter_mut().enumerate() {
            match child.try_wait().map_err(|e| e.to_string())? {
                None => running.push(worker),
                Some(status) if status.success() => {}
                Some(status) => return Err(format!("worker {worker}: {status}")),
            }
        }
        if running.is_empty() {
            return Ok(killed);
        }
        if began.elapsed() > patience {
            return Err(format!("workers {running:?} do not end"));
        }
        if killed < MOST_KILLED && began.elapsed() > pace * (killed as u32 + 1) {
            let worker = running[killed % running.len()];
            let child = &mut workers[worker];
            child.kill().and_then(|()| child.wait()).map_err(|e| e.to_string())?;
            killed += 1;
            workers[worker] = started(worker, killed)?;
        }
    }
}

/// The same command in a space of names of its own, where the machine has this name.
fn on_machine(name: &str, command: &Command) -> Command {
    let mut named = Command::new("unshare");
    named.args(["--user", "--map-root-user", "--uts", "sh", "-c", r#"hostname "$0" && exec "$@""#, name]);
    named.arg(command.get_program()).args(command.get_args());
    named
}

/// The same command with every signal as it is by default: under `nohup`, or in the background of a shell, a process ignores some.
fn with_all_signals(command: &Command) -> Command {
    let mut with_all = Command::new("env");
    with_all.arg("--default-signal").arg(command.get_program()).args(command.get_args());
    with_all
}

/// Whether processes may have names of machines of their own here.
fn has_names() -> bool {
    let output = on_machine("worker", &Command::new("hostname")).output();
    output.is_ok_and(|output| output.stdout == b"worker\n")
}

fn send(signal: &str, child: &Child) {
    let _ = Command::new("kill").args(["-s", signal, &child.id().to_string()]).status();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_earnest_one_process_is_killed_each_minute_on_machines_of_other_names() {
        for length in [Length::Full, Length::Long] {
            let plan = Plan::of(length, 2);
            assert!(plan.named && plan.pace == Duration::from_secs(60), "{length:?}");
        }
        // Two kills at least: half a second a round, on cores that all have work.
        for cores in [1, 2, 4, 8, 64] {
            let plan = Plan::of(Length::Full, cores);
            let seconds = plan.count as f64 * plan.rounds as f64 * 0.5 / cores.min(WORKERS) as f64;
            assert!((120.0..240.0).contains(&seconds), "{cores} cores: {seconds} s");
        }
    }
}
