//! `petzval raw`: shows raw frames, measures their sharpness, or writes them in another format.

mod convert;
mod mtf;
mod show;

use clap::Subcommand;

use super::failure::Failure;
use super::terminal::Terminal;
use crate::cli::code::Code;

/// Verbs about raw frames.
#[derive(Debug, Subcommand)]
pub enum RawVerb {
    #[command(about = "Show camera and exposure of a frame, and its digital numbers colour by colour")]
    Show(show::Args),
    #[command(about = "Write a frame in another format, with its sidecar")]
    Convert(convert::Args),
    #[command(about = "Measure the MTF at slanted edges of a raw frame or a picture (ISO 12233)")]
    Mtf(mtf::Args),
}

/// Runs a verb.
pub fn run(verb: RawVerb, terminal: &Terminal) -> Result<Code, Failure> {
    match verb {
        RawVerb::Show(args) => show::run(args, terminal),
        RawVerb::Convert(args) => convert::run(args, terminal),
        RawVerb::Mtf(args) => mtf::run(args, terminal),
    }
}
