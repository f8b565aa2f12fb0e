//! `petzval sweep FILE`: checks all units, keeps them in the store, and runs them or hands them over.

use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::base::{counted, pasted, time_text};
use crate::jobs::{Context, JobError};
use crate::units::jobs::sweep_plan::{self, Request};
use crate::units::sweep::{
    Engine, KeptSweep, Source, Submission, USUAL_JOBS, USUAL_TIME, keep_scripts, keyed, plan, units_file,
    usual_store,
};

use super::super::code::Code;
use super::super::failure::Failure;
use super::super::plain::{self, shown};
use super::super::signals;
use super::super::terminal::Terminal;
use super::here;

/// Tasks of an array of Slurm where none are named: its usual limit is 1001.
const MOST_TASKS: usize = 1000;

/// Threads of a task on a cluster whose sweep names none.
const USUAL_THREADS: usize = 2;

/// Arguments of `petzval sweep FILE`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// File of the sweep
    #[arg(required = true)]
    file: Option<PathBuf>,
    /// Folder of the store, which all machines have to see [default: sweeps/FILE]
    #[arg(long, value_name = "DIR")]
    store: Option<PathBuf>,
    /// Check all units, and print their number, the CPU hours by a unit that is timed or finished, and the disk space; nothing is written
    #[arg(long, conflicts_with_all = ["submit", "retry"])]
    dry_run: bool,
    /// Run the units here, or hand them over; without it they are checked and kept in the store, with scripts for all schedulers
    #[arg(long, value_name = "WHERE", value_enum)]
    submit: Option<Where>,
    /// Run this unit again here, which has failed; may be repeated
    #[arg(long, value_name = "NAME", conflicts_with = "submit")]
    retry: Vec<String>,
    /// With --submit here: processes, each with its share of the cores
    #[arg(long, value_name = "N", default_value_t = USUAL_JOBS)]
    jobs: NonZero<usize>,
    /// Tasks among which a scheduler shares the units out [default: one for each unit, at most 1000]
    #[arg(long, value_name = "N")]
    tasks: Option<NonZero<usize>>,
    /// Longest time of a task of Slurm
    #[arg(long, value_name = "HH:MM:SS", default_value = USUAL_TIME)]
    time: String,
    /// Further option of the scheduler, such as --partition=long; may be repeated
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    option: Vec<String>,
}

/// Where units run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Where {
    /// As an array of Slurm, by sbatch
    Slurm,
    /// As an array of HyperQueue, by hq
    Hq,
    /// As tasks of Ray, by the Python package petzval
    Ray,
    /// On this machine
    Here,
    /// Print the script of Slurm; those of HyperQueue and Ray lie beside it in the store
    Print,
}

/// Runs the verb.
pub fn run(args: &Args, terminal: &Terminal) -> Result<Code, Failure> {
    let Some(file) = &args.file else {
        return Err(Failure::input(
            "no file of a sweep is named",
            "petzval sweep FILE; `petzval sweep --help` shows one",
        ));
    };
    let root = args.store.clone().unwrap_or_else(|| usual_store(file));
    let stop = signals::stop_quietly()?;
    let context = terminal.context().with_cancellation(stop.clone());
    if args.dry_run {
        return dry_run(&Request { file: file.clone(), store: args.store.clone() }, &context);
    }
    let source = Source::read(file)?;
    let plan = plan(&source, &context)?;
    let (kept, units) = keyed(&plan, &source, &context)?;
    for name in &args.retry {
        kept.named(name)?;
    }
    let before = KeptSweep::read(&root).ok().filter(|before| before.title != kept.title);
    let store = kept.keep(&units, &source, &root).map_err(Failure::of_store)?;
    let submission = submission(args, &kept, store.root())?;
    keep_scripts(&submission, store.root()).map_err(Failure::of_store)?;
    drop(context);
    noteln!("{} in {}{}", counted(plan.units.len(), "unit"), shown(&root), merged(plan.merged));
    if let Some(before) = before {
        // Tasks read the file of units when they start.
        noteln!(
            "warning: the store held the sweep \"{}\" with {} until now. Its results stay; its tasks that are still queued run units of \"{}\". \
             Give each sweep a store of its own with --store",
            plain::message(&before.title),
            counted(before.units.len(), "unit"),
            plain::message(&kept.title)
        );
    }
    if !args.retry.is_empty() {
        return here::run(&kept, &root, &here::Options { jobs: 1, again: args.retry.clone() }, &stop);
    }
    match args.submit {
        None => {
            outln!("run them: petzval sweep {} --submit here, slurm, hq or ray", pasted(file));
            Ok(Code::SUCCESS)
        }
        Some(Where::Here) => {
            here::run(&kept, &root, &here::Options { jobs: args.jobs.get(), again: Vec::new() }, &stop)
        }
        Some(Where::Print) => {
            out!("{}", Engine::Slurm.script(&submission));
            Ok(Code::SUCCESS)
        }
        Some(Where::Slurm) => hand_over(Engine::Slurm, store.root(), &root),
        Some(Where::Hq) => hand_over(Engine::Hq, store.root(), &root),
        Some(Where::Ray) => hand_over(Engine::Ray, store.root(), &root),
    }
}

