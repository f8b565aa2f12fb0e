//! `petzval unit run`.

use std::path::{Path, PathBuf};

use crate::base::counted;
use crate::cli::code::Code;
use crate::jobs::Context;
use crate::units::store::{RunOptions, Store, Summary, run_all};
use crate::units::unit::{Shard, Unit, UnitFile, read_units, shard_of_environment, task_without_count};

use super::super::failure::Failure;
use super::super::plain;
use super::super::signals::stop_jobs_on_signal;
use super::super::terminal::{Terminal, print_json};

/// Run units of work that have no result yet, and keep the results in a store.
///
/// A file of units has one in each line, as JSON: a name, and a call as `petzval call` takes it.
///
///   {"name": "triplet", "seed": 1, "call": {"format": 1, "job": "lens-optimize",
///     "request": {"start": {"new": {"lens": "cooke-triplet-nominal", "out": ""}}}}}   (on one line)
///
/// A unit with a result is left alone; one that was stopped goes on from its checkpoint; any other begins. So the same command can be
/// given again at any time, and by many processes at once: each takes units that nobody works on, and all wait until none is left. Relative
/// paths in a file of units start in its folder. The folder of results in a request is replaced by one in the store; where a call needs one, a
/// unit may leave it out.
///
/// Exit codes: 0 all units have a result, 1 some have failed, 2 the file or the store cannot be used. After two others the same command goes
/// on: 74 the store is full or cannot be reached, 75 stopped by a signal (INT, TERM, HUP, USR1, USR2, XCPU).
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// File of units, one in each line as JSON
    file: PathBuf,
    /// Folder of the store; made if it is not there. All machines that work on it have to see it
    #[arg(long, value_name = "DIR")]
    store: PathBuf,
    /// Run every n-th unit only, from the i-th, counted from 0: 0/4 to 3/4. The default is the task of a Slurm array
    /// (SLURM_ARRAY_TASK_ID, _COUNT, _MIN, _STEP), or the unit of number HQ_TASK_ID of HyperQueue, or all units
    #[arg(long, value_name = "i/n")]
    shard: Option<Shard>,
    /// Run the unit of this name only; may be repeated
    #[arg(long, value_name = "NAME", conflicts_with = "shard")]
    name: Vec<String>,
    /// Run units again that have failed, or whose folder in the store is damaged: it is set aside
    #[arg(long)]
    retry: bool,
    /// Do not wait for units that other processes work on
    #[arg(long)]
    no_wait: bool,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let file = read_units(&args.file)?;
    let (units, said) = chosen(&file, &args)?;
    let Some(first) = units.first() else {
        said.iter().for_each(|text| noteln!("{text}"));
        noteln!("this shard holds no unit");
        return Ok(Code::SUCCESS);
    };
    with_level(first, terminal)?;
    // Once: the process may have begun again.
    said.iter().for_each(|text| noteln!("{text}"));
    // Before the folder of the file becomes that of the process.
    let root = std::path::absolute(&args.store)
        .map_err(|e| Failure::job(format!("{}: {e}", plain::shown(&args.store))))?;
    let stop = stop_jobs_on_signal(units.iter().map(|unit| unit.call.job.as_str()))?;
    let context = context(&args.file, terminal)?.with_cancellation(stop);
    let options = RunOptions { retries: args.retry, leaves_others: args.no_wait };
    let summary = run_all(&units, || Store::open_or_new(&root), &context, options);
    drop(context);
    let summary = summary.map_err(Failure::of_store)?;
    if args.json {
        print_json(&summary)?;
    } else {
        in_words(units.len(), &summary).lines().for_each(|text| outln!("{}", plain::message(text)));
    }
    Ok(ending(&summary))
}

/// The units that this process runs, and what is to be said of those that the number of a task of a batch system chose.
fn chosen<'f>(file: &'f UnitFile, args: &Args) -> Result<(Vec<&'f Unit>, Option<String>), Failure> {
    if !args.name.is_empty() {
        return Ok((file.named(&args.file, &args.name)?, None));
    }
    let all: Vec<&Unit> = file.units.iter().collect();
    if let Some(shard) = args.shard {
        return Ok((shard.of(&all), None));
    }
    let variable = |name: &str| std::env::var(name).ok();
    let Some((shard, source)) = shard_of_environment(variable, all.len())? else {
        return Ok((all, task_without_count(variable)));
    };
    let own = shard.of(&all);
    let said =
        format!("shard {shard} by {}: {} of {}", source.variable(), counted(own.len(), "unit"), all.len());
    Ok((own, Some(said)))
}

