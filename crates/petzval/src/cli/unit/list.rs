//! `petzval unit list`.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::units::unit::{Digests, Prepared, read_units};
use serde::Serialize;

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

/// A unit, as JSON.
#[derive(Serialize)]
struct Listed<'p> {
    name: &'p str,
    job: &'p str,
    key: &'p str,
    seed: Option<u64>,
    simd: &'p str,
    inputs: &'p [crate::units::unit::InputDigest],
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let file = read_units(&args.file)?;
    let context = context(&args.file, terminal)?;
    let digests = Digests::default();
    let prepared = |unit| Prepared::checked(unit, &context, &digests);
    let all = file.units.iter().map(prepared).collect::<Result<Vec<_>, _>>();
    drop(context);
    let all = all?;
    print_response(args.json, &all.iter().map(listed).collect::<Vec<_>>(), || {
        for Prepared { unit, key, .. } in &all {
            outln!("{}  {:<20} {}", key.short(), unit.call.job, plain::message(&unit.name));
        }
    })
}

fn listed(prepared: &Prepared) -> Listed<'_> {
    let Prepared { unit, key, inputs, .. } = prepared;
    let (name, job, simd) = (unit.name.as_str(), unit.call.job.as_str(), unit.simd.as_str());
    Listed { name, job, key: key.as_str(), seed: unit.seed, simd, inputs }
}
