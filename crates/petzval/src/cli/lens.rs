//! `petzval lens`: look at a lens, or make it better.

mod analyze;
mod bar;
mod convert;
mod focus;
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
    /// Layout, spots, fans, MTF and everything else a designer looks at, as pictures and data
    Analyze(analyze::Args),
    /// From one file format to another, with a report of what is lost
    Convert(convert::Args),
    /// One ray through every surface
    Trace(trace::Args),
    /// Smaller spots within bounds, by descent or by a global search
    Optimize(Box<optimize::Args>),
    /// How errors in its making change a lens: sensitivities, random lenses, yield
    Tolerance(tolerance::Args),
}

/// Runs a verb.
pub fn run(verb: LensVerb) -> Result<ExitCode, Failure> {
    match verb {
        LensVerb::Show(args) => show::run(args),
        LensVerb::Analyze(args) => analyze::run(args),
        LensVerb::Convert(args) => convert::run(args),
        LensVerb::Trace(args) => trace::run(args),
        LensVerb::Optimize(args) => optimize::run(*args),
        LensVerb::Tolerance(args) => tolerance::run(args),
    }
}
