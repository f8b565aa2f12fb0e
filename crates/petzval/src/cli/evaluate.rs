//! `petzval evaluate`: score the cameras of a run again, with exact optics.

use std::path::PathBuf;
use std::process::ExitCode;

use petzval::jobs::evaluate;
use serde_json::json;

use super::failure::Failure;
use super::score_table;
use super::terminal::{Terminal, print_json};

/// Score the cameras of a finished run again: lenses by exact tracing, pictures on the held-out photographs.
///
/// Nothing in the run folder is changed. The last line gives the largest difference from the run's own figures.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,
    /// Device for tensors; `petzval doctor` lists them
    #[arg(long, default_value = "cpu")]
    device: String,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<ExitCode, Failure> {
    let request = evaluate::Request { run: args.run, device: args.device };
    let evaluate::Response { metrics, largest_difference_from_run: largest } =
        evaluate::run(&request, &terminal.context())?;
    if args.json {
        return print_json(&json!({ "metrics": metrics, "largest_difference_from_run": largest }));
    }
    score_table::print(&metrics);
    println!("largest difference from the run's own figures: {largest:.3e}");
    Ok(ExitCode::SUCCESS)
}
