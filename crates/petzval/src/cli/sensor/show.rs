//! `petzval sensor show`: what a sensor is, in numbers.

use std::process::ExitCode;

use petzval::built_in_assets;
use petzval::camera::emva::{Derived, derived};
use serde_json::json;

use crate::cli::{Failure, print_json};

/// Show a sensor: a file, or the name of a built-in one.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Sensor file, or a built-in name such as imx249-fitted
    sensor: String,
    /// Linear gains to show; those of the file, or 1, if it is left out
    #[arg(long, value_name = "G,G,...", value_delimiter = ',')]
    gains: Vec<f64>,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let sensor = built_in_assets().sensor(&args.sensor)?;
    if let Some(wrong) = args.gains.iter().find(|g| !(**g > 0.0 && **g <= 1e4)) {
        return Err(Failure::input(format!("--gains {wrong}: not between 0 and 10000"), "positive numbers"));
    }
    let gains = match (&args.gains[..], &sensor.gain_steps[..]) {
        ([], []) => vec![1.0],
        ([], steps) => steps.to_vec(),
        (chosen, _) => chosen.to_vec(),
    };
    let found: Vec<Derived> = gains.iter().map(|g| derived(&sensor, *g)).collect();
    if args.json {
        return print_json(&json!({ "sensor": sensor, "derived": found }));
    }
    let s = &sensor;
    println!("{}\n{}\n", s.name, s.source);
    println!("{} x {} pixels of {} um, {} bits, {}", s.width, s.height, s.pixel_um, s.bits, s.cfa);
    let [red, green, blue] = s.relative_qe;
    for (name, value, unit) in [
        ("system gain K", s.gain_dn_per_e, "DN/e-"),
        ("black level", s.black_level_dn, "DN"),
        ("full well", s.full_well_e, "e-"),
        ("dark current mu_I", s.dark_current_e_per_s, "e-/s"),
        ("read noise sigma_r", s.read_noise_e, "e-"),
        ("read noise mean mu_r", s.read_noise_mean_e, "e-"),
        ("electronics noise sigma_el", s.electronics_noise_dn, "DN"),
        ("electronics mean mu_el", s.electronics_mean_dn, "DN"),
        ("red over green", red / green, ""),
        ("blue over green", blue / green, ""),
    ] {
        println!("{name:<28}{value:>12} {unit}");
    }
    println!(
        "\n{:>8} {:>9} {:>11} {:>11} {:>11} {:>10} {:>9} {:>10} {:>8}",
        "gain", "K g", "dark noise", "dark noise", "threshold", "saturation", "SNR max", "dynamic", "range"
    );
    println!(
        "{:>8} {:>9} {:>11} {:>11} {:>11} {:>10} {:>9} {:>10} {:>8}",
        "", "DN/e-", "DN", "e-", "e-", "e-", "dB", "", "dB"
    );
    for d in &found {
        println!(
            "{:>8} {:>9.5} {:>11.4} {:>11.3} {:>11.3} {:>10.0} {:>9.2} {:>10.1} {:>8.2}{}",
            d.linear_gain,
            d.gain_dn_per_e,
            d.dark_noise_dn,
            d.dark_noise_e,
            d.threshold_e,
            d.saturation_e,
            d.snr_max_db,
            d.dynamic_range,
            d.dynamic_range_db,
            if d.converter_limits { "  converter" } else { "  full well" }
        );
    }
    Ok(ExitCode::SUCCESS)
}
