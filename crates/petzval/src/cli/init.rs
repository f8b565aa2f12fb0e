//! `petzval init`: an experiment to edit.

use std::path::PathBuf;
use std::process::ExitCode;

use petzval::jobs::init::{self, Request};

use super::failure::Failure;
use super::terminal::{Terminal, print_json};

/// Write an experiment with its lens and its sensor as files of your own, to edit and run.
///
/// experiment.toml holds every key, with the range of each number or the words to choose from, and a sentence; lens.toml and sensor.toml stand beside
/// it. A lens file of another program (.zmx, .seq, .json) will do. A lens that names no variables gets the usual ones: its radii, and its gaps of air; the last radius holds
/// the focal length.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the files
    #[arg(default_value = "my-camera")]
    out: PathBuf,
    /// Experiment to start from, by built-in name or file; `petzval experiment list` names them
    #[arg(long, value_name = "NAME", default_value = "cooke-triplet-image-quality")]
    from: String,
    /// Lens in place of the experiment's, by built-in name or file
    #[arg(long, value_name = "LENS")]
    lens: Option<String>,
    /// Sensor in place of the experiment's, by built-in name or file
    #[arg(long, value_name = "SENSOR")]
    sensor: Option<String>,
    /// Print the paths as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<ExitCode, Failure> {
    let request = Request { out: args.out, from: args.from, lens: args.lens, sensor: args.sensor };
    let response = init::run(&request, &terminal.context())?;
    if args.json {
        return print_json(&response);
    }
    let variables = match response.gave_variables {
        true => "  with variables that the file did not name: look at their bounds",
        false => "",
    };
    outln!("{}{variables}", response.lens.display());
    outln!("{}", response.sensor.display());
    outln!("{}", response.experiment.display());
    outln!("\nnext: petzval design {}", response.experiment.display());
    Ok(ExitCode::SUCCESS)
}
