//! `petzval lens tolerance`: the sensitivity of a lens to manufacturing errors.

mod table;

use std::path::PathBuf;

use crate::jobs::lens::tolerance::{self, PsfKind};
use clap::ValueEnum;

use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::terminal::{Terminal, print_json};

/// Grade of manufacturing.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum GradeName {
    /// Any shop.
    Commercial,
    /// Good optics.
    Precision,
    /// The best that is available, at a price.
    High,
}

/// Merit of a lens.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MeritName {
    /// RMS spot radius.
    Rms,
    /// Contrast at a spatial frequency.
    Mtf,
}

/// Rays or waves.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// Rays.
    Geometric,
    /// Waves.
    Diffraction,
}

/// What is adjusted on every lens.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Compensate {
    /// The image plane goes where the merit is best.
    Focus,
    /// Nothing but the compensators of the tolerance file.
    None,
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
    #[arg(long, value_enum)]
    grade: Option<GradeName>,
    /// Merit of a lens, over its fields (on both sides of the axis) and wavelengths
    #[arg(long, value_enum, default_value = word(tolerance::Request::default().merit))]
    merit: MeritName,
    /// Spatial frequency of the MTF, cycles per mm
    #[arg(long, default_value_t = tolerance::Request::default().frequency, value_name = "PER_MM")]
    frequency: f64,
    /// Kind of the MTF: rays, accurate where spots are many times the Airy disk, or waves
    #[arg(long, value_enum, default_value = word(tolerance::Request::default().kind))]
    kind: Kind,
    /// Number of random lenses
    #[arg(long, default_value_t = tolerance::Request::default().trials, value_name = "N")]
    trials: usize,
    /// What is adjusted on every lens
    #[arg(long, value_enum, default_value = word(tolerance::Request::default().compensate))]
    compensate: Compensate,
    /// Print how many lenses reach this merit
    #[arg(long, value_name = "MERIT", allow_negative_numbers = true)]
    limit: Option<f64>,
    /// Print the tolerances that together cost this much of the merit, each an equal part
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
        grade: args.grade.map(|grade| match grade {
            GradeName::Commercial => tolerance::Grade::Commercial,
            GradeName::Precision => tolerance::Grade::Precision,
            GradeName::High => tolerance::Grade::High,
        }),
        merit: match args.merit {
            MeritName::Rms => tolerance::Merit::Rms,
            MeritName::Mtf => tolerance::Merit::Mtf,
        },
        frequency: args.frequency,
        kind: match args.kind {
            Kind::Geometric => PsfKind::Geometric,
            Kind::Diffraction => PsfKind::Diffraction,
        },
        trials: args.trials,
        compensate: match args.compensate {
            Compensate::Focus => tolerance::Compensate::Focus,
            Compensate::None => tolerance::Compensate::None,
        },
        limit: args.limit,
        inverse: args.inverse,
        seed: args.seed,
        list_trials: false,
        worst: args.worst,
        out: args.out,
    };
    let response = tolerance::run(&request, &terminal.context())?;
    if args.json {
        return print_json(&response.report);
    }
    table::print(&response, args.all);
    if let Some(out) = &request.out {
        noteln!("written to {}", shown(out));
    }
    Ok(Code::SUCCESS)
}
