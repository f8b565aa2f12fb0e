//! The command line: one file per verb. Data goes to stdout, everything else to stderr.
//!
//! Exit codes: 0 ok, 1 the job failed, 2 bad usage or bad input, 75 stopped by a signal after a checkpoint.

mod bench;
mod design;
mod doctor;
mod evaluate;
mod experiment;
mod failure;
mod glass;
mod lens;
mod psf;
mod psf_calibrate;
mod psf_capture;
mod raw;
mod report;
mod sensor;
mod signals;
mod simulate;
mod watcher;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::{Parser, Subcommand};
use petzval::jobs::Context;

pub use failure::Failure;

/// Stopped by a signal after writing a checkpoint (EX_TEMPFAIL of sysexits).
pub const EXIT_STOPPED: u8 = 75;

/// Design a camera as one thing: lens, sensor, development and network, optimised together by gradient.
///
/// `petzval design` runs the built-in experiment: a Cooke triplet, a Sony IMX249 and a small network,
/// designed end to end for image quality, against two controls. Every other verb shows one stage of the
/// same light path.
#[derive(Debug, Parser)]
#[command(name = "petzval", version, propagate_version = true)]
pub struct Cli {
    /// Threads to use; 0 means one per core. Results do not depend on it.
    #[arg(long, global = true, default_value_t = 0, value_name = "N")]
    threads: usize,
    /// Glass catalogue whose glasses win over the built-in ones: .agf, .toml, a page of refractiveindex.info (.yml), or a
    /// folder of them. May be repeated; later ones win. PETZVAL_GLASSES lists more, which come before
    #[arg(long, global = true, value_name = "PATH")]
    glasses: Vec<PathBuf>,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Design lens and network together, and compare with two controls
    Design(design::Args),
    /// Look at the built-in experiments
    #[command(subcommand)]
    Experiment(experiment::ExperimentVerb),
    /// Print the JSON Schema of experiment, lens or sensor files
    Schema(experiment::SchemaArgs),
    /// Write the report of a run again
    Report(report::Args),
    /// Score the cameras of a run again, with exact optics
    Evaluate(evaluate::Args),
    /// Look at a lens, or make it better
    #[command(subcommand)]
    Lens(lens::LensVerb),
    /// Look glasses up, or find those with a given index and dispersion
    #[command(subcommand)]
    Glass(glass::GlassVerb),
    /// Write the point-spread functions of a lens
    Psf(psf::Args),
    /// Measure point-spread functions from captures of a pinhole
    PsfCalibrate(psf_calibrate::Args),
    /// Simulate captures of a pinhole for psf-calibrate
    PsfCapture(psf_capture::Args),
    /// Look at a sensor, measure one from captures, or simulate such captures
    #[command(subcommand)]
    Sensor(sensor::SensorVerb),
    /// Take photographs through a lens: photograph, raw frame, developed picture
    Simulate(simulate::Args),
    /// Look at raw frames, or write them in another format
    #[command(subcommand)]
    Raw(raw::RawVerb),
    /// Measure standard workloads
    Bench(bench::Args),
    /// Say what this machine offers
    Doctor(doctor::Args),
}

/// More threads than any machine has; asking for them hangs it.
const MOST_THREADS: usize = 1024;

/// Runs a parsed command line.
pub fn run(cli: Cli) -> Result<ExitCode, Failure> {
    end_quietly_on_broken_pipe()?;
    #[cfg(feature = "dng")]
    leave_panics_of_the_dng_reader_to_its_caller();
    failure::keep_lines_whole();
    if cli.threads > MOST_THREADS {
        return Err(Failure::input(
            format!("--threads {}: more than {MOST_THREADS}", cli.threads),
            "0 means one per core",
        ));
    }
    if cli.threads > 0 {
        rayon::ThreadPoolBuilder::new()
            .num_threads(cli.threads)
            .build_global()
            .map_err(|e| Failure::job(format!("{} threads: {e}", cli.threads)))?;
    }
    glass::choose(&cli.glasses, matches!(cli.verb, Verb::Glass(_)))?;
    match cli.verb {
        Verb::Design(args) => design::run(args),
        Verb::Experiment(verb) => experiment::run(verb),
        Verb::Schema(args) => experiment::schema(args),
        Verb::Report(args) => report::run(args),
        Verb::Evaluate(args) => evaluate::run(args),
        Verb::Lens(verb) => lens::run(verb),
        Verb::Glass(verb) => glass::run(verb),
        Verb::Psf(args) => psf::run(args),
        Verb::PsfCalibrate(args) => psf_calibrate::run(args),
        Verb::PsfCapture(args) => psf_capture::run(args),
        Verb::Sensor(verb) => sensor::run(verb),
        Verb::Simulate(args) => simulate::run(args),
        Verb::Raw(verb) => raw::run(verb),
        Verb::Bench(args) => bench::run(args),
        Verb::Doctor(args) => doctor::run(args),
    }
}

/// The reader of DNG files ends some damaged ones with a panic, which its caller turns into an error: the message of the
/// panic would stand in front of ours.
#[cfg(feature = "dng")]
fn leave_panics_of_the_dng_reader_to_its_caller() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !panic.location().is_some_and(|place| place.file().contains("rawler-")) {
            usual(panic);
        }
    }));
}

/// `petzval ... | head` ends the command when `head` has read enough, as it does any other.
#[cfg(unix)]
fn end_quietly_on_broken_pipe() -> Result<(), Failure> {
    let always = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
    signal_hook::flag::register_conditional_default(signal_hook::consts::SIGPIPE, always)
        .map(|_| ())
        .map_err(|e| Failure::job(format!("signal handlers: {e}")))
}

#[cfg(not(unix))]
fn end_quietly_on_broken_pipe() -> Result<(), Failure> {
    Ok(())
}

/// What the jobs of a command are given: the built-in library with the user's glasses, and stderr for what they report.
fn context() -> Context {
    Context::new(petzval::built_in_assets(), Arc::new(watcher::Stderr::new()))
}

/// Prints a value as JSON on stdout, indented, with the keys of its objects in order.
fn print_json(value: &impl serde::Serialize) -> Result<ExitCode, Failure> {
    let print = || serde_json::to_string_pretty(&serde_json::to_value(value)?);
    println!("{}", print().map_err(|e| Failure::job(e.to_string()))?);
    Ok(ExitCode::SUCCESS)
}
