//! How the command ends: with a failure, with data that could not be written, or well.

use std::ffi::OsString;
use std::io::ErrorKind;

use clap::Command;
use clap::error::ErrorKind as ErrorKindOfArguments;

use super::code::Code;
use super::failure::{self, Failure};
use super::plain::shown;
use super::{output, plain};

/// Ends the command: reports a failure, writes what is left of the data, and chooses the exit code.
pub fn finish(ending: Result<Code, Failure>) -> Code {
    let code = ending.unwrap_or_else(Failure::report);
    output::flush();
    let has_succeeded = code == Code::SUCCESS;
    match output::lost() {
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
pub fn usage(said: &clap::Error, words: &[OsString], command: fn() -> Command) -> Code {
    if said.kind() == ErrorKindOfArguments::InvalidUtf8
        && let Some(refused) = not_text(words, command)
    {
        let message =
            format!("{}: this argument is not UTF-8, and a name or a value is wanted here", shown(refused));
        failure::keep_lines_whole();
        return Failure::input(message, "rename the file; or copy it, or link to it, under another name")
            .report();
    }
    // Arguments are quoted as they are.
    let text = said.render().to_string();
    let is_error = output::is_error(said);
    if is_error && plain::messages(&text) != text {
        output::note(format_args!("{}", text.trim_end()));
        return Code::INPUT;
    }
    failure::keep_lines_whole();
    output::of_arguments(said);
    if is_error { Code::INPUT } else { finish(Ok(Code::SUCCESS)) }
}

/// The argument that is refused because it is not UTF-8. Folders and many files may have such names, so that not every one is refused.
fn not_text(arguments: &[OsString], command: fn() -> Command) -> Option<OsString> {
    let is_refused = |place: usize| {
        let others = arguments.iter().enumerate().map(|(other, argument)| {
            if other == place { argument.clone() } else { argument.to_string_lossy().into_owned().into() }
        });
        command().try_get_matches_from(others).is_err_and(|e| e.kind() == ErrorKindOfArguments::InvalidUtf8)
    };
    let place =
        (0..arguments.len()).find(|place| arguments[*place].to_str().is_none() && is_refused(*place))?;
    arguments.get(place).cloned()
}

/// Dies of SIGPIPE, as other programs do whose reader is gone.
#[cfg(unix)]
fn end_by_broken_pipe() {
    // If this fails, the exit code remains.
    let _lives = signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGPIPE);
}

#[cfg(not(unix))]
fn end_by_broken_pipe() {}
