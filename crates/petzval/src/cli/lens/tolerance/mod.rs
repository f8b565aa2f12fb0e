//! `petzval lens tolerance`: the sensitivity of a lens to manufacturing errors.

mod table;

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use crate::jobs::lens::tolerance::{self, Compensate, Grade, Merit, Part, PsfKind};

use crate::cli::choice::choice;
use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::terminal::{Terminal, print_json};

/// Random lenses: all of a number of them, or those of some numbers.
#[derive(Clone, Copy, Debug)]
struct Lenses {
    all: usize,
    part: Option<Part>,
}

impl Default for Lenses {
    fn default() -> Self {
        let tolerance::Request { trials: all, part, .. } = tolerance::Request::default();
        Self { all, part }
    }
}

impl fmt::Display for Lenses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.part {
            None => write!(f, "{}", self.all),
            Some(Part { from, to }) => write!(f, "{from}..{to}"),
        }
    }
}

impl FromStr for Lenses {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number =
            |text: &str| text.parse().map_err(|_| format!("`{text}` is no number of lenses: give N or A..B"));
        match text.split_once("..") {
            None => Ok(Self { all: number(text)?, part: None }),
            Some((from, to)) => {
                let part = Part { from: number(from)?, to: number(to)? };
                if part.from >= part.to {
                    return Err(format!("`{text}` holds no lens: 0..500 are the first five hundred"));
                }
                Ok(Self { all: part.to, part: Some(part) })
            }
        }
    }
}

/// Compute the sensitivity of a lens to manufacturing errors, and the quality of random lenses with such errors.
///
/// With --out: tolerance.html (summary, distribution, worst offenders), tolerance.json (all figures), sensitivities.csv, trials.csv (every lens with all its errors), tolerances.toml (every
/// tolerance, ready to be edited), yield.svg, sensitivity.svg, and the worst lenses as files.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    lens: String,
    /// Tolerance file
    #[arg(long, value_name = "FILE")]
    tolerances: Option<PathBuf>,
    /// Tolerances of a usual grade for everything that the file does not name (without a file: precision)
    #[arg(long, value_parser = choice::<Grade>())]
    grade: Option<Grade>,
    /// Merit of a lens, over its fields (on both sides of the axis) and wavelengths
    #[arg(long, value_parser = choice::<Merit>(), default_value = word(tolerance::Request::default().merit))]
    merit: Merit,
    /// Spatial frequency of the MTF, cycles per mm
    #[arg(long, default_value_t = tolerance::Request::default().frequency, value_name = "PER_MM")]
    frequency: f64,
    /// Kind of the MTF: rays, accurate where spots are many times the Airy disk, or waves
    #[arg(long, value_parser = choice::<PsfKind>(), default_value = word(tolerance::Request::default().kind))]
    kind: PsfKind,
    /// Number of random lenses; or A..B, to make only those of numbers A to B - 1, as a part that is joined with others later (see `petzval unit
    /// gather`)
    #[arg(long, default_value_t = Lenses::default(), value_name = "N")]
    trials: Lenses,
    /// What is adjusted on every lens
    #[arg(long, value_parser = choice::<Compensate>(), default_value = word(tolerance::Request::default().compensate))]
    compensate: Compensate,
    /// Print how many lenses reach this merit
    #[arg(long, value_name = "MERIT", allow_negative_numbers = true)]
    limit: Option<f64>,
    /// Print the tolerances that together cost this much of the merit as a root sum square: each of N costs this loss over the root of N
    #[arg(long, value_name = "LOSS", allow_negative_numbers = true)]
    inverse: Option<f64>,
    /// Seed of the random lenses
    #[arg(long, default_value_t = tolerance::Request::default().seed, value_name = "N")]
    seed: u64,
    /// Number of the worst lenses to write
    #[arg(long, default_value_t = tolerance::Request::default().worst, value_name = "N")]
    worst: usize,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Show every row of the table, not only those of the greatest effect
    #[arg(long)]
    all: bool,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = tolerance::Request {
        lens: args.lens.into(),
        tolerances: args.tolerances,
        grade: args.grade,
        merit: args.merit,
        frequency: args.frequency,
        kind: args.kind,
        trials: args.trials.all,
        part: args.trials.part,
        compensate: args.compensate,
        limit: args.limit,
        inverse: args.inverse,
        seed: args.seed,
        list_trials: false,
        worst: args.worst,
        out: args.out,
    };
    let response = tolerance::run(&request, &terminal.context())?;
    if args.json {
        // A part is joined by its whole response.
        return if request.part.is_some() { print_json(&response) } else { print_json(&response.report) };
    }
    table::print(&response, args.all);
    if let Some(out) = &request.out {
        noteln!("written to {}", shown(out));
    }
    Ok(Code::SUCCESS)
}
