//! The `petzval` command.

mod cli;

use std::process::ExitCode;

use clap::Parser;

/// Arrays of a hundred kilobytes come and go by the thousand here; the system's allocator hands each back to the kernel.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    match cli::run(cli::Cli::parse()) {
        Ok(code) => code,
        Err(failure) => failure.report(),
    }
}
