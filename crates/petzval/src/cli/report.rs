//! `petzval report`: write the report of a run again.

use std::path::PathBuf;
use std::process::ExitCode;

use petzval::jobs::report;

use super::failure::Failure;
use super::terminal::Terminal;

/// Write report.html of a finished run again, from the contents of its folder.
///
/// With --photo the report also shows a photograph over the whole sensor, as every camera takes it; the frames stay in the folder
/// pictures of the run, and later reports show them too.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,
    /// Photograph that every camera takes over its whole sensor
    #[arg(long, value_name = "FILE")]
    photo: Option<PathBuf>,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<ExitCode, Failure> {
    let response = report::run(&report::Request { run: args.run, photo: args.photo }, &terminal.context())?;
    println!("{}", response.report.display());
    Ok(ExitCode::SUCCESS)
}
