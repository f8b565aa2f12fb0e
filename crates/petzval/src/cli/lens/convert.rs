//! `petzval lens convert`: converts a lens file to another format, with a report of what is lost.

use std::path::{Path, PathBuf};

use crate::jobs::lens::convert;

use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::terminal::{Terminal, print_response};

/// Convert a lens between the formats of Petzval (.toml), Zemax (.zmx) and CODE V (.seq); files of Optiland (.json) are read, too. The
/// endings of the names choose them.
///
/// Everything that the new file does not hold is reported. A lens that would bend light differently is refused.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    #[arg(value_name = "IN")]
    from: String,
    /// The file to write, whose ending names the format
    #[arg(value_name = "OUT")]
    to: PathBuf,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let response =
        convert::run(&convert::Request { from: args.from.into(), to: args.to }, &terminal.context())?;
    print_response(args.json, &response, || {
        let (from, to) = (Path::new(&response.from), response.to.as_path());
        for (losses, file) in [(&response.losses_of_reading, from), (&response.losses_of_writing, to)] {
            for loss in losses {
                noteln!("{}: {}", loss.effect.name(), shown(loss.in_file(file)));
            }
        }
        outln!("{}", shown(to));
    })
}
