//! `petzval unit list`.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::units::jobs::unit_list::{self, Request};
use crate::units::unit::read_units;

use super::super::failure::Failure;
use super::super::plain;
use super::super::terminal::{Terminal, print_response};
use super::run::context;

/// List the units of a file with their keys. Every unit is checked as before its run.
///
/// Only whether this machine has the instruction set of a unit is not looked at: another one may run it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// File of units, one in each line as JSON
    file: PathBuf,
    /// Machine-readable output: whole keys, and the digests of all inputs
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let file = read_units(&args.file)?;
    let context = context(&args.file, terminal)?;
    let units = unit_list::run(&Request { units: file.units }, &context);
    drop(context);
    let units = units?;
    print_response(args.json, &units, || {
        for unit in &units {
            outln!("{}  {:<20} {}", unit.key.short(), unit.job, plain::message(&unit.name));
        }
    })
}
