//! `petzval isp show`: prints the parameters of an ISP.

use crate::jobs::isp::show;

use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::terminal::{Terminal, print_json};

/// Show the parameters of an ISP: value, unit, range and meaning of each.
///
/// A star marks values that differ from the default.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Preset, or a file of settings or of the description of an external ISP
    #[arg(value_name = "PRESET|FILE", default_value = word(show::Request::default().isp))]
    isp: String,
    /// Gain of the sensor above its lowest, at which to show the values of a preset, EV
    #[arg(long, value_name = "EV", default_value_t = show::Request::default().gain_ev)]
    gain_ev: f64,
    /// Print a settings file with every parameter, to start your own from
    #[arg(long, conflicts_with = "json")]
    raw: bool,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let shown = show::run(&show::Request { isp: args.isp, gain_ev: args.gain_ev }, &terminal.context())?;
    if args.json {
        return print_json(&shown);
    }
    if args.raw {
        out!("{}", shown.settings);
        return Ok(Code::SUCCESS);
    }
    outln!("{}: {} parameters\n", shown.name, shown.parameters.len());
    let width = shown.parameters.iter().map(|p| p.name.len()).max().unwrap_or(0).max(9);
    outln!("  {:<width$}  {:>12}  {:<8} {:<22}", "parameter", "value", "unit", "range");
    for p in &shown.parameters {
        let star = if p.value == p.default { ' ' } else { '*' };
        let range = format!("{} .. {}", p.min, p.max);
        outln!("{star} {:<width$}  {:>12}  {:<8} {range:<22} {}", p.name, p.value, p.unit, p.sentence);
    }
    Ok(Code::SUCCESS)
}
