//! Failures: message, place in the file and hint for the user, and the exit code.

use std::path::Path;
use std::sync::OnceLock;

use crate::base::{FileError, reason_and_hint};
use crate::cli::code::Code;
use crate::jobs::{Fault, JobError, Place, Stopped, text_of_file};
use crate::units::store::may_pass;
use miette::{LabeledSpan, MietteDiagnostic, MietteHandlerOpts, NamedSource, Report};

use super::plain::shown;
use super::{output, plain};

/// Turns off the wrapping of lines, so that a path in a message can be copied and searched for.
pub fn keep_lines_whole() {
    // A second call fails because the hook is already set, which is harmless.
    let _ = miette::set_hook(Box::new(|_| Box::new(MietteHandlerOpts::new().wrap_lines(false).build())));
}

/// Why the command ends without success.
#[derive(Debug)]
pub struct Failure {
    report: Report,
    code: Code,
}

impl Failure {
    /// The request was right, but the job failed.
    pub fn job(message: impl Into<String>) -> Self {
        Self { report: Report::new(diagnostic(&message.into(), "")), code: Code::FAILURE }
    }

    /// The request or a file is wrong.
    pub fn input(message: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { report: Report::new(diagnostic(&message.into(), &hint.into())), code: Code::INPUT }
    }

    /// The failure of a call: a setting is named as the key of the request, and a job that goes on says with which request.
    pub fn of_call(error: &JobError) -> Self {
        let code = code_of(error);
        let report = match error {
            JobError::File { path, error } => return Self::in_file(path, error),
            JobError::Setting { hint, .. } | JobError::Input { hint, .. } => {
                diagnostic(&error.to_string(), hint)
            }
            JobError::Stopped(stopped) => {
                let again =
                    stopped.resume.as_ref().map(|request| format!("it goes on with the request {request}"));
                let said = [Some(kept_in_words(stopped)).filter(|kept| !kept.is_empty()), again];
                diagnostic(&stopped.message, &said.into_iter().flatten().collect::<Vec<_>>().join("; "))
            }
            JobError::Failed(_) | JobError::Panic { .. } => diagnostic(&error.to_string(), ""),
        };
        Self { report: Report::new(report), code }
    }

    /// The failure of a job on a store of units, which may be full or out of reach for a while: then the same command goes on.
    pub fn of_store(error: JobError) -> Self {
        let passes = may_pass(&error);
        let failure = Self::from(error);
        if passes { Self { code: Code::STORE, ..failure } } else { failure }
    }

    /// Its exit code.
    pub fn code(&self) -> Code {
        self.code
    }

    /// Prints the failure on stderr; returns its exit code.
    pub fn report(self) -> Code {
        output::styled_note(&format!("{:?}", self.report));
        self.code
    }

    fn in_file(path: &Path, error: &FileError) -> Self {
        let name = shown(path);
        let place = Place::of_file(Path::new(&name), error);
        let message = format!("{}{}", place.in_words(), error.message);
        let mut diagnostic = diagnostic(&message, error.hint.as_deref().unwrap_or(""));
        // Show the line itself, if the file can still be read.
        let shown =
            error.line.and_then(|line| Some((excerpt(&text_of_file(path)?, line, error.column), line)));
        let report = match shown {
            Some((text, line)) => {
                let start: usize = text.split_inclusive('\n').take(line as usize - 1).map(str::len).sum();
                let length = text[start..].lines().next().map_or(0, str::len);
                diagnostic = diagnostic.with_label(LabeledSpan::at(start..start + length, "here"));
                Report::new(diagnostic).with_source_code(NamedSource::new(plain::message(&name), text))
            }
            None => Report::new(diagnostic),
        };
        Self { report, code: Code::INPUT }
    }
}

/// A message with a hint. If the hint is empty, the message may be an error that writes its own as one text.
fn diagnostic(message: &str, hint: &str) -> MietteDiagnostic {
    let (message, hint) = match hint {
        "" => reason_and_hint(message),
        hint => (message, hint),
    };
    let diagnostic = MietteDiagnostic::new(plain::message(message));
    match hint {
        "" => diagnostic,
        hint => diagnostic.with_help(plain::message(hint)),
    }
}

/// A file up to the line after the given one, with long lines cut: the given one around its column, from 1. Lines that are not shown are empty.
fn excerpt(text: &str, line: u32, column: Option<u32>) -> String {
    let (line, column) = (line as usize, column.unwrap_or(1) as usize);
    let shown = |(number, text): (usize, &str)| match number.abs_diff(line) {
        0 => plain::around(text, column - 1),
        1 => plain::around(text, 0),
        _ => String::new(),
    };
    let lines: Vec<String> = (1..=line + 1).zip(text.lines()).map(shown).collect();
    lines.join("\n")
}

