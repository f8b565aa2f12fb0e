//! Units on this machine: processes of `petzval unit run`, which take units until none is left.

use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use crate::base::{Cancel, pasted};
use crate::units::store::Seen;
use crate::units::sweep::{KeptSweep, State, SweepStatus, UnitStatus, log_of, status, units_file};

use super::super::code::Code;
use super::super::failure::Failure;
use super::super::plain::{self, shown};
use super::super::signals::stopping;

/// How the units run.
pub struct Options {
    /// Processes.
    pub jobs: usize,
    /// Names of units that have failed and are run again; all units if there are none.
    pub again: Vec<String>,
}

impl Options {
    /// Whether these processes are to run a unit.
    fn takes(&self, unit: &UnitStatus) -> bool {
        self.again.is_empty() || self.again.contains(&unit.name)
    }
}

/// Between two looks at the processes.
const LOOK: Duration = Duration::from_millis(200);

/// Looks at the processes between two looks at the units.
const LOOKS: u32 = 25;

/// Processes at work. Where this program gives up on them, they are ended as by a signal, with their checkpoints.
struct Running(Vec<Child>);

impl Running {
    /// Takes out those that have ended, and returns how each did.
    fn ended(&mut self) -> std::io::Result<Vec<ExitStatus>> {
        let (mut ended, mut failed) = (Vec::new(), None);
        self.0.retain_mut(|process| match process.try_wait() {
            Ok(Some(status)) => {
                ended.push(status);
                false
            }
            Ok(None) => true,
            Err(error) => {
                failed = Some(error);
                true
            }
        });
        failed.map_or(Ok(ended), Err)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.0.iter().for_each(pass_on);
    }
}

/// Runs the units. A signal is passed on to the processes, which end with their checkpoints where the job keeps any.
pub fn run(kept: &KeptSweep, root: &Path, options: &Options, stop: &Cancel) -> Result<Code, Failure> {
    let look = |seen: &mut Seen| status(kept, root, seen, &Cancel::default()).map_err(Failure::of_store);
    if !options.again.is_empty() {
        note_finished(&look(&mut Seen::default())?, options);
    }
    let mut running = Running(Vec::new());
    for place in 0..options.jobs {
        running.0.push(start(kept, root, options, place)?);
    }
    let (mut looks, mut is_passed_on, mut last) = (0, false, String::new());
    let mut seen = Seen::default();
    let (mut is_stopped, mut lacks_store) = (false, false);
    while !running.0.is_empty() {
        if stop.is_set() && !is_passed_on {
            is_passed_on = true;
            noteln!("{}; the same command goes on", stopping([kept.job.as_str()]));
            running.0.iter().for_each(pass_on);
        }
        for ended in running.ended().map_err(|e| Failure::job(format!("a process of the sweep: {e}")))? {
            is_stopped |= has_code(ended, Code::STOPPED);
            lacks_store |= has_code(ended, Code::STORE);
        }
        looks += 1;
        // A look that fails shows nothing: the processes know best whether the store is lost.
        if options.jobs > 1
            && looks % LOOKS == 0
            && let Ok(status) = look(&mut seen)
        {
            let words = status.in_words();
            if words != last {
                noteln!("{words}");
                last = words;
            }
        }
        std::thread::sleep(LOOK);
    }
    let status = look(&mut seen)?;
    outln!("{}", status.in_words());
    for unit in status.units.iter().filter(|unit| unit.has_error()) {
        outln!("  {}", plain::message(&format!("{}: {}", unit.name, unit.error.clone().unwrap_or_default())));
    }
    let done = status.count(State::Done);
    if done > 0 {
        outln!("gather: petzval sweep gather {}", pasted(root));
    }
    if status.count(State::Failed) > 0 {
        outln!(
            "run a failed unit again: petzval sweep {} --store {} --retry NAME",
            pasted(&kept.file),
            pasted(root)
        );
    }
    Ok(if is_stopped || stop.is_set() {
        Code::STOPPED
    } else if status.units.iter().filter(|unit| options.takes(unit)).all(|unit| unit.state == State::Done) {
        Code::SUCCESS
    } else if lacks_store {
        Code::STORE
    } else {
        Code::FAILURE
    })
}

/// Whether a process ended with a code of the command.
fn has_code(ended: ExitStatus, code: Code) -> bool {
    ended.code() == Some(i32::from(code.number()))
}

/// Says which of the named units are finished: nothing is run for them.
fn note_finished(status: &SweepStatus, options: &Options) {
    for unit in status.units.iter().filter(|unit| options.takes(unit) && unit.state == State::Done) {
        noteln!("{}", plain::message(&format!("{}: has a result already, which stays", unit.name)));
    }
}

/// Starts a process. Where there are several, each writes to a file of its own.
fn start(kept: &KeptSweep, root: &Path, options: &Options, place: usize) -> Result<Child, Failure> {
    let program = std::env::current_exe().map_err(|e| Failure::job(format!("this program: {e}")))?;
    // Those of `--threads`, else all cores.
    let threads = rayon::current_num_threads();
    // The folder in which a process works may be another one.
    let root = std::path::absolute(root).map_err(|e| Failure::job(format!("{}: {e}", shown(root))))?;
    let mut command = Command::new(program);
    command.args(["unit", "run"]).arg(units_file(&root)).arg("--store").arg(&root);
    for name in &options.again {
        command.arg("--name").arg(name);
    }
    if !options.again.is_empty() {
        command.arg("--retry");
    }
    if kept.threads == 0 {
        command.arg("--threads").arg((threads / options.jobs).max(1).to_string());
    }
    command.env("PETZVAL_SIMD", kept.simd.variable()).stdin(Stdio::null()).stdout(Stdio::null());
    // These processes take all units, also within a task of a cluster.
    for variable in ["SLURM_ARRAY_TASK_ID", "HQ_TASK_ID"] {
        command.env_remove(variable);
    }
    if options.jobs > 1 {
        command.stderr(log_of(&root, place).map_err(Failure::of_store)?);
    }
    in_a_group_of_its_own(&mut command);
    command.spawn().map_err(|e| Failure::job(format!("a process of the sweep: {e}")))
}

/// Keeps Ctrl-C of a terminal from a process: it is passed on once, and a second signal would end the process without a checkpoint.
#[cfg(unix)]
fn in_a_group_of_its_own(command: &mut Command) {
    use std::os::unix::process::CommandExt;
    command.process_group(0);
}

#[cfg(not(unix))]
fn in_a_group_of_its_own(_: &mut Command) {}

/// Passes a signal on.
#[cfg(unix)]
fn pass_on(child: &Child) {
    // A process that has ended needs none.
    let _ended =
        rustix::process::kill_process(rustix::process::Pid::from_child(child), rustix::process::Signal::TERM);
}

#[cfg(not(unix))]
fn pass_on(_: &Child) {}
