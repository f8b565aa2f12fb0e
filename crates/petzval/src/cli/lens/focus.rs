//! `petzval lens focus`, and the option `--focus`: the position of the image plane of a lens.

use std::path::PathBuf;

use crate::jobs::lens::{FocusAt, focus};

use crate::cli::choice::choice;
use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::terminal::{Terminal, print_response};

/// Move the image plane of a lens to its best focus, and write the lens to another file.
///
/// The best focus is where the mean squared spot over the fields and wavelengths of the file is least. Without OUT the figures are printed and nothing is
/// written.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    lens: String,
    /// The file to write, whose ending names the format: .toml, .zmx or .seq
    #[arg(value_name = "OUT")]
    to: Option<PathBuf>,
    /// Position of the image plane
    #[arg(long, value_parser = choice::<FocusAt>(), default_value = word(focus::Request::default().focus))]
    at: FocusAt,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = focus::Request { lens: args.lens.into(), focus: args.at, to: args.to };
    let response = focus::run(&request, &terminal.context())?;
    print_response(args.json, &response, || {
        let spot = |um: Option<f64>| um.map_or_else(|| "no image".to_owned(), |um| format!("{um:.2} um"));
        let (before_mm, now_mm) = (response.image_distance_before_mm, response.image_distance_mm);
        let moved_mm = response.moved_mm;
        // Behind an odd number of mirrors distances from the vertex are negative, and the shift is not their difference.
        let sense = if moved_mm == now_mm - before_mm { "" } else { "; positive away from the lens" };
        outln!("{}", response.name);
        outln!(
            "  image plane  {now_mm:.6} mm from the last vertex, {moved_mm:+.6} mm from where it was{sense}"
        );
        outln!("  RMS spot     {}, before {}", spot(response.rms_spot_um), spot(response.rms_spot_before_um));
        if let Some(now) = response.largest_colour_spot_um {
            let before = spot(response.largest_colour_spot_before_um);
            outln!("               of one wavelength {now:.2} um at most, before {before}");
        }
        if let Some(to) = &response.to {
            for loss in &response.losses_of_writing {
                noteln!("{}: {}", loss.effect.name(), shown(loss.in_file(to)));
            }
            outln!("{}", shown(to));
        }
    })
}
