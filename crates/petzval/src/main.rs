//! The `petzval` command.

// `out!`, `outln!` and `noteln!` of `cli::output` are the only ways to write: the standard macros panic where nobody can read.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod cli;

use std::process::ExitCode;

use clap::Parser;

/// This allocator reuses memory: the program allocates and frees arrays of a hundred kilobytes by the thousand, and the
/// system's allocator returns each to the kernel.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    match cli::Cli::try_parse() {
        Ok(cli) => cli::ending::finish(cli::run(cli)),
        Err(said) => cli::ending::usage(&said),
    }
}
