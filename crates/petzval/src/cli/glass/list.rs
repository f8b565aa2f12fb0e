//! `petzval glass list`: lists every glass.

use crate::jobs::glass::list;

use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::number::figure;
use crate::cli::terminal::{Terminal, print_response};

/// List glasses by their names in lens files: MAKER:NAME if the name alone means another glass.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Only glasses of this maker
    #[arg(long)]
    maker: Option<String>,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let response = list::run(&list::Request { maker: args.maker }, &terminal.context())?;
    print_response(args.json, &response.glasses, || {
        outln!("glass                  maker            nd       Vd  status");
        for glass in &response.glasses {
            let (nd, vd) = (figure(glass.nd, 5), figure(glass.vd, 2));
            let status = glass.status.as_deref().unwrap_or_default();
            let line = format!("{:<22} {:<12} {nd:>8} {vd:>8}  {status}", glass.name, glass.maker);
            outln!("{}", line.trim_end());
        }
    })
}
