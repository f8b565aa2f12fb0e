//! `petzval doctor`: shows what this machine and this build offer.

use crate::cli::code::Code;
use crate::jobs::threads::Source;
use crate::jobs::{compiled_in_devices, doctor};

use super::failure::Failure;
use super::terminal::{Terminal, print_json};

/// Show what this machine and this build offer, and read every built-in file.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, threads_from: Source, terminal: &Terminal) -> Result<Code, Failure> {
    let found = doctor::run(&doctor::Request {}, &terminal.context())?;
    if args.json {
        return print_json(&found);
    }
    let machine = &found.environment;
    outln!("petzval      {}", machine.version);
    outln!("system       {} {}", machine.os, machine.architecture);
    // An environment variable or an old CPU may limit the kernels to a narrower unit than the CPU reports.
    let narrowed = if machine.simd_used == machine.simd {
        String::new()
    } else {
        format!("; {} used", machine.simd_used)
    };
    outln!("SIMD         {}{narrowed}", machine.simd);
    outln!("threads      {} of {} cores, by {threads_from}", machine.threads, machine.cores);
    for (name, what) in compiled_in_devices() {
        outln!("device       {name}: {what}");
    }
    outln!("lenses       {}", found.lenses.join(", "));
    outln!("sensors      {}", found.sensors.join(", "));
    outln!("experiments  {}", found.experiments.join(", "));
    outln!("built-in files: all readable");
    Ok(Code::SUCCESS)
}