/// Starts this process again with the instruction set of a unit, if it computes with another one: kernels choose theirs once.
pub(super) fn with_level(unit: &Unit, terminal: &Terminal) -> Result<(), Failure> {
    let wanted = unit.simd_variable()?;
    let is_set = std::env::var_os("PETZVAL_SIMD").is_some_and(|variable| variable == wanted);
    // A machine that lacks the instruction set is refused when the unit is run.
    if is_set || unit.check_level().is_ok() {
        return Ok(());
    }
    start_again(wanted, terminal)
}

#[cfg(unix)]
fn start_again(level: &str, terminal: &Terminal) -> Result<(), Failure> {
    use std::os::unix::process::CommandExt;

    let mut words = std::env::args_os();
    let name = words.next().unwrap_or_default();
    let words: Vec<_> = words.collect();
    // Only a process that does nothing else may begin again: a script in Python may call the command as well.
    if !words.ends_with(&terminal.words[1.min(terminal.words.len())..]) {
        return Ok(());
    }
    let program = std::env::current_exe().map_err(|e| Failure::job(format!("this program: {e}")))?;
    // Python finds the environment of its packages by the name that it was started with: the program itself lies outside of it.
    let error = std::process::Command::new(program).arg0(name).args(words).env("PETZVAL_SIMD", level).exec();
    Err(Failure::job(format!("this program could not be started again with PETZVAL_SIMD={level}: {error}")))
}

#[cfg(not(unix))]
fn start_again(_: &str, _: &Terminal) -> Result<(), Failure> {
    // The message of the unit says what to set.
    Ok(())
}

/// The context of units. The program works in the folder of their file from now on. Glasses of the command line would not be a part of their keys.
pub(super) fn context(file: &Path, terminal: &Terminal) -> Result<Context, Failure> {
    if terminal.has_glasses {
        return Err(Failure::input(
            "--glasses and PETZVAL_GLASSES are not known to other processes of a store",
            "name them in the call of each unit, \"glasses\": [PATH]; and unset PETZVAL_GLASSES",
        ));
    }
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder {
        std::env::set_current_dir(folder)
            .map_err(|e| Failure::input(format!("{}: {e}", folder.display()), ""))?;
    }
    Ok(terminal.context())
}

fn in_words(units: usize, summary: &Summary) -> String {
    let Summary { there, done, failed, damaged, elsewhere, stopped } = summary;
    let mut text = format!("{}: {done} done, {there} done before", counted(units, "unit"));
    if !failed.is_empty() {
        text += &format!(", {} failed", failed.len());
    }
    if !elsewhere.is_empty() {
        text += &format!(", {} with other processes", elsewhere.len());
    }
    if !damaged.is_empty() {
        text += &format!(", {} damaged", damaged.len());
    }
    let errors = failed.iter().map(|failed| (&failed.unit, &failed.error));
    for (unit, error) in errors.chain(damaged.iter().map(|damaged| (&damaged.unit, &damaged.error))) {
        text += &format!("\n  {unit}: {}", error.in_words());
        if !error.hint.is_empty() {
            text += &format!("\n    hint: {}", error.hint);
        }
    }
    if let Some(failed) = failed.first() {
        text += &format!("\nrun failed units again with --retry, or one with --retry --name {}", failed.unit);
    }
    if let Some(stopped) = stopped {
        text += &format!(
            "\n{}; the same command goes on, from a checkpoint where the job keeps one",
            stopped.message
        );
    }
    text
}

fn ending(summary: &Summary) -> Code {
    if summary.stopped.is_some() {
        Code::STOPPED
    } else if summary.failed.is_empty() && summary.damaged.is_empty() {
        Code::SUCCESS
    } else {
        Code::FAILURE
    }
}