impl From<JobError> for Failure {
    /// Names a setting of the request as its argument: `corner_mm` as `--corner-mm`.
    fn from(error: JobError) -> Self {
        let code = code_of(&error);
        let (message, hint) = match error {
            JobError::File { path, error } => return Self::in_file(&path, &error),
            JobError::Setting { key, value, message, hint } => {
                let flag = argument(key);
                let named = if value.is_empty() { flag } else { format!("{flag} {value}") };
                (format!("{named}: {message}"), hint)
            }
            JobError::Input { message, hint, .. } => (message, hint),
            JobError::Failed(message) => (message, String::new()),
            JobError::Stopped(stopped) => (stopped.message.clone(), kept_in_words(&stopped)),
            error @ JobError::Panic { .. } => {
                (error.to_string(), "please report it with the command that led to it".to_owned())
            }
        };
        Self { report: Report::new(diagnostic(&message, &hint)), code }
    }
}

/// Makes the description of the command, whose arguments are looked up only where one is named.
static COMMAND: OnceLock<fn() -> clap::Command> = OnceLock::new();

/// Notes how the description of the command is made. Until then, every setting counts as a flag.
pub fn know_command(command: fn() -> clap::Command) {
    COMMAND.get_or_init(|| command);
}

/// A setting of a request as users write it: as a flag of some verb, or in capitals where it has none. Places of arguments are written so.
fn argument(key: &str) -> String {
    fn has_flag(command: &clap::Command, name: &str) -> bool {
        command.get_arguments().any(|argument| argument.get_long() == Some(name))
            || command.get_subcommands().any(|verb| has_flag(verb, name))
    }
    let name = key.replace('_', "-");
    let is_flag = COMMAND.get().is_none_or(|command| has_flag(&command(), &name));
    if is_flag { format!("--{name}") } else { name.to_uppercase() }
}

/// The exit code of an error. What goes on from a checkpoint is only interrupted.
fn code_of(error: &JobError) -> Code {
    match (error, error.fault()) {
        (JobError::Stopped(stopped), _) if stopped.resume.is_some() => Code::STOPPED,
        (_, Fault::Input) => Code::INPUT,
        (_, Fault::Job) => Code::FAILURE,
    }
}

/// Files that a message names of those that a stopped job keeps.
const NAMED: usize = 3;

/// What a stopped job keeps, in words; empty if it is nothing.
fn kept_in_words(stopped: &Stopped) -> String {
    let named: Vec<String> = stopped.kept.iter().take(NAMED).map(shown).collect();
    match (named.is_empty(), stopped.kept.len().saturating_sub(NAMED)) {
        (true, _) => String::new(),
        (false, 0) => format!("kept: {}", named.join(", ")),
        (false, more) => format!("kept: {}, and {more} more", named.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Error;

    use crate::units::store::StoreError;

    use super::*;

    #[test]
    fn a_full_store_is_no_failed_unit() {
        // ENOSPC, EIO, ETIMEDOUT, EROFS.
        for (number, code) in [(28, Code::STORE), (5, Code::STORE), (110, Code::STORE), (30, Code::INPUT)] {
            let source = Error::from_raw_os_error(number);
            let error = JobError::from(StoreError::Io { path: "/store".into(), source });
            assert_eq!(Failure::of_store(error).code(), code, "{number}");
        }
        assert_eq!(Failure::of_store(JobError::failed("no light")).code(), Code::FAILURE);
    }

    #[test]
    fn settings_are_named_as_users_write_them() {
        know_command(<crate::cli::Cli as clap::CommandFactory>::command);
        for (key, named) in [("corner_mm", "--corner-mm"), ("threads", "--threads"), ("raws", "RAWS")] {
            assert_eq!(argument(key), named);
        }
    }

    #[test]
    fn a_hint_at_the_end_of_a_message_is_one() {
        for (message, hint) in [("no light; hint: open the stop", ""), ("no light", "open the stop")] {
            let made = diagnostic(message, hint);
            assert_eq!((made.message.as_str(), made.help.as_deref()), ("no light", Some("open the stop")));
        }
        assert_eq!(diagnostic("no light", "").help, None);
    }

    #[test]
    fn an_excerpt_keeps_the_numbers_of_lines_and_cuts_them() {
        let text = format!("a\nb\u{1b}\n{}X{}\nd\ne\n", "c".repeat(5000), "c".repeat(5000));
        let shown = excerpt(&text, 3, Some(5001));
        let lines: Vec<&str> = shown.split('\n').collect();
        assert_eq!((lines[0], lines[1], lines[3], lines.len()), ("", r"b\u{1b}", "d", 4));
        assert!(lines[2].contains('X') && lines[2].len() < 140, "{shown}");
    }
}
