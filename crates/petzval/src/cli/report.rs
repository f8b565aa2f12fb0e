//! `petzval report`: write the report of a run again, or watch the run in the studio.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::report;

use super::failure::Failure;
use super::plain::shown;
use super::studio::{self, Serve};
use super::terminal::{Terminal, print_response};

/// Write report.html of a finished run again, from the contents of its folder.
///
/// With --photo the report also shows a photograph over the whole sensor, as every camera takes it; the frames stay in the folder
/// pictures of the run, and later reports show them too.
///
/// With --watch nothing is written: the studio opens on the run (see `petzval studio`) and shows losses, lenses and finished cameras while it is at
/// work.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,
    /// Photograph that every camera takes over its whole sensor
    #[arg(long, value_name = "FILE")]
    photo: Option<PathBuf>,
    /// Believe this file or folder of the run though it does not agree with its digest; may be repeated
    #[arg(long, value_name = "NAME", conflicts_with = "watch")]
    accept_changed: Vec<String>,
    /// Print the path of the page as JSON
    #[arg(long, conflicts_with = "watch")]
    json: bool,
    /// Open the studio on the run, until Ctrl-C; the run itself goes on
    #[arg(long, conflicts_with = "photo")]
    watch: bool,
    /// Port of its address; 0 takes any that is free [default: 8710, or any that is free]
    #[arg(long, value_name = "PORT", requires = "watch")]
    port: Option<u16>,
    /// Print the address, and do not open it in a browser
    #[arg(long, requires = "watch")]
    no_open: bool,
}

/// What every run has.
const CONFIG: &str = "config.toml";

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let context = terminal.context();
    if args.watch {
        if !args.run.join(CONFIG).is_file() {
            let message = format!("{}: this is not the folder of a run", shown(&args.run));
            return Err(Failure::input(message, "`petzval runs` lists the runs in a folder"));
        }
        let (open, folder) = (vec![args.run.display().to_string()], None);
        return studio::serve(Serve { open, folder, port: args.port, no_open: args.no_open }, context);
    }
    let request = report::Request { run: args.run, photo: args.photo, accept_changed: args.accept_changed };
    let response = report::run(&request, &context)?;
    print_response(args.json, &response, || outln!("{}", shown(&response.report)))
}
