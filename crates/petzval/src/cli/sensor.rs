//! `petzval sensor`: shows sensors, measures one, simulates its captures.

mod capture;
mod characterize;
mod list;
mod show;

use std::process::ExitCode;

use clap::Subcommand;

use super::failure::Failure;
use super::terminal::Terminal;

/// Verbs about a sensor.
#[derive(Debug, Subcommand)]
pub enum SensorVerb {
    /// List the built-in sensors
    List(list::Args),
    /// Show the numbers of a sensor file, and the EMVA 1288 figures that follow
    Show(show::Args),
    /// Simulate the calibration series of a sensor: flat and dark frames over gains and exposure times
    Capture(capture::Args),
    /// Measure a sensor from captures: EMVA 1288, and the paper's calibration over all gains
    Characterize(characterize::Args),
}

/// Runs a verb.
pub fn run(verb: SensorVerb, terminal: &Terminal) -> Result<ExitCode, Failure> {
    match verb {
        SensorVerb::List(args) => list::run(args, terminal),
        SensorVerb::Show(args) => show::run(args, terminal),
        SensorVerb::Capture(args) => capture::run(args, terminal),
        SensorVerb::Characterize(args) => characterize::run(args, terminal),
    }
}
