//! `petzval evaluate`: score the cameras of a run again, with exact optics.

use std::path::PathBuf;
use std::process::ExitCode;

use petzval::jobs::evaluate;
use serde_json::json;

use super::{Failure, context, print_json};

/// Score the cameras of a finished run again: lenses by exact tracing, pictures on the held-out photographs.
///
/// Nothing in the run folder is changed. The table says how far each figure is from the run's own.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,
    /// Where tensors live
    #[arg(long, default_value = "cpu")]
    device: String,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let request = evaluate::Request { run: args.run, device: args.device };
    let evaluate::Response { metrics, largest_difference_from_run: largest, columns } =
        evaluate::run(&request, &context())?;
    if args.json {
        return print_json(&json!({ "metrics": metrics, "largest_difference_from_run": largest }));
    }
    super::design::print_table(&metrics, &columns);
    println!("largest difference from the run's own figures: {largest:.3e}");
    Ok(ExitCode::SUCCESS)
}
