//! `petzval glass list`: every glass.

use std::process::ExitCode;
use std::sync::Arc;

use petzval::built_in_assets;
use petzval::optics::glass::Glass;
use serde_json::json;

use super::{figure, is_made_by, status};
use crate::cli::{Failure, print_json};

/// List glasses, those that a name alone does not mean as MAKER:NAME.
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
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let catalog = built_in_assets().catalog()?;
    let listed: Vec<&Arc<Glass>> =
        catalog.glasses().filter(|glass| is_made_by(glass, args.maker.as_deref())).collect();
    if listed.is_empty() {
        return Err(Failure::input("there is no such glass", "leave --maker out to see all makers"));
    }
    // How a lens file has to call a glass.
    let called = |glass: &Glass| match catalog.get(&glass.name) {
        Ok(counts) if *counts != *glass => format!("{}:{}", glass.maker.to_uppercase(), glass.name),
        _ => glass.name.clone(),
    };
    if args.json {
        let list = listed.iter().map(|glass| {
            json!({
                "name": called(glass),
                "maker": glass.maker,
                "status": glass.status.map(|s| s.word()),
                "nd": glass.nd(),
                "vd": glass.abbe_vd(),
                "printed_nd": glass.printed_nd.map(|p| p.value),
                "printed_vd": glass.printed_vd.map(|p| p.value),
                "agrees_with_print": agrees(glass),
                "range_um": glass.range_um,
            })
        });
        return print_json(&list.collect::<Vec<_>>());
    }
    println!("glass                  maker            nd       Vd  status");
    for glass in &listed {
        let (nd, vd) = (glass.nd(), figure(glass.abbe_vd(), 2));
        let line = format!("{:<22} {:<12} {nd:>8.5} {vd:>8}  {}", called(glass), glass.maker, status(glass));
        println!("{}", line.trim_end());
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether the formula gives what is printed, to the last printed digit; `None` where nothing is printed.
fn agrees(glass: &Glass) -> Option<bool> {
    let nd = glass.printed_nd.map(|printed| printed.agrees(glass.nd()));
    let vd = glass.printed_vd.map(|printed| printed.agrees(glass.abbe_vd()));
    match (nd, vd) {
        (None, None) => None,
        (nd, vd) => Some(nd != Some(false) && vd != Some(false)),
    }
}
