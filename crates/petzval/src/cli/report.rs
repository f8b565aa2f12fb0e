//! `petzval report`: write the report of a run again.

use std::path::PathBuf;
use std::process::ExitCode;

use petzval::jobs::report;

use super::failure::Failure;
use super::terminal::Terminal;

/// Write report.html of a finished run again, from the contents of its folder.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<ExitCode, Failure> {
    let response = report::run(&report::Request { run: args.run }, &terminal.context())?;
    println!("{}", response.report.display());
    Ok(ExitCode::SUCCESS)
}
