//! `petzval glass`: shows glasses, or finds those with a given index and dispersion.

mod find;
mod list;
mod show;

use std::path::{Path, PathBuf};

use crate::cli::code::Code;
use crate::jobs::glass::library_with;
use crate::jobs::{Library, built_in_assets};
use clap::Subcommand;

use super::failure::Failure;
use super::plain::shown;
use super::terminal::Terminal;

/// Verbs about glass.
#[derive(Debug, Subcommand)]
pub enum GlassVerb {
    #[command(about = "Find the glasses nearest to an index and an Abbe number")]
    Find(find::Args),
    #[command(about = "Show all data of a glass")]
    Show(show::Args),
    #[command(about = "List every glass, with its maker, index and Abbe number")]
    List(list::Args),
}

/// Runs a verb.
pub fn run(verb: GlassVerb, terminal: &Terminal) -> Result<Code, Failure> {
    match verb {
        GlassVerb::Find(args) => find::run(args, terminal),
        GlassVerb::Show(args) => show::run(args, terminal),
        GlassVerb::List(args) => list::run(args, terminal),
    }
}

/// Whether PETZVAL_GLASSES lists catalogues.
pub fn are_in_environment() -> bool {
    std::env::var_os("PETZVAL_GLASSES").is_some_and(|listed| !listed.is_empty())
}

/// Reads the catalogues of PETZVAL_GLASSES and of the command line, and returns the built-in library with these
/// glasses. Prints a warning for each line that was not understood: all of them if the command is about glass, else one of
/// each kind.
pub fn chosen(named: &[PathBuf], in_full: bool) -> Result<Library, Failure> {
    let listed = std::env::var_os("PETZVAL_GLASSES").unwrap_or_default();
    let listed = std::env::split_paths(&listed).filter(|path| *path != Path::new(""));
    let paths: Vec<PathBuf> = listed.chain(named.iter().cloned()).collect();
    let warn = |line: String| noteln!("warning: {}", shown(line));
    Ok(library_with(built_in_assets(), &paths, in_full, &warn)?)
}
