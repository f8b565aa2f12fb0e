//! `petzval sweep`: many units from one file of what varies.

mod gather;
mod here;
mod start;
mod status;

use clap::Subcommand;

use super::code::Code;
use super::failure::Failure;
use super::terminal::Terminal;

/// Run a job or an experiment for every combination of values, and gather what comes out.
///
/// The file of a sweep names an experiment and what varies:
///
///   experiment = "night.toml"
///   seeds = [1, 2, 3]
///   [grid]
///   psf.grid = [64, 128]
///   training.learning_rate = [1e-3, 3e-3]
///
/// Keys are key paths of the experiment, as of `petzval design --set`. [grid] runs all combinations, [list] the first values of its lists
/// together, then the second, and so on; [random] draws `n` times from {from, to, log} or {choice = [...]}. variants = ["nominal"] makes single
/// variants. job = "lens-tolerance" with [request] runs a job of `petzval jobs` in place of an experiment.
///
/// Every unit is checked before the first one runs. Units and results are kept in a store: units that are finished are passed over, those that
/// were stopped go on, so the same command can be given again at any time, on one machine or on many.
///
///   petzval sweep night-sweep.toml --dry-run          what it will cost.
///   petzval sweep night-sweep.toml --submit here      run it on this machine.
///   petzval sweep night-sweep.toml --submit slurm     run it on a cluster.
///   petzval sweep status sweeps/night-sweep           how its units stand.
///   petzval sweep gather sweeps/night-sweep           tables and page.
///
/// Exit codes: 0 all units have a result or were handed over, 1 some have failed, 2 the file is wrong. After two others the same command goes
/// on: 74 the store is full or cannot be reached, 75 stopped by a signal.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Args {
    #[command(subcommand)]
    verb: Option<SweepVerb>,
    #[command(flatten)]
    start: start::Args,
}

/// What is done with a sweep that has begun.
#[derive(Debug, Subcommand)]
enum SweepVerb {
    #[command(about = "Show how the units of a sweep stand, and why some have failed")]
    Status(status::Args),
    #[command(about = "Gather the results of a sweep: tables, CSV, a page with pictures and a scatter plot")]
    Gather(gather::Args),
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    match args.verb {
        Some(SweepVerb::Status(args)) => status::run(&args, terminal),
        Some(SweepVerb::Gather(args)) => gather::run(&args, terminal),
        None => start::run(&args.start, terminal),
    }
}
