//! The command line: one file per verb. Data goes to stdout, everything else to stderr; `output` writes both.
//!
//! Exit codes: 0 ok, 1 the job failed, 2 bad usage or bad input, 74 the store of units is full, 75 stopped by a signal after a checkpoint.

// `out!`, `outln!` and `noteln!` of `output` are the only ways to write: the standard macros panic where nobody can read.
#![deny(clippy::print_stdout, clippy::print_stderr)]

// Its macros are for all modules below.
#[macro_use]
mod output;

mod apply;
mod bench;
mod call;
mod choice;
mod code;
mod compare;
mod data;
mod defaults;
mod design;
mod detect;
mod doctor;
mod ending;
mod evaluate;
mod experiment;
mod failure;
mod first_look;
mod glass;
mod init;
mod isp;
mod lens;
mod number;
mod plain;
mod psf;
mod psf_calibrate;
mod psf_capture;
mod raw;
mod report;
mod runs;
mod score_table;
mod sensor;
mod signals;
mod simulate;
mod studio;
mod sweep;
mod terminal;
mod text_table;
mod train;
mod unit;
mod watcher;
mod weights;

use std::ffi::OsString;
use std::path::PathBuf;

use crate::jobs::threads::{Source, threads};
use crate::jobs::{MOST_THREADS, usual};
use clap::{CommandFactory, Parser, Subcommand};

use self::terminal::Terminal;

pub use code::Code;
pub use failure::Failure;

/// Design a camera as one thing: lens, sensor, development and network, optimised together by gradient.
///
/// `petzval design` runs the built-in experiment: a Cooke triplet, a Sony IMX249 and a small network, designed end to
/// end for image quality and compared with two controls. The other verbs cover single stages of the same light path.
#[derive(Debug, Parser)]
#[command(name = "petzval", version, propagate_version = true)]
pub struct Cli {
    /// Threads to use; 0 means RAYON_NUM_THREADS, SLURM_CPUS_PER_TASK or HQ_CPUS, the first of them that is set, else one per core. Results do not
    /// depend on it. `bench` compares several: 1,2,4
    #[arg(long, global = true, default_values_t = [usual::threads()], value_delimiter = ',', num_args = 1, value_name = "N")]
    threads: Vec<usize>,
    /// Glass catalogue whose glasses take precedence over the built-in ones: .agf, .toml, a page of
    /// refractiveindex.info (.yml), or a folder of them. May be repeated; later ones take precedence. PETZVAL_GLASSES
    /// lists further ones, which are read first
    #[arg(long, global = true, value_name = "PATH")]
    glasses: Vec<PathBuf>,
    /// Overwrite results that are there already. Folders of runs, optimisations, trainings and captures are never overwritten: they are
    /// resumed, or new ones are begun elsewhere
    #[arg(long, global = true)]
    force: bool,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    #[command(about = "Design lens and network together, and compare with controls")]
    Design(design::Args),
    #[command(about = "Write an experiment with its lens and sensor as files to edit")]
    Init(init::Args),
    /// List the built-in experiments, print one, or run them all
    #[command(subcommand)]
    Experiment(experiment::ExperimentVerb),
    #[command(about = "Print the JSON Schema of experiment, lens or sensor files, of calls and of requests")]
    Schema(experiment::SchemaArgs),
    #[command(about = "Write the report of a run again")]
    Report(report::Args),
    #[command(about = "Put several runs on one page")]
    Compare(compare::Args),
    #[command(about = "Score the cameras of a run again, with exact optics")]
    Evaluate(evaluate::Args),
    /// Show, analyse, convert, optimise or tolerance a lens
    #[command(subcommand)]
    Lens(lens::LensVerb),
    /// Show glasses, or find those with a given index and dispersion
    #[command(subcommand)]
    Glass(glass::GlassVerb),
    #[command(about = "Write the point-spread functions of a lens")]
    Psf(psf::Args),
    #[command(about = "Measure point-spread functions from captures of a pinhole")]
    PsfCalibrate(psf_calibrate::Args),
    #[command(about = "Simulate captures of a pinhole for psf-calibrate")]
    PsfCapture(psf_capture::Args),
    /// Show sensors, measure one from captures, or simulate such captures
    #[command(subcommand)]
    Sensor(sensor::SensorVerb),
    #[command(about = "Show a lens and the photographs through it in the browser, and change it there")]
    Studio(studio::Args),
    #[command(about = "Take photographs through a lens: photograph, raw frame, developed picture")]
    Simulate(simulate::Args),
    /// Show raw frames, or write them in another format
    #[command(subcommand)]
    Raw(raw::RawVerb),
    /// Show image signal processors, develop raw frames, tune parameters
    #[command(subcommand)]
    Isp(isp::IspVerb),
    #[command(about = "Take pictures of your own with the cameras of a run: whole frames, network included")]
    Apply(apply::Args),
    #[command(about = "Find objects in pictures by the detector of a camera, or by weights of torchvision")]
    Detect(detect::Args),
    #[command(about = "List the weights of a network by name, and write them to a file")]
    Weights(weights::Args),
    /// Convert data sets for object detection, and check them
    #[command(subcommand)]
    Data(data::DataVerb),
    /// Train networks that stand in for what has no gradient
    #[command(subcommand)]
    Train(train::TrainVerb),
    /// Run jobs as units of work in a store that many processes share
    #[command(subcommand)]
    Unit(unit::UnitVerb),
    #[command(about = "Run any job from a call in JSON, and print its response")]
    Call(call::Args),
    #[command(about = "List the jobs of `petzval call`")]
    Jobs(call::JobsArgs),
    #[command(about = "Run every combination of values of an experiment or a job, and gather the results")]
    Sweep(sweep::Args),
    #[command(about = "List all runs below a folder, with their states, scores and differences")]
    Runs(runs::Args),
    #[command(about = "Measure standard workloads")]
    Bench(bench::Args),
    #[command(about = "Show what this machine and this build offer")]
    Doctor(doctor::Args),
}

