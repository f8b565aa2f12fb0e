//! `petzval studio`: the page that shows a camera while one changes it.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::studio::{FOLDER, Settings, Studio, StudioError};

use super::failure::Failure;
use super::terminal::Terminal;
use super::{output, signals};

/// Show a lens and the photographs through it in the browser, and change it there: layout, spots, MTF and picture follow every drag.
///
/// The command prints an address and opens it. The address holds a token that is new at every start; no other machine reaches the page. Lens files of
/// other programs (.zmx, .seq, .json) can be named, and dropped onto the page. Nothing is written until "Save as" or an optimisation writes it into
/// the folder.
///
/// Examples:
///   petzval studio design.zmx          the lens of a file
///   petzval studio runs/triplet        the lenses of a run
///   petzval studio                     a built-in triplet
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Lenses to open, by built-in name or file, or folders of runs
    #[arg(value_name = "LENS|RUN")]
    open: Vec<String>,
    /// Port of the address; 0 takes any that is free [default: 8710, or any that is free]
    #[arg(long, value_name = "PORT")]
    port: Option<u16>,
    /// Folder in which the studio reads and writes
    #[arg(long, value_name = "FOLDER", default_value = FOLDER)]
    folder: PathBuf,
    /// Print the address, and do not open it in a browser
    #[arg(long)]
    no_open: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let Args { open, port, folder, no_open } = args;
    let stop = signals::stop_quietly()?;
    let settings = Settings { port, folder, open, context: terminal.context() };
    let studio = Studio::start(settings).map_err(failure)?;
    outln!("{}", studio.url());
    noteln!("this address holds the token of this start; Ctrl-C ends the studio");
    if !no_open && !output::is_lost() {
        // A machine without a browser has none to open; the address is printed all the same.
        let _no_browser = studio.open_in_browser();
    }
    studio.wait(&stop);
    Ok(Code::SUCCESS)
}

fn failure(error: StudioError) -> Failure {
    match error {
        StudioError::Job(error) => error.into(),
        StudioError::Port { port, .. } => {
            let hint = if port == 0 {
                "no port is free"
            } else {
                "choose another with --port; 0 takes any that is free"
            };
            Failure::input(error.to_string(), hint)
        }
        StudioError::Folder { .. } => Failure::input(error.to_string(), "name a folder with --folder"),
        StudioError::System(_) => Failure::job(error.to_string()),
    }
}
