//! `petzval sensor`: shows sensors, measures one, simulates its captures.

mod capture;
mod characterize;
mod list;
mod show;

use clap::Subcommand;

use super::failure::Failure;
use super::terminal::Terminal;
use crate::cli::code::Code;

/// Verbs about a sensor.
#[derive(Debug, Subcommand)]
pub enum SensorVerb {
    #[command(about = "List the built-in sensors")]
    List(list::Args),
    #[command(about = "Show the numbers of a sensor file, and the EMVA 1288 figures that follow")]
    Show(show::Args),
    #[command(
        about = "Simulate the calibration series of a sensor: flat and dark frames over gains and exposure times"
    )]
    Capture(capture::Args),
    #[command(
        about = "Measure a sensor from captures: EMVA 1288, and the paper's calibration over all gains"
    )]
    Characterize(characterize::Args),
}

/// Runs a verb.
pub fn run(verb: SensorVerb, terminal: &Terminal) -> Result<Code, Failure> {
    match verb {
        SensorVerb::List(args) => list::run(args, terminal),
        SensorVerb::Show(args) => show::run(args, terminal),
        SensorVerb::Capture(args) => capture::run(args, terminal),
        SensorVerb::Characterize(args) => characterize::run(args, terminal),
    }
}
