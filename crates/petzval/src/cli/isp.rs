//! `petzval isp`: shows image signal processors, develops raw frames, measures what they make of a test chart, tunes parameters.

mod chart;
mod develop;
pub(crate) mod inputs;
mod show;
mod tune;

use clap::Subcommand;

use super::failure::Failure;
use super::terminal::Terminal;
use crate::cli::code::Code;

/// Verbs about image signal processors.
#[derive(Debug, Subcommand)]
pub enum IspVerb {
    #[command(about = "Show the parameters of an ISP")]
    Show(show::Args),
    #[command(about = "Develop raw frames to pictures")]
    Develop(develop::Args),
    #[command(about = "Measure colours, noise and sharpness of a developed test chart")]
    Chart(chart::Args),
    #[command(about = "Find the parameters that bring developed frames nearest to references")]
    Tune(tune::Args),
}

/// Runs a verb.
pub fn run(verb: IspVerb, terminal: &Terminal) -> Result<Code, Failure> {
    match verb {
        IspVerb::Show(args) => show::run(args, terminal),
        IspVerb::Develop(args) => develop::run(args, terminal),
        IspVerb::Chart(args) => chart::run(args, terminal),
        IspVerb::Tune(args) => tune::run(args, terminal),
    }
}
