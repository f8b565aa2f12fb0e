//! `petzval lens`: look at a lens, or make it better.

mod optimize;
mod show;
mod tolerance;
mod trace;

use std::process::ExitCode;

use clap::Subcommand;

use super::Failure;

/// Verbs about a lens.
#[derive(Debug, Subcommand)]
pub enum LensVerb {
    /// Prescription, first-order properties, Seidel sums and RMS spots
    Show(show::Args),
    /// One ray through every surface
    Trace(trace::Args),
    /// Smaller spots within bounds, by descent or by a global search
    Optimize(Box<optimize::Args>),
    /// What becomes of a lens when it is made: sensitivities, random lenses, yield
    Tolerance(tolerance::Args),
}

/// Runs a verb.
pub fn run(verb: LensVerb) -> Result<ExitCode, Failure> {
    match verb {
        LensVerb::Show(args) => show::run(&args),
        LensVerb::Trace(args) => trace::run(&args),
        LensVerb::Optimize(args) => optimize::run(&args),
        LensVerb::Tolerance(args) => tolerance::run(&args),
    }
}
