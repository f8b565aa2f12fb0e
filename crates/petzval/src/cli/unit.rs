//! `petzval unit`: units of work in a store that many processes share.

mod gather;
mod list;
mod run;
mod status;

use clap::Subcommand;

use super::code::Code;
use super::failure::Failure;
use super::terminal::Terminal;

#[derive(Debug, Subcommand)]
pub enum UnitVerb {
    #[command(about = "Run units that have no result yet; go on with those that were stopped")]
    Run(run::Args),
    #[command(about = "Show where the units of a store stand")]
    Status(status::Args),
    #[command(about = "List the units of a file with their keys; nothing is run")]
    List(list::Args),
    #[command(about = "Join the lenses of tolerance analyses that were made in parts")]
    Gather(gather::Args),
}

/// Runs the verb.
pub fn run(verb: UnitVerb, terminal: &Terminal) -> Result<Code, Failure> {
    match verb {
        UnitVerb::Run(args) => run::run(args, terminal),
        UnitVerb::Status(args) => status::run(args, terminal),
        UnitVerb::List(args) => list::run(args, terminal),
        UnitVerb::Gather(args) => gather::run(args, terminal),
    }
}
