//! `petzval bench`: measures the speed of standard workloads.

use crate::cli::code::Code;
use crate::jobs::bench;

use super::failure::Failure;
use super::terminal::{Terminal, print_json};

/// Measure standard workloads; times are medians. `--threads 1,2,4` prints how they scale: pools of as many threads take turns in one process
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine-readable output
    #[arg(long)]
    json: bool,
    /// Run one workload (may be given more than once)
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// List the workloads
    #[arg(long)]
    list: bool,
    /// Seconds to spend on each workload
    #[arg(long, default_value_t = bench::Request::default().seconds, value_name = "S")]
    seconds: f64,
}

/// Runs the verb.
pub fn run(args: Args, threads: &[usize], terminal: &Terminal) -> Result<Code, Failure> {
    let all = bench::names();
    if args.list {
        all.iter().for_each(|name| outln!("{name}"));
        return Ok(Code::SUCCESS);
    }
    if let Some(unknown) = args.only.iter().find(|name| !all.contains(&name.as_str())) {
        return Err(Failure::input(format!("--only {unknown}: no such workload"), all.join(", ")));
    }
    // A single number is that of the process.
    let threads = if threads.len() > 1 { threads.to_vec() } else { Vec::new() };
    let mut found = Vec::new();
    for name in all.into_iter().filter(|name| args.only.is_empty() || args.only.iter().any(|n| n == name)) {
        let one = bench::run(
            &bench::Request { workload: name.to_owned(), seconds: args.seconds, threads: threads.clone() },
            &terminal.context(),
        )?;
        if !args.json {
            let (cpu_ms, wall_ms) = (1e3 * one.cpu_s, 1e3 * one.wall_s);
            outln!("{name:<26} {cpu_ms:>10.4} ms CPU {wall_ms:>10.4} ms wall   {}", one.work);
            for at in &one.curve {
                let (cpu_ms, wall_ms, count) = (1e3 * at.cpu_s, 1e3 * at.wall_s, at.threads);
                let speedup = at.speedup;
                outln!("{count:>18} threads {cpu_ms:>10.4} ms CPU {wall_ms:>10.4} ms wall {speedup:>8.2} x");
            }
        }
        found.push(one);
    }
    if args.json { print_json(&found) } else { Ok(Code::SUCCESS) }
}
