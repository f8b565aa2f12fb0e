//! How the command ends: with a failure, with data that could not be written, or well.

use std::io::ErrorKind;
use std::process::ExitCode;

use super::failure::{self, EXIT_INPUT, Failure};
use super::{output, plain};

/// Ends the command: reports a failure, writes what is left of the data, and chooses the exit code.
pub fn finish(ending: Result<ExitCode, Failure>) -> ExitCode {
    let code = ending.unwrap_or_else(Failure::report);
    output::flush();
    let has_succeeded = code == ExitCode::SUCCESS;
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
pub fn usage(said: &clap::Error) -> ExitCode {
    // Arguments are quoted as they are.
    let text = said.render().to_string();
    let is_error = output::is_error(said);
    if is_error && plain::message(&text) != text {
        output::note(format_args!("{}", text.trim_end()));
        return ExitCode::from(EXIT_INPUT);
    }
    failure::keep_lines_whole();
    output::of_arguments(said);
    if is_error { ExitCode::from(EXIT_INPUT) } else { finish(Ok(ExitCode::SUCCESS)) }
}

/// Dies of SIGPIPE, as other programs do whose reader is gone.
#[cfg(unix)]
fn end_by_broken_pipe() {
    // If this fails, the exit code remains.
    let _lives = signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGPIPE);
}

#[cfg(not(unix))]
fn end_by_broken_pipe() {}
