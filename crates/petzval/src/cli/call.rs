//! `petzval call` and `petzval jobs`: any job from one JSON value.

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use petzval::jobs::{Call, jobs};

use super::failure::Failure;
use super::signals;
use super::terminal::{EXIT_STOPPED, Terminal, print_json};

/// Run a job that is written as JSON, and print its response as JSON.
///
/// A call names a job and holds its request:
///
///     echo '{"format": 1, "job": "lens-trace", "request": {"lens": "cooke-triplet-nominal",
///       "field": 10, "wavelength": 0.55, "pupil": [0, 1]}}' | petzval call
///
/// `petzval jobs` lists the jobs, `petzval schema job NAME` prints what a request may hold, and `petzval schema call` what
/// stands beside it: glasses, overwrite, threads.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// File of the call; from stdin if left out
    file: Option<PathBuf>,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<ExitCode, Failure> {
    let call = match args.file {
        Some(path) => Call::read(&path)?,
        None => {
            let text = io::read_to_string(io::stdin())
                .map_err(|e| Failure::input(format!("stdin: {e}"), "give the call as UTF-8 text"))?;
            Call::parse(&text)?
        }
    };
    let stop = signals::stop_on_signal()?;
    let context = terminal.context().with_cancellation(stop.clone());
    let response = call.run(&context)?;
    drop(context);
    print_json(&response)?;
    // A job that was stopped and can go on has answered with what it has.
    Ok(if stop.load(std::sync::atomic::Ordering::Relaxed) {
        ExitCode::from(EXIT_STOPPED)
    } else {
        ExitCode::SUCCESS
    })
}

/// List the jobs that `petzval call` runs, with what they do.
#[derive(Debug, clap::Args)]
pub struct JobsArgs {
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn list(args: JobsArgs) -> Result<ExitCode, Failure> {
    if args.json {
        return print_json(&jobs());
    }
    for job in jobs() {
        outln!("{:<20} {}", job.name, job.about);
    }
    Ok(ExitCode::SUCCESS)
}
