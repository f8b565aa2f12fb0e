//! `petzval compare`: several runs on one page.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::compare::{self, Request};

use super::defaults::word;
use super::failure::Failure;
use super::plain::shown;
use super::terminal::{Terminal, print_response};

/// Put finished runs on one page. It has tables with means over seeds, the share of the gap to perfect optics that is closed, and the
/// figures of the paper. Lenses, curves and the same pictures by every camera follow.
///
/// Runs that differ in their seeds alone are taken together: every score has a mean and a standard deviation over the seeds, and so have the
/// differences between cameras of the same seed. Where runs differ in more, a table has a column for every key, input or version that differs.
/// The tables are printed in Markdown. Ranges of scores that come from drawing windows anew are in
/// the report of each run.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folders of finished runs
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// The page
    #[arg(long, value_name = "FILE", default_value = word(Request::default().out))]
    out: PathBuf,
    /// Write means and deviations of the cameras as comma-separated values, too
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Believe this file or folder of the runs though it does not agree with its digest; may be repeated
    #[arg(long, value_name = "NAME")]
    accept_changed: Vec<String>,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request =
        Request { runs: args.runs, out: args.out, csv: args.csv, accept_changed: args.accept_changed };
    let response = compare::run(&request, &terminal.context())?;
    print_response(args.json, &response.comparisons, || {
        outln!("{}", response.markdown);
        outln!("page: {}", shown(&response.page));
        request.csv.iter().for_each(|path| outln!("figures: {}", shown(path)));
    })
}
