//! The one writer of the command: data to stdout, notes to stderr.
//!
//! Neither holds control characters: names and values of others may contain them. Lines of notes are cut.
//!
//! Notes that cannot be written are dropped, so that a lost terminal or a full disk ends no run. Data that cannot be written are
//! dropped as well, while the job goes on with its files; [`finish`] then ends the command with a sentence and exit code 1. A closed
//! pipe, as behind `| head`, ends it quietly.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::process::ExitCode;
use std::sync::OnceLock;

use super::failure::{self, EXIT_INPUT, Failure};
use super::plain;

/// Writes formatted data to stdout.
macro_rules! out {
    ($($text:tt)*) => { $crate::cli::output::data(format_args!($($text)*)) };
}

/// Writes formatted data to stdout, and ends the line.
macro_rules! outln {
    () => { $crate::cli::output::data(format_args!("\n")) };
    ($($text:tt)*) => { $crate::cli::output::data(format_args!("{}\n", format_args!($($text)*))) };
}

/// Writes a line to stderr, for the user and not for the next program.
macro_rules! noteln {
    ($($text:tt)*) => { $crate::cli::output::note(format_args!($($text)*)) };
}

/// The first error of stdout. After it nothing more is written there.
static LOST: OnceLock<io::Error> = OnceLock::new();

/// Writes data to stdout. See `out!` and `outln!`.
pub fn data(text: Arguments) {
    if !is_lost() {
        keep(io::stdout().lock().write_all(plain::plain(&text.to_string()).as_bytes()));
    }
}

/// Writes a line to stderr. See `noteln!`.
pub fn note(text: Arguments) {
    styled_note(&plain::message(&text.to_string()));
}

/// Writes a line to stderr that has colours. The names and values in it are [`plain`] already.
pub fn styled_note(text: &str) {
    // In one piece, so that lines of other processes on the same terminal do not cut it.
    let _dropped = io::stderr().lock().write_all(format!("{text}\n").as_bytes());
}

/// Whether data could not be written.
pub fn is_lost() -> bool {
    LOST.get().is_some()
}

/// Ends the command: reports a failure, writes what is left of the data, and chooses the exit code.
pub fn finish(ending: Result<ExitCode, Failure>) -> ExitCode {
    let code = ending.unwrap_or_else(Failure::report);
    keep(io::stdout().flush());
    let has_succeeded = code == ExitCode::SUCCESS;
    match LOST.get() {
        None => code,
        Some(error) if error.kind() == ErrorKind::BrokenPipe => {
            if has_succeeded {
                end_by_broken_pipe();
            }
            code
        }
        Some(error) => {
            let lost = Failure::job(format!("stdout: the results cannot be printed: {error}")).report();
            if has_succeeded { lost } else { code }
        }
    }
}

/// Ends the command after arguments that cannot be parsed, or after `--help` and `--version`.
pub fn usage(said: &clap::Error) -> ExitCode {
    // Arguments are quoted as they are.
    let text = said.render().to_string();
    if said.use_stderr() && plain::message(&text) != text {
        note(format_args!("{}", text.trim_end()));
        return ExitCode::from(EXIT_INPUT);
    }
    failure::keep_lines_whole();
    let written = said.print();
    if said.use_stderr() {
        return ExitCode::from(EXIT_INPUT);
    }
    keep(written);
    finish(Ok(ExitCode::SUCCESS))
}

fn keep(written: io::Result<()>) {
    if let Err(error) = written {
        // Only the first error counts.
        let _later = LOST.set(error);
    }
}

/// Dies of SIGPIPE, as other programs do whose reader is gone.
#[cfg(unix)]
fn end_by_broken_pipe() {
    // If this fails, the exit code remains.
    let _lives = signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGPIPE);
}

#[cfg(not(unix))]
fn end_by_broken_pipe() {}
