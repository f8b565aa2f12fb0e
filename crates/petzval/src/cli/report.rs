//! `petzval report`: write the report of a run again, or show it while the run is at work.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::report;

use super::failure::Failure;
use super::plain::shown;
use super::served_page::{self, PORT};
use super::terminal::Terminal;

/// Write report.html of a finished run again, from the contents of its folder.
///
/// With --photo the report also shows a photograph over the whole sensor, as every camera takes it; the frames stay in the folder
/// pictures of the run, and later reports show them too.
///
/// With --watch nothing is written: a browser on this machine shows the run while it is at work. The page has the finished cameras, the
/// lens of the camera at work, and the losses so far. The page renews itself.
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
    /// Show the page of a run at work at an address of this machine, until Ctrl-C; the run itself goes on
    #[arg(long, conflicts_with = "photo")]
    watch: bool,
    /// Port of that address; 0 takes any that is free
    #[arg(long, value_name = "PORT", requires = "watch", default_value_t = PORT)]
    port: u16,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let context = terminal.context();
    if args.watch {
        let watched = report::Watched::open(&args.run, &context)?;
        return served_page::serve(args.port, || watched.page());
    }
    let request = report::Request { run: args.run, photo: args.photo, accept_changed: args.accept_changed };
    let response = report::run(&request, &context)?;
    outln!("{}", shown(&response.report));
    Ok(Code::SUCCESS)
}
