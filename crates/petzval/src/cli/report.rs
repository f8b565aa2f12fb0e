//! `petzval report`: write the report of a run again.

use std::path::PathBuf;
use std::process::ExitCode;

use petzval::jobs::report;

use super::{Failure, context};

/// Write report.html of a finished run again, from what the run folder holds.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let response = report::run(&report::Request { run: args.run }, &context())?;
    println!("{}", response.report.display());
    Ok(ExitCode::SUCCESS)
}
