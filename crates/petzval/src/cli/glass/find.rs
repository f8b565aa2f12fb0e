//! `petzval glass find`: the glasses nearest to an index and an Abbe number.

use std::process::ExitCode;

use petzval::built_in_assets;
use petzval::optics::glass::{Status, nearest};
use serde_json::json;

use super::{figure, is_made_by, status};
use crate::cli::{Failure, print_json};

/// Find glasses. The distance is sqrt((dnd / 0.01)^2 + dVd^2): 0.01 of index counts as much as 1 of Abbe number.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Index at the d line, 587.6 nm
    #[arg(long, allow_negative_numbers = true)]
    nd: f64,
    /// Abbe number (nd - 1) / (nF - nC)
    #[arg(long, allow_negative_numbers = true)]
    vd: f64,
    /// How many to print
    #[arg(long, default_value_t = 10, value_name = "N")]
    count: usize,
    /// Only glasses of this maker
    #[arg(long)]
    maker: Option<String>,
    /// Obsolete glasses as well
    #[arg(long)]
    obsolete: bool,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let checks = [
        ("--nd", args.nd, 1.0..=5.0, "an index is between 1 and 5"),
        ("--vd", args.vd, 1.0..=1e3, "an Abbe number is between 1 and 1000"),
    ];
    for (name, value, allowed, what) in checks {
        if !allowed.contains(&value) {
            return Err(Failure::input(format!("{name} {value}: {what}"), "for example --nd 1.6 --vd 50"));
        }
    }
    let found = nearest(&built_in_assets().catalog()?, [args.nd, args.vd], args.count, |glass| {
        is_made_by(glass, args.maker.as_deref()) && (args.obsolete || glass.status != Some(Status::Obsolete))
    });
    if found.is_empty() && args.count > 0 {
        return Err(Failure::input(
            "there is no such glass",
            "`petzval glass list` shows every glass with its maker",
        ));
    }
    if args.json {
        let list = found.iter().map(|near| {
            let glass = &near.glass;
            json!({
                "name": glass.name,
                "maker": glass.maker,
                "status": glass.status.map(|s| s.word()),
                "nd": glass.nd(),
                "vd": glass.abbe_vd(),
                "p_gf": glass.partial_dispersion_gf(),
                "relative_cost": glass.relative_cost,
                "distance": near.distance,
            })
        });
        return print_json(&list.collect::<Vec<_>>());
    }
    println!("glass             maker       nd       Vd       PgF      distance  status");
    for near in &found {
        let glass = &near.glass;
        let line = format!(
            "{:<17} {:<10} {:>8.5} {:>7}  {:>8}  {:>8.3}  {}",
            glass.name,
            glass.maker,
            glass.nd(),
            figure(glass.abbe_vd(), 2),
            figure(glass.partial_dispersion_gf(), 4),
            near.distance,
            status(glass)
        );
        println!("{}", line.trim_end());
    }
    Ok(ExitCode::SUCCESS)
}
