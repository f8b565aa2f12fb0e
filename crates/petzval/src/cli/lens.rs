//! `petzval lens`: shows, analyses, converts, optimises and tolerances lenses.

mod analyze;
mod convert;
mod focus;
mod list;
mod optimize;
mod show;
mod tolerance;
mod trace;

use clap::Subcommand;

use super::failure::Failure;
use super::terminal::Terminal;
use crate::cli::code::Code;

/// Verbs about a lens.
#[derive(Debug, Subcommand)]
pub enum LensVerb {
    #[command(about = "List the built-in lenses")]
    List(list::Args),
    #[command(about = "Show prescription, first-order properties, Seidel sums and RMS spots")]
    Show(show::Args),
    #[command(about = "Write layout, spots, fans, MTF and further analyses, as pictures and data")]
    Analyze(analyze::Args),
    #[command(about = "Convert to another file format, with a report of what is lost")]
    Convert(convert::Args),
    #[command(about = "Move the image plane to the best focus, and write the lens again")]
    Focus(focus::Args),
    #[command(about = "Trace one ray through every surface")]
    Trace(trace::Args),
    #[command(about = "Make the spots smaller within bounds, by descent or by a global search")]
    Optimize(Box<optimize::Args>),
    #[command(about = "Compute how manufacturing errors change a lens: sensitivities, random lenses, yield")]
    Tolerance(tolerance::Args),
}

/// Runs a verb.
pub fn run(verb: LensVerb, terminal: &Terminal) -> Result<Code, Failure> {
    match verb {
        LensVerb::List(args) => list::run(args, terminal),
        LensVerb::Show(args) => show::run(args, terminal),
        LensVerb::Analyze(args) => analyze::run(args, terminal),
        LensVerb::Convert(args) => convert::run(args, terminal),
        LensVerb::Focus(args) => focus::run(args, terminal),
        LensVerb::Trace(args) => trace::run(args, terminal),
        LensVerb::Optimize(args) => optimize::run(*args, terminal),
        LensVerb::Tolerance(args) => tolerance::run(args, terminal),
    }
}
