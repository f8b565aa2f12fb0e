//! The `petzval` command.

use std::process::ExitCode;

/// This allocator reuses memory: the program allocates and frees arrays of a hundred kilobytes by the thousand, and the
/// system's allocator returns each to the kernel.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    #[cfg(unix)]
    kept_memory::keep();
    ExitCode::from(petzval::cli::main(std::env::args_os()).number())
}

#[cfg(unix)]
mod kept_memory {
    use std::os::unix::process::CommandExt;
    use std::path::Path;
    use std::process::Command;

    /// How long the allocator waits before it returns free memory to the kernel, ms. It waits a second where this is not set.
    const DELAY: &str = "MIMALLOC_PURGE_DELAY";

    /// Verbs that train.
    const TRAINING: [&str; 5] = ["design", "evaluate", "train", "unit", "bench"];

    /// Has the allocator keep free memory where the program trains. A step takes the memory of the one before, and the kernel clears every
    /// page that it gives again. That is 4 % of the CPU time of a step of the main job, and a quarter of one that makes streets anew.
    ///
    /// The allocator reads the variable when a process begins, so this process begins once more, under the same number.
    pub fn keep() {
        let mut words = std::env::args_os();
        let name = words.next().unwrap_or_default();
        let words: Vec<_> = words.collect();
        // Options stand before the verb or behind it; their values may look like verbs, and then it begins once more for nothing.
        let trains = words.iter().take(3).any(|word| TRAINING.iter().any(|verb| word == verb));
        if !trains || std::env::var_os(DELAY).is_some() {
            return;
        }
        let Ok(program) = std::env::current_exe() else { return };
        // A loader that was given the program would be started in its place.
        if program.file_name() != Path::new(&name).file_name() {
            return;
        }
        // If that fails, the program goes on as it is, only slower.
        let _slower = Command::new(program).arg0(name).args(words).env(DELAY, "-1").exec();
    }
}
