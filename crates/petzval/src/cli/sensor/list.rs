//! `petzval sensor list`: the built-in sensors.

use std::process::ExitCode;

use petzval::built_in_assets;
use petzval::camera::sensor::SensorModel;
use serde_json::json;

use super::six_digits;
use crate::cli::{Failure, print_json};

/// List the built-in sensors: pixels, pitch, full well, read noise, and where the numbers come from.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let assets = built_in_assets();
    let all: Vec<(&str, SensorModel)> = assets
        .names("sensors")
        .into_iter()
        .map(|name| Ok((name, assets.sensor(name)?)))
        .collect::<Result<_, Failure>>()?;
    if args.json {
        let row = |(name, s): &(&str, SensorModel)| {
            json!({
                "name": name,
                "sensor": s.name,
                "width": s.width,
                "height": s.height,
                "pixel_um": s.pixel_um,
                "bits": s.bits,
                "cfa": s.cfa,
                "full_well_e": s.full_well_e,
                "read_noise_e": s.read_noise_e,
                "source": s.source,
            })
        };
        return print_json(&all.iter().map(row).collect::<Vec<_>>());
    }
    let names = all.iter().map(|(name, _)| name.len()).fold("sensor".len(), usize::max);
    println!(
        "{:<names$} {:>11} {:>9} {:>7} {:>12} {:>13}  source",
        "sensor", "pixels", "pitch um", "filter", "full well e-", "read noise e-"
    );
    for (name, s) in &all {
        let pixels = format!("{} x {}", s.width, s.height);
        // What follows the place is told by `sensor show`.
        let source = s.source.split_once(": ").map_or(&s.source[..], |(place, _)| place);
        println!(
            "{name:<names$} {pixels:>11} {:>9} {:>7} {:>12} {:>13}  {source}",
            six_digits(s.pixel_um),
            s.cfa.to_string(),
            six_digits(s.full_well_e),
            six_digits(s.read_noise_e),
        );
    }
    Ok(ExitCode::SUCCESS)
}
