//! `petzval report`: write the report of a run again.

use std::path::PathBuf;
use std::process::ExitCode;

use petzval::built_in_assets;
use petzval::design::run::{RunFolder, write_atomically};
use petzval::design::run_report::{read_metrics, report_of_run};
use petzval::design::setup::Setup;
use petzval::report::design_report::html;

use super::{Failure, context};

/// Write report.html of a finished run again, from what the run folder holds.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let folder = RunFolder::open(&args.run)?;
    read_metrics(&folder)?;
    let assets = built_in_assets();
    let experiment = assets.experiment(&folder.config().display().to_string())?;
    let setup = Setup::without_photos(experiment, &assets, context().device("cpu")?)?;
    println!("{}", write(&setup, &folder)?.display());
    Ok(ExitCode::SUCCESS)
}

/// Writes the report of a run; returns its path.
pub fn write(setup: &Setup, folder: &RunFolder) -> Result<PathBuf, Failure> {
    let command = format!("petzval design {}", folder.config().display());
    let report = report_of_run(setup, folder, &command)?;
    write_atomically(&folder.report(), html(&report).as_bytes())?;
    Ok(folder.report())
}
