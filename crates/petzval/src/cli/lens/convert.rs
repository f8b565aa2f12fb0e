//! `petzval lens convert`: a lens from one file format to another, with a report of what is lost.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use petzval::jobs::lens::convert;

use crate::cli::{Failure, context, print_json};

/// Convert a lens between Petzval's format (.toml), Zemax's (.zmx) and CODE V's (.seq). The endings say which is which.
///
/// Reports everything that the new file does not hold, and refuses a lens that would bend light otherwise there.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    #[arg(value_name = "IN")]
    from: String,
    /// The file to write, whose ending names the format
    #[arg(value_name = "OUT")]
    to: PathBuf,
    /// The report on stdout, for machines
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let response = convert::run(&convert::Request { from: args.from, to: args.to }, &context())?;
    if args.json {
        return print_json(&response);
    }
    let (from, to) = (Path::new(&response.from), response.to.as_path());
    for (losses, file) in [(&response.losses_of_reading, from), (&response.losses_of_writing, to)] {
        for loss in losses {
            eprintln!("{}: {}", loss.effect.name(), loss.in_file(file));
        }
    }
    println!("{}", to.display());
    Ok(ExitCode::SUCCESS)
}
