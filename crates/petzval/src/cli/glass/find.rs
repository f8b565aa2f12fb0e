//! `petzval glass find`: the glasses nearest to an index and an Abbe number.

use crate::jobs::glass::find;

use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::number::figure;
use crate::cli::terminal::{Terminal, print_response};

/// Find glasses. The distance is sqrt((dnd / 0.01)^2 + dVd^2): 0.01 of index counts as much as 1 of Abbe number.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Index at the d line, 587.6 nm
    #[arg(long, allow_negative_numbers = true)]
    nd: f64,
    /// Abbe number (nd - 1) / (nF - nC)
    #[arg(long, allow_negative_numbers = true)]
    vd: f64,
    /// Number of glasses to print
    #[arg(long, default_value_t = find::Request::default().count, value_name = "N")]
    count: usize,
    /// Only glasses of this maker
    #[arg(long)]
    maker: Option<String>,
    /// Include obsolete glasses
    #[arg(long)]
    obsolete: bool,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = find::Request {
        nd: args.nd,
        vd: args.vd,
        count: args.count,
        maker: args.maker,
        obsolete: args.obsolete,
    };
    let response = find::run(&request, &terminal.context())?;
    print_response(args.json, &response.glasses, || {
        outln!("glass             maker       nd       Vd       PgF      distance  status");
        for glass in &response.glasses {
            let line = format!(
                "{:<17} {:<10} {:>8} {:>7}  {:>8}  {:>8.3}  {}",
                glass.name,
                glass.maker,
                figure(glass.nd, 5),
                figure(glass.vd, 2),
                figure(glass.p_gf, 4),
                glass.distance,
                glass.status.as_deref().unwrap_or_default()
            );
            outln!("{}", line.trim_end());
        }
    })
}
