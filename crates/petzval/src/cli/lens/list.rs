//! `petzval lens list`: the built-in lenses.

use crate::jobs::lens::list;

use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::number::figure;
use crate::cli::terminal::{Terminal, print_response};

/// List the built-in lenses: focal length, f-number, largest field, and where the numbers come from.
///
/// Every verb that takes a lens takes these names as well as files.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let lenses = list::run(&list::Request {}, &terminal.context())?.lenses;
    print_response(args.json, &lenses, || {
        let names = lenses.iter().map(|l| l.name.len()).fold("lens".len(), usize::max);
        outln!("{:<names$} surfaces   EFL mm      f/  field deg  source", "lens");
        for l in &lenses {
            outln!(
                "{:<names$} {:>8} {:>8} {:>7} {:>10.1}  {}",
                l.name,
                l.surfaces,
                figure(l.efl_mm, 2),
                figure(l.f_number, 2),
                l.field_deg,
                l.source
            );
        }
    })
}
