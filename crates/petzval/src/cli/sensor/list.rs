//! `petzval sensor list`: the built-in sensors.

use crate::jobs::sensor::list;

use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::number::six_digits;
use crate::cli::terminal::{Terminal, print_response};

/// List the built-in sensors: pixels, pitch, full well, read noise, and where the numbers come from.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let sensors = list::run(&list::Request {}, &terminal.context())?.sensors;
    print_response(args.json, &sensors, || {
        let names = sensors.iter().map(|s| s.name.len()).fold("sensor".len(), usize::max);
        outln!("{:<names$}      pixels  pitch um  filter full well e- read noise e-  source", "sensor");
        for s in &sensors {
            let pixels = format!("{} x {}", s.width, s.height);
            // `sensor show` prints the whole of it.
            let source = s.source.split_once(": ").map_or(&s.source[..], |(place, _)| place);
            outln!(
                "{:<names$} {pixels:>11} {:>9} {:>7} {:>12} {:>13}  {source}",
                s.name,
                six_digits(s.pixel_um),
                s.cfa.to_string(),
                six_digits(s.full_well_e),
                six_digits(s.read_noise_e),
            );
        }
    })
}
