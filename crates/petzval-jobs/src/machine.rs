//! What the machine and the build offer; a run keeps it beside its results.

use petzval_base::simd::{level, widest};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;

/// Machine, build and command of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Environment {
    /// CPU architecture.
    pub architecture: String,
    /// Command line, or what else called the job; may be empty.
    pub command: String,
    /// Cores that the system offers.
    pub cores: usize,
    /// Operating system.
    pub os: String,
    /// Widest vector unit that the CPU reports.
    pub simd: String,
    /// Vector unit that the kernels use.
    pub simd_used: String,
    /// Threads in use.
    pub threads: usize,
    /// Version of Petzval.
    pub version: String,
}

/// The environment of the jobs of a context.
pub fn environment(context: &Context) -> Environment {
    Environment {
        architecture: std::env::consts::ARCH.to_owned(),
        command: context.command().to_owned(),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        os: std::env::consts::OS.to_owned(),
        simd: widest().to_owned(),
        simd_used: level().to_owned(),
        threads: rayon::current_num_threads(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
    }
}

/// Whether whoever started this process made it ignore a signal. Only Linux says so.
pub fn ignores_signal(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
