//! `petzval studio`: the page that shows a camera while one changes it.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::Context;
use crate::studio::{Settings, Studio, StudioError};

use super::failure::Failure;
use super::terminal::Terminal;
use super::{output, signals};

/// Show a camera in the browser while one changes it: lens, photographs through it, its task, designs at work, and all runs of a folder.
///
/// The command prints an address and opens it. The address holds a token that is new at every start; no other machine reaches the page. Lens files of
/// other programs (.zmx, .seq, .json) can be named, and dropped onto the page. Nothing is written until "Save as", an optimisation or a design writes
/// it into the folder. Designs are processes of their own: they go on when the studio ends, and are found again.
///
/// Examples:
///   petzval studio design.zmx          a lens file
///   petzval studio runs/triplet        a run
///   petzval studio experiment.toml     an experiment
///   petzval studio runs                all runs of a folder
///   petzval studio                     a built-in triplet
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Lenses or experiments to open, by built-in name or file; folders of runs or sweeps
    #[arg(value_name = "LENS|EXPERIMENT|RUN")]
    open: Vec<String>,
    /// Port of the address; 0 takes any that is free [default: 8710, or any that is free]
    #[arg(long, value_name = "PORT")]
    port: Option<u16>,
    /// Folder in which the studio reads and writes [default: the current one, or the one that holds the run or experiment]
    #[arg(long, value_name = "FOLDER")]
    folder: Option<PathBuf>,
    /// Print the address, and do not open it in a browser
    #[arg(long)]
    no_open: bool,
}

/// What a studio is started with.
pub struct Serve {
    /// What to open.
    pub open: Vec<String>,
    /// Its folder, if one is named.
    pub folder: Option<PathBuf>,
    /// Its port, if one is named.
    pub port: Option<u16>,
    /// Whether no browser is opened.
    pub no_open: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let Args { open, port, folder, no_open } = args;
    serve(Serve { open, folder, port, no_open }, terminal.context())
}

/// Serves a studio until a signal ends it.
pub fn serve(Serve { open, folder, port, no_open }: Serve, context: Context) -> Result<Code, Failure> {
    let stop = signals::stop_quietly()?;
    let program = std::env::current_exe().ok();
    let studio = Studio::start(Settings { port, folder, open, program, context }).map_err(failure)?;
    outln!("{}", studio.url());
    noteln!("this address holds the token of this start; Ctrl-C ends the studio, and no design");
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
