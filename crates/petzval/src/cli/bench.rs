//! `petzval bench`: measures the speed of standard workloads.

mod camera;
mod joint;
mod optics;
mod tolerance;
mod workload;

use std::process::ExitCode;
use std::time::Instant;

use cpu_time::ProcessTime;
use petzval::base::statistics::median;
use serde_json::{Value, json};

use self::workload::Workload;
use super::failure::Failure;
use super::terminal::print_json;

/// Measure standard workloads; times are medians.
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
    #[arg(long, default_value_t = 2.0, value_name = "S")]
    seconds: f64,
}

fn workloads() -> Vec<Workload> {
    let mut all = optics::workloads();
    all.extend(tolerance::workloads());
    all.extend(camera::workloads());
    all.extend(joint::workloads());
    all
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let all = workloads();
    if args.list {
        all.iter().for_each(|w| println!("{}", w.name));
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(unknown) = args.only.iter().find(|name| all.iter().all(|w| w.name != **name)) {
        let known: Vec<&str> = all.iter().map(|w| w.name).collect();
        return Err(Failure::input(format!("--only {unknown}: no such workload"), known.join(", ")));
    }
    if !(args.seconds > 0.0 && args.seconds <= 3600.0) {
        return Err(Failure::input("--seconds: not between 0 and 3600", "2 is usual"));
    }
    let mut results = Vec::new();
    for workload in all.iter().filter(|w| args.only.is_empty() || args.only.iter().any(|n| n == w.name)) {
        let result = measure(workload, args.seconds)?;
        if !args.json {
            println!(
                "{:<26} {:>10.4} ms CPU {:>10.4} ms wall   {}",
                workload.name,
                1e3 * result["cpu_s"].as_f64().unwrap_or(f64::NAN),
                1e3 * result["wall_s"].as_f64().unwrap_or(f64::NAN),
                result["work"].as_str().unwrap_or("")
            );
        }
        results.push(result);
    }
    if args.json { print_json(&Value::Array(results)) } else { Ok(ExitCode::SUCCESS) }
}

/// Runs a workload once to warm up, then for the given time, at least three times.
fn measure(workload: &Workload, seconds: f64) -> Result<Value, Failure> {
    let mut prepared = (workload.prepare)()?;
    (prepared.run)()?;
    let (mut cpu, mut wall) = (Vec::new(), Vec::new());
    let began = Instant::now();
    while wall.len() < 3 || began.elapsed().as_secs_f64() < seconds {
        let (start_cpu, start) = (ProcessTime::now(), Instant::now());
        (prepared.run)()?;
        cpu.push(start_cpu.elapsed().as_secs_f64());
        wall.push(start.elapsed().as_secs_f64());
    }
    let (cpu_s, wall_s) = (median(cpu), median(wall));
    let work = match prepared.units {
        Some((units, what)) => {
            format!("{}; {:.1} M {what} per CPU second", prepared.work, 1e-6 * units / cpu_s)
        }
        None => prepared.work,
    };
    let threads = if prepared.single_thread { 1 } else { rayon::current_num_threads() };
    Ok(json!({
        "name": workload.name,
        "cpu_s": cpu_s,
        "wall_s": wall_s,
        "threads": threads,
        "simd": (workload.simd)(),
        "work": work,
    }))
}