/// What is said of draws that were left out.
fn merged(draws: usize) -> String {
    match draws {
        0 => String::new(),
        merged => format!(
            "; {} had the values of earlier ones and {} left out",
            counted(merged, "draw"),
            if merged == 1 { "is" } else { "are" }
        ),
    }
}

/// Prints what the sweep would cost.
fn dry_run(request: &Request, context: &Context) -> Result<Code, Failure> {
    let plan = sweep_plan::run(request, context)?;
    outln!("{}{}", counted(plan.units.len(), "unit"), merged(plan.merged));
    let named = plan.units.iter().take(SHOWN);
    named.for_each(|unit| outln!("  {}", unit.name));
    if plan.units.len() > SHOWN {
        outln!("  and {} more", plan.units.len() - SHOWN);
    }
    let estimate = plan.estimate;
    if estimate.done > 0 {
        outln!("finished already: {}", estimate.done);
    }
    outln!("CPU time: {}, by {}", time_text(estimate.cpu_seconds), estimate.basis);
    outln!("disk: {:.3} GB", estimate.disk_gb);
    Ok(Code::SUCCESS)
}

/// Units that a dry run names.
const SHOWN: usize = 20;

/// What a script runs.
fn submission(args: &Args, kept: &KeptSweep, store: &Path) -> Result<Submission, Failure> {
    let program = std::env::current_exe().map_err(|e| Failure::job(format!("this program: {e}")))?;
    let count = kept.units.len();
    let tasks = args.tasks.map_or(MOST_TASKS, NonZero::get).min(count);
    let is_time = |c: char| c.is_ascii_digit() || c == ':' || c == '-';
    if args.time.is_empty() || !args.time.chars().all(is_time) {
        return Err(Failure::input(
            format!("--time {}: no time of Slurm", args.time),
            "such as 04:00:00, or 2-00:00:00 for two days",
        ));
    }
    if let Some(option) = args.option.iter().find(|option| option.chars().any(char::is_control)) {
        return Err(JobError::setting(
            "option",
            option,
            "holds a control character",
            "give one option at a time",
        )
        .into());
    }
    let name: String = kept
        .title
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() || "._-".contains(c) { c } else { '-' })
        .collect();
    Ok(Submission {
        name,
        program,
        units: units_file(store),
        store: store.to_path_buf(),
        count,
        tasks,
        threads: if kept.threads > 0 { kept.threads } else { USUAL_THREADS },
        simd: kept.simd,
        time: args.time.clone(),
        options: args.option.clone(),
    })
}

/// Hands the script of a scheduler to its program, whose output is shown.
fn hand_over(engine: Engine, store: &Path, root: &Path) -> Result<Code, Failure> {
    let script = store.join(engine.file());
    let words = engine.command();
    if !is_there(engine.needs()) {
        let message = format!("{}: there is no such program here", engine.needs());
        let hint =
            format!("start {} where there is one; or run the units here with --submit here", shown(&script));
        return Err(Failure::input(message, hint));
    }
    let ended = Command::new(words[0]).args(&words[1..]).arg(&script).status();
    let ended = ended.map_err(|e| Failure::job(format!("{}: {e}", words[0])))?;
    if !ended.success() {
        return Err(Failure::job(format!("{} {}: it ended with {ended}", words.join(" "), shown(&script))));
    }
    outln!("watch it: petzval sweep status {} --watch", pasted(root));
    Ok(Code::SUCCESS)
}

/// Whether a program is on the path.
fn is_there(program: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|folder| folder.join(program).is_file())
}
