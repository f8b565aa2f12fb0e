//! Common parts of all verbs: the built-in library with the user's glasses, reports of jobs on stderr, and JSON on stdout.

use std::ffi::OsString;
use std::sync::Arc;

use crate::cli::code::Code;
use crate::jobs::{Context, JobError, Library, Stopped, Watcher, json};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::failure::Failure;
use super::plain;
use super::watcher::Stderr;

/// How a job goes on whose results are in a folder.
pub const RESUME: &str = "--resume continues";

/// The environment of a verb: the library, and stderr for the reports of jobs.
pub struct Terminal {
    /// The built-in library; the user's glasses take precedence.
    pub assets: Library,
    /// Whether the user has named glasses, on the command line or by the environment.
    pub has_glasses: bool,
    /// Whether results that are there are overwritten.
    pub overwrites: bool,
    /// The words of the command line.
    pub words: Vec<OsString>,
}

impl Terminal {
    /// The command line, as runs keep it.
    pub fn command_line(&self) -> String {
        // An argument may be no text.
        let words: Vec<String> = self.words.iter().map(|word| word.to_string_lossy().into_owned()).collect();
        words.join(" ")
    }

    /// The context of one job. Its reports go to stderr; its progress bar disappears with the context.
    pub fn context(&self) -> Context {
        self.context_of(Arc::new(Stderr::new()))
    }

    /// The context of one job, whose reports go to a watcher.
    pub fn context_of(&self, watcher: Arc<dyn Watcher>) -> Context {
        Context::new(self.assets.clone(), watcher).overwriting(self.overwrites)
    }
}

/// Prints a value as JSON on stdout, indented, with the keys of its objects in order.
pub fn print_json(value: &impl Serialize) -> Result<Code, Failure> {
    outln!("{}", plain::json(&json(value)?));
    Ok(Code::SUCCESS)
}

/// Prints a response on stdout: as JSON, or in words by a function that prints them.
pub fn print_response(
    as_json: bool,
    response: &impl Serialize,
    in_words: impl FnOnce(),
) -> Result<Code, Failure> {
    if as_json {
        return print_json(response);
    }
    in_words();
    Ok(Code::SUCCESS)
}

/// The response of a job that has ended, or that was cancelled and holds what it has found until then. Then it is interrupted: the second value
/// says where it stopped.
pub fn found<R: DeserializeOwned>(ended: Result<R, JobError>) -> Result<(R, Option<Stopped>), Failure> {
    let stopped = match ended {
        Ok(response) => return Ok((response, None)),
        Err(JobError::Stopped(stopped)) => stopped,
        Err(other) => return Err(other.into()),
    };
    match stopped.response.clone().and_then(|response| serde_json::from_value(response).ok()) {
        Some(response) => Ok((response, Some(*stopped))),
        None => Err(JobError::Stopped(stopped).into()),
    }
}

/// The exit code of a job. One that was interrupted says where, and how to go on.
pub fn ending(stopped: Option<&Stopped>, going_on: &str) -> Code {
    match stopped {
        None => Code::SUCCESS,
        Some(stopped) => {
            noteln!("{}; {going_on}", plain::message(&stopped.message));
            Code::STOPPED
        }
    }
}

/// Prints what a job has found whose results are in a folder, and says how one goes on that was interrupted.
pub fn print_found<R: Serialize + DeserializeOwned>(
    ended: Result<R, JobError>,
    context: Context,
    as_json: bool,
    summary: impl Fn(&R) -> String,
) -> Result<Code, Failure> {
    let (response, stopped) = found(ended)?;
    drop(context);
    print_response(as_json, &response, || out!("{}", summary(&response)))?;
    Ok(ending(stopped.as_ref(), RESUME))
}
