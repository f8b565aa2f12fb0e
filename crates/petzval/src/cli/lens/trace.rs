//! `petzval lens trace`: one ray through every surface.

use crate::jobs::lens::trace;

use crate::cli::choice::choice;
use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::terminal::{Terminal, print_response};

/// Trace one ray and print its position and direction at every surface.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    lens: String,
    /// Field angle, degrees
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    field: f64,
    /// Wavelength, um
    #[arg(long, value_name = "UM")]
    wavelength: f64,
    /// Point of the pupil, in units of its radius
    #[arg(long, value_name = "PX,PY", value_delimiter = ',', required = true, allow_hyphen_values = true)]
    pupil: Vec<f64>,
    /// Surface of the pupil point
    #[arg(long, value_parser = choice::<trace::Aim>(), default_value = word(trace::Request::default().aim))]
    aim: trace::Aim,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = trace::Request {
        lens: args.lens.into(),
        field: args.field,
        wavelength: args.wavelength,
        pupil: args.pupil,
        aim: args.aim,
    };
    let response = trace::run(&request, &terminal.context())?;
    print_response(args.json, &response, || {
        outln!("status: {}", response.status);
        outln!("{:>8} {:>14} {:>14} {:>14} {:>12} {:>12} {:>12}", "", "x mm", "y mm", "z mm", "l", "m", "n");
        for (i, place) in response.surfaces.iter().enumerate() {
            outln!("{}", row(&(i + 1).to_string(), place));
        }
        if let Some(image) = &response.image {
            outln!("{}", row("image", image));
        }
        if let Some(opl_mm) = response.opl_mm {
            outln!("optical path: {opl_mm:.9} mm");
        }
    })
}

fn row(name: &str, at: &trace::Place) -> String {
    format!(
        "{name:>8} {:>14.9} {:>14.9} {:>14.9} {:>12.9} {:>12.9} {:>12.9}",
        at.x_mm, at.y_mm, at.z_mm, at.l, at.m, at.n
    )
}
