//! The one writer of the command: data to stdout, notes to stderr.
//!
//! Neither holds control characters: names and values of others may contain them. Lines of notes are cut.
//!
//! Notes that cannot be written are dropped, so that a lost terminal or a full disk ends no run. Data that cannot be written are
//! dropped as well, while the job goes on with its files; [`finish`](super::ending::finish) then ends the command with a sentence and exit code 1. A closed
//! pipe, as behind `| head`, ends it quietly. A stdout that is closed from the start (`>&-`) is as `/dev/null`, which Rust opens in its place
//! before `main`; nothing tells the two apart.

use std::fmt::Arguments;
use std::io::{self, Write};
use std::sync::OnceLock;

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
    styled_note(&plain::messages(&text.to_string()));
}

/// Writes a line to stderr that has colours. The names and values in it are [`plain`] already.
pub fn styled_note(text: &str) {
    // In one piece, so that lines of other processes on the same terminal do not cut it.
    let _dropped = io::stderr().lock().write_all(format!("{text}\n").as_bytes());
}

/// The first error of stdout, if data could not be written.
pub(super) fn lost() -> Option<&'static io::Error> {
    LOST.get()
}

/// Whether data could not be written.
pub fn is_lost() -> bool {
    LOST.get().is_some()
}

/// Whether what the parser of arguments says is an error, for stderr; else it is the help or the version, for stdout.
pub(super) fn is_error(said: &clap::Error) -> bool {
    said.use_stderr()
}

/// Writes what the parser of arguments says.
pub(super) fn of_arguments(said: &clap::Error) {
    let written = said.print();
    if !is_error(said) {
        keep(written);
    }
}

/// Writes what is left of the data.
pub(super) fn flush() {
    keep(io::stdout().flush());
}

/// Keeps the first error of stdout.
fn keep(written: io::Result<()>) {
    if let Err(error) = written {
        // Only the first error counts.
        let _later = LOST.set(error);
    }
}
