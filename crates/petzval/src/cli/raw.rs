//! `petzval raw`: look at raw frames, or write them in another format.

mod convert;
mod show;

use std::process::ExitCode;

use clap::Subcommand;

use super::Failure;

/// Verbs about raw frames.
#[derive(Debug, Subcommand)]
pub enum RawVerb {
    /// Camera and exposure of a frame, and its digital numbers colour by colour
    Show(show::Args),
    /// Write a frame in another format, with its sidecar
    Convert(convert::Args),
}

/// Runs a verb.
pub fn run(verb: RawVerb) -> Result<ExitCode, Failure> {
    match verb {
        RawVerb::Show(args) => show::run(args),
        RawVerb::Convert(args) => convert::run(args),
    }
}
