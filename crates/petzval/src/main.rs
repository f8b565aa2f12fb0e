//! The `petzval` command.

mod cli;

use std::process::ExitCode;

use clap::Parser;

/// This allocator reuses memory: the program allocates and frees arrays of a hundred kilobytes by the thousand, and the
/// system's allocator returns each to the kernel.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    match cli::run(cli::Cli::parse()) {
        Ok(code) => code,
        Err(failure) => failure.report(),
    }
}
