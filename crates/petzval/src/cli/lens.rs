//! `petzval lens`: shows, analyses, converts, optimises and tolerances lenses.

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
    /// Show prescription, first-order properties, Seidel sums and RMS spots
    Show(show::Args),
    /// Write layout, spots, fans, MTF and further analyses, as pictures and data
    Analyze(analyze::Args),
    /// Convert to another file format, with a report of what is lost
    Convert(convert::Args),
    /// Trace one ray through every surface
    Trace(trace::Args),
    /// Make the spots smaller within bounds, by descent or by a global search
    Optimize(Box<optimize::Args>),
    /// Compute how manufacturing errors change a lens: sensitivities, random lenses, yield
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
