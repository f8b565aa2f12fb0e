//! `petzval call` and `petzval jobs`: any job from one JSON value.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::cli::code::Code;
use crate::jobs::{Call, ErrorReport, Event, JobError, Watcher};
use crate::units::table;
use serde::Serialize;

use super::failure::Failure;
use super::terminal::{Terminal, print_json, print_response};
use super::{output, plain, signals};

/// Run a job that is written as JSON, and print its response as JSON.
///
/// A call names a job and holds its request:
///
///   echo '{"format": 1, "job": "lens-trace", "request": {"lens": "cooke-triplet-nominal",
///     "field": 10, "wavelength": 0.55, "pupil": [0, 1]}}' | petzval call
///
/// `petzval jobs` lists the jobs, `petzval schema job NAME` prints what a request may hold, and `petzval schema call` what
/// stands beside it: glasses, overwrite, threads, device.
///
/// With --events stderr holds one JSON value a line: what the job says while it works (warning, note, progress, step, camera,
/// file), and at the end, if it has no response, the error.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// File of the call; from stdin if it is `-` or left out
    file: Option<PathBuf>,
    /// Print events as JSON on stderr, one a line
    #[arg(long)]
    events: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let call = match read(args.file.as_deref()) {
        Ok(call) => call,
        Err(error) => return Ok(failed(&error, args.events)),
    };
    let context = if args.events { terminal.context_of(Arc::new(JsonLines)) } else { terminal.context() };
    let stop = if args.events {
        signals::stop_quietly()?
    } else {
        signals::stop_jobs_on_signal([call.job.as_str()])?
    };
    let ended = call.run_by(&table(), &context.with_cancellation(stop));
    let error = match ended {
        Ok(response) => return print_json(&response),
        Err(error) => error,
    };
    // A job that was stopped answers with what it has.
    if let JobError::Stopped(stopped) = &error
        && let Some(response) = &stopped.response
    {
        print_json(response)?;
    }
    Ok(failed(&error, args.events))
}

/// The call of a file, or of stdin.
fn read(file: Option<&Path>) -> Result<Call, JobError> {
    if let Some(path) = file.filter(|path| *path != Path::new("-")) {
        return Call::read(path);
    }
    let text = io::read_to_string(io::stdin())
        .map_err(|e| JobError::input(format!("stdin: {e}"), "give the call as UTF-8 text"))?;
    Call::parse(&text)
}

/// Prints why a call has no response, as JSON where events are; returns the exit code.
fn failed(error: &JobError, is_json: bool) -> Code {
    let failure = Failure::of_call(error);
    if !is_json {
        return failure.report();
    }
    line(&Ended { event: "error", error: error.report() });
    failure.code()
}

/// The last line of events where a job has no response.
#[derive(Serialize)]
struct Ended {
    event: &'static str,
    #[serde(flatten)]
    error: ErrorReport,
}

/// Writes events to stderr as JSON, one a line.
struct JsonLines;

impl Watcher for JsonLines {
    fn event(&self, event: &Event) {
        line(event);
    }
}

/// Writes a value to stderr on a line of its own.
fn line(value: &impl Serialize) {
    // Events hold nothing that JSON cannot hold.
    if let Ok(text) = serde_json::to_string(value) {
        output::styled_note(&plain::json(&text));
    }
}

/// List the jobs that `petzval call` runs, with what they do.
#[derive(Debug, clap::Args)]
pub struct JobsArgs {
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn list(args: JobsArgs) -> Result<Code, Failure> {
    let table = table();
    print_response(args.json, &table.rows(), || {
        for job in table.rows() {
            outln!("{:<20} {}", job.name, job.about);
        }
    })
}
