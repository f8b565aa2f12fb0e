//! `petzval doctor`: what this machine and this build offer.

use std::process::ExitCode;

use petzval::base::simd::level;
use petzval::built_in_assets;
use petzval::jobs::machine::simd_level;
use serde_json::json;

use super::{Failure, print_json};

/// Say what this machine and this build offer.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let assets = built_in_assets();
    let devices = petzval::jobs::compiled_in_devices();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let (lenses, sensors) = (assets.names("lenses"), assets.names("sensors"));
    let experiments = assets.names("experiments");
    if args.json {
        return print_json(&json!({
            "version": env!("CARGO_PKG_VERSION"),
            "os": std::env::consts::OS,
            "architecture": std::env::consts::ARCH,
            "simd": simd_level(),
            "simd_used": level(),
            "cores": cores,
            "threads": rayon::current_num_threads(),
            "devices": devices.iter().map(|d| d.0).collect::<Vec<_>>(),
            "lenses": lenses,
            "sensors": sensors,
            "experiments": experiments,
        }));
    }
    println!("petzval      {}", env!("CARGO_PKG_VERSION"));
    println!("system       {} {}", std::env::consts::OS, std::env::consts::ARCH);
    // The kernels of rays and sensor may be narrowed by the environment, or have none for an old machine.
    let narrowed = if level() == simd_level() { String::new() } else { format!("; {} used", level()) };
    println!("SIMD         {}{narrowed}", simd_level());
    println!("threads      {} of {cores} cores", rayon::current_num_threads());
    for (name, what) in devices {
        println!("device       {name}: {what}");
    }
    println!("lenses       {}", lenses.join(", "));
    println!("sensors      {}", sensors.join(", "));
    println!("experiments  {}", experiments.join(", "));
    // Every built-in file must be readable by this build.
    for lens in &lenses {
        assets.import(lens)?;
    }
    for sensor in &sensors {
        assets.sensor(sensor)?;
    }
    for experiment in &experiments {
        assets.experiment(experiment)?;
    }
    println!("built-in files: all readable");
    Ok(ExitCode::SUCCESS)
}
