//! Common parts of all verbs: the built-in library with the user's glasses, reports of jobs on stderr, and JSON on stdout.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use petzval::jobs::{Assets, Context, json};

use super::failure::Failure;
use super::plain;
use super::watcher::Stderr;

/// Exit code after a signal: a checkpoint was written (EX_TEMPFAIL of sysexits).
pub const EXIT_STOPPED: u8 = 75;

/// The environment of a verb: the library, and stderr for the reports of jobs.
pub struct Terminal {
    /// The built-in library; the user's glasses take precedence.
    pub assets: Assets,
    /// Whether results that are there are overwritten.
    pub overwrites: bool,
}

impl Terminal {
    /// The context of one job. Its reports go to stderr; its progress bar disappears with the context.
    pub fn context(&self) -> Context {
        Context::new(self.assets.clone(), Arc::new(Stderr::new())).overwriting(self.overwrites)
    }
}

/// Prints a value as JSON on stdout, indented, with the keys of its objects in order.
pub fn print_json(value: &impl serde::Serialize) -> Result<ExitCode, Failure> {
    outln!("{}", plain::json(&json(value)?));
    Ok(ExitCode::SUCCESS)
}

/// A path as it can be pasted into a shell: one with spaces is quoted.
pub fn pasted(path: &Path) -> String {
    let path = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+,:@%\\".contains(c);
    if path.chars().all(is_plain) { path } else { format!("'{}'", path.replace('\'', "'\\''")) }
}

/// How a training ended after so many steps, as an exit code. One that was stopped says how to go on.
pub fn training_ending(is_finished: bool, steps: usize) -> ExitCode {
    if is_finished {
        return ExitCode::SUCCESS;
    }
    noteln!("stopped after {steps} steps; --resume continues");
    ExitCode::from(EXIT_STOPPED)
}
