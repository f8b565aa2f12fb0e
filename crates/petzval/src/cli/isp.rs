//! `petzval isp`: shows image signal processors, develops raw frames, tunes parameters.

mod develop;
pub(crate) mod inputs;
mod show;
mod tune;

use std::process::ExitCode;

use clap::Subcommand;

use super::failure::Failure;
use super::terminal::Terminal;

/// Verbs about image signal processors.
#[derive(Debug, Subcommand)]
pub enum IspVerb {
    #[command(about = "Show the parameters of an ISP")]
    Show(show::Args),
    #[command(about = "Develop raw frames to pictures")]
    Develop(develop::Args),
    #[command(about = "Find the parameters that bring developed frames nearest to references")]
    Tune(tune::Args),
}

/// Runs a verb.
pub fn run(verb: IspVerb, terminal: &Terminal) -> Result<ExitCode, Failure> {
    match verb {
        IspVerb::Show(args) => show::run(args, terminal),
        IspVerb::Develop(args) => develop::run(args, terminal),
        IspVerb::Tune(args) => tune::run(args, terminal),
    }
}
