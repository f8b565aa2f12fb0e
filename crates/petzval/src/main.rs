//! The `petzval` command.

use std::process::ExitCode;

/// This allocator reuses memory: the program allocates and frees arrays of a hundred kilobytes by the thousand, and the
/// system's allocator returns each to the kernel.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    ExitCode::from(petzval::cli::main(std::env::args_os()).number())
}
