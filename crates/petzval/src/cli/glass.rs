//! `petzval glass`: look glasses up, or find those with a given index and dispersion.

mod find;
mod list;
mod show;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Subcommand;
use petzval::jobs::glass::read_glasses;

use super::Failure;

/// Verbs about glass.
#[derive(Debug, Subcommand)]
pub enum GlassVerb {
    /// The glasses nearest to an index and an Abbe number
    Find(find::Args),
    /// All that is known of a glass
    Show(show::Args),
    /// Every glass, with its maker, index and Abbe number
    List(list::Args),
}

/// Runs a verb.
pub fn run(verb: GlassVerb) -> Result<ExitCode, Failure> {
    match verb {
        GlassVerb::Find(args) => find::run(args),
        GlassVerb::Show(args) => show::run(args),
        GlassVerb::List(args) => list::run(args),
    }
}

/// Reads the catalogues of PETZVAL_GLASSES and of the command line, for every lens that is read from now on. Prints a warning
/// for each line that was not understood: all of them where the command is about glass, else the first few.
pub fn choose(named: &[PathBuf], in_full: bool) -> Result<(), Failure> {
    const FEW: usize = 2;
    let listed = std::env::var_os("PETZVAL_GLASSES").unwrap_or_default();
    let listed = std::env::split_paths(&listed).filter(|path| *path != Path::new(""));
    let paths: Vec<PathBuf> = listed.chain(named.iter().cloned()).collect();
    if paths.is_empty() {
        return Ok(());
    }
    let chosen = read_glasses(&paths)?;
    let shown = if in_full { chosen.warnings.len() } else { FEW.min(chosen.warnings.len()) };
    for (path, warning) in &chosen.warnings[..shown] {
        eprintln!("warning: {}: {warning}", path.display());
    }
    if shown < chosen.warnings.len() {
        let more = chosen.warnings.len() - shown;
        eprintln!("warning: {more} more lines of glass catalogues; `petzval glass list` shows all");
    }
    petzval::choose_glasses(chosen.catalog);
    Ok(())
}

/// A figure with so many decimals; a dash for one that the glass does not have, such as the Abbe number of air.
fn figure(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
}