/// Runs the command with these words, the first of which is its own name; returns how it ended.
pub fn main(words: impl IntoIterator<Item = OsString>) -> Code {
    let words: Vec<OsString> = words.into_iter().collect();
    match Cli::try_parse_from(&words) {
        Ok(cli) => ending::finish(run(cli, words)),
        Err(said) => ending::usage(&said, &words, Cli::command),
    }
}

/// Runs a parsed command line.
fn run(cli: Cli, words: Vec<OsString>) -> Result<Code, Failure> {
    #[cfg(feature = "dng")]
    leave_panics_of_the_dng_reader_to_its_caller();
    failure::keep_lines_whole();
    failure::know_command(Cli::command);
    if let Err(value) = crate::base::simd::check_variable() {
        return Err(Failure::input(
            format!("PETZVAL_SIMD={}: there is no instruction set of this name", value.display()),
            "write avx2 or scalar, or unset the variable: the widest of the machine is used then",
        ));
    }
    if let Some(many) = cli.threads.iter().find(|threads| **threads > MOST_THREADS) {
        return Err(Failure::input(
            format!("--threads {many}: more than {MOST_THREADS}"),
            "0 means one per core",
        ));
    }
    // `bench` with several numbers makes a pool for each.
    let one = match cli.threads[..] {
        [one] => one,
        _ if matches!(cli.verb, Verb::Bench(_)) => 0,
        _ => {
            let given: Vec<String> = cli.threads.iter().map(usize::to_string).collect();
            return Err(Failure::input(
                format!("--threads {}: one number", given.join(",")),
                "`petzval bench` alone compares several numbers of threads",
            ));
        }
    };
    let threads = threads(one)?;
    if threads.source != Source::Cores {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.number)
            .build_global()
            .map_err(|e| Failure::job(format!("{} threads: {e}", threads.number)))?;
    }
    let assets = glass::chosen(&cli.glasses, matches!(cli.verb, Verb::Glass(_)))?;
    let has_glasses = !cli.glasses.is_empty() || glass::are_in_environment();
    let terminal = Terminal { assets, has_glasses, overwrites: cli.force, words };
    match cli.verb {
        Verb::Design(args) => design::run(args, &terminal),
        Verb::Init(args) => init::run(args, &terminal),
        Verb::Experiment(verb) => experiment::run(verb, &terminal),
        Verb::Schema(args) => experiment::schema(args, &terminal),
        Verb::Report(args) => report::run(args, &terminal),
        Verb::Compare(args) => compare::run(args, &terminal),
        Verb::Evaluate(args) => evaluate::run(args, &terminal),
        Verb::Lens(verb) => lens::run(verb, &terminal),
        Verb::Glass(verb) => glass::run(verb, &terminal),
        Verb::Psf(args) => psf::run(args, &terminal),
        Verb::PsfCalibrate(args) => psf_calibrate::run(args, &terminal),
        Verb::PsfCapture(args) => psf_capture::run(args, &terminal),
        Verb::Sensor(verb) => sensor::run(verb, &terminal),
        Verb::Studio(args) => studio::run(args, &terminal),
        Verb::Simulate(args) => simulate::run(args, &terminal),
        Verb::Raw(verb) => raw::run(verb, &terminal),
        Verb::Isp(verb) => isp::run(verb, &terminal),
        Verb::Apply(args) => apply::run(args, &terminal),
        Verb::Detect(args) => detect::run(args, &terminal),
        Verb::Weights(args) => weights::run(args, &terminal),
        Verb::Data(verb) => data::run(verb, &terminal),
        Verb::Train(verb) => train::run(verb, &terminal),
        Verb::Unit(verb) => unit::run(verb, &terminal),
        Verb::Call(args) => call::run(args, &terminal),
        Verb::Jobs(args) => call::list(args),
        Verb::Sweep(args) => sweep::run(args, &terminal),
        Verb::Runs(args) => runs::run(args, &terminal),
        Verb::Bench(args) => bench::run(args, &cli.threads, &terminal),
        Verb::Doctor(args) => doctor::run(args, threads.source, &terminal),
    }
}

/// Suppresses the message of a panic in the reader of DNG files. It panics on some damaged files, and its caller turns
/// the panic into an error with a message of our own.
#[cfg(feature = "dng")]
fn leave_panics_of_the_dng_reader_to_its_caller() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !panic.location().is_some_and(|place| place.file().contains("rawler-")) {
            usual(panic);
        }
    }));
}
