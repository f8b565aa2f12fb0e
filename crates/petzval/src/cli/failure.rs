//! Failures: message, place in the file and hint for the user, and the exit code.

use std::path::Path;
use std::process::ExitCode;

use miette::{LabeledSpan, MietteDiagnostic, MietteHandlerOpts, NamedSource, Report};
use petzval::base::FileError;
use petzval::jobs::{Fault, JobError, text_of_file};

/// The job failed.
const EXIT_JOB: u8 = 1;
/// Bad usage or bad input.
pub const EXIT_INPUT: u8 = 2;

/// Turns off the wrapping of lines, so that a path in a message can be copied and searched for.
pub fn keep_lines_whole() {
    // A second call fails because the hook is already set, which is harmless.
    let _ = miette::set_hook(Box::new(|_| Box::new(MietteHandlerOpts::new().wrap_lines(false).build())));
}

/// Why the command ends without success.
#[derive(Debug)]
pub struct Failure {
    report: Report,
    code: u8,
}

impl Failure {
    /// The request was right, but the job failed.
    pub fn job(message: impl Into<String>) -> Self {
        Self { report: Report::new(MietteDiagnostic::new(message)), code: EXIT_JOB }
    }

    /// The request or a file is wrong.
    pub fn input(message: impl Into<String>, hint: impl Into<String>) -> Self {
        let diagnostic = MietteDiagnostic::new(message).with_help(hint);
        Self { report: Report::new(diagnostic), code: EXIT_INPUT }
    }

    /// Prints the failure on stderr; returns its exit code.
    pub fn report(self) -> ExitCode {
        noteln!("{:?}", self.report);
        ExitCode::from(self.code)
    }

    fn in_file(path: &Path, error: &FileError) -> Self {
        let place = match (error.line, error.column) {
            (Some(line), Some(column)) => format!("{}:{line}:{column}", path.display()),
            (Some(line), None) => format!("{}:{line}", path.display()),
            _ => path.display().to_string(),
        };
        let said = match (error.key.is_empty(), error.value.is_empty()) {
            (false, false) => format!("`{} = {}`: ", error.key, error.value),
            (false, true) => format!("`{}`: ", error.key),
            (true, false) => format!("`{}`: ", error.value),
            (true, true) => String::new(),
        };
        let mut diagnostic = MietteDiagnostic::new(format!("{place}: {said}{}", error.message));
        if let Some(hint) = &error.hint {
            diagnostic = diagnostic.with_help(hint.clone());
        }
        // Show the line itself, if the file can still be read.
        let report = match (text_of_file(path), error.line) {
            (Some(text), Some(line)) => {
                let start: usize = text.split_inclusive('\n').take(line as usize - 1).map(str::len).sum();
                let length = text[start..].lines().next().map_or(0, str::len);
                let label = LabeledSpan::at(start..start + length, "here");
                Report::new(diagnostic.with_label(label))
                    .with_source_code(NamedSource::new(path.display().to_string(), text))
            }
            _ => Report::new(diagnostic),
        };
        Self { report, code: EXIT_INPUT }
    }
}

impl From<JobError> for Failure {
    /// Names a setting of the request as its flag: `corner_mm` as `--corner-mm`.
    fn from(error: JobError) -> Self {
        let code = match error.fault() {
            Fault::Input => EXIT_INPUT,
            Fault::Job => EXIT_JOB,
        };
        let (message, hint) = match error {
            JobError::File { path, error } => return Self::in_file(&path, &error),
            JobError::Setting { key, value, message, hint } => {
                let flag = format!("--{}", key.replace('_', "-"));
                let named = if value.is_empty() { flag } else { format!("{flag} {value}") };
                (format!("{named}: {message}"), hint)
            }
            JobError::Input { message, hint } => (message, hint),
            JobError::Failed(message) | JobError::Stopped(message) => (message, String::new()),
        };
        let mut diagnostic = MietteDiagnostic::new(message);
        if !hint.is_empty() {
            diagnostic = diagnostic.with_help(hint);
        }
        Self { report: Report::new(diagnostic), code }
    }
}
