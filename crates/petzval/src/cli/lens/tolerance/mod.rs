//! `petzval lens tolerance`: how sensitive a lens is to errors in its making.

mod table;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use petzval::jobs::lens::tolerance;
use petzval::optics::psf::PsfKind;

use super::bar::Bar;
use crate::cli::{Failure, print_json};

/// How exactly a lens is made.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum GradeName {
    /// What any shop holds.
    Commercial,
    /// Good optics.
    Precision,
    /// As well as can be had at a price.
    High,
}

/// What a lens is judged by.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MeritName {
    /// RMS spot radius.
    Rms,
    /// Contrast at a spatial frequency.
    Mtf,
}

/// What light is taken for.
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

/// Find how sensitive a lens is to errors in its making, and how good lenses made at random are.
///
/// With --out: tolerance.json (all figures), sensitivities.csv, trials.csv (every lens with all its errors), tolerances.toml (every
/// tolerance, ready to be edited), yield.svg, sensitivity.svg, and the worst lenses as files.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    lens: String,
    /// Tolerance file
    #[arg(long, value_name = "FILE")]
    tolerances: Option<PathBuf>,
    /// Tolerances of good practice for everything that the file does not name (without a file: precision)
    #[arg(long, value_enum)]
    grade: Option<GradeName>,
    /// What a lens is judged by, over its fields (on both sides of the axis) and wavelengths
    #[arg(long, value_enum, default_value = "rms")]
    merit: MeritName,
    /// Spatial frequency of the MTF, cycles per mm
    #[arg(long, default_value_t = 40.0, value_name = "PER_MM")]
    frequency: f64,
    /// What the MTF takes light for: rays, right where spots are many times the Airy disk, or waves
    #[arg(long, value_enum, default_value = "geometric")]
    kind: Kind,
    /// Lenses made at random
    #[arg(long, default_value_t = 1000, value_name = "N")]
    trials: usize,
    /// What is adjusted on every lens
    #[arg(long, value_enum, default_value = "focus")]
    compensate: Compensate,
    /// Print how many lenses reach this merit
    #[arg(long, value_name = "MERIT", allow_negative_numbers = true)]
    limit: Option<f64>,
    /// Print how exactly each quantity must be made, if all together may cost this much of the merit
    #[arg(long, value_name = "LOSS", allow_negative_numbers = true)]
    inverse: Option<f64>,
    /// Seed of the random lenses
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// How many of the worst lenses to write
    #[arg(long, default_value_t = 3, value_name = "N")]
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
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let request = tolerance::Request {
        lens: args.lens,
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
        worst: args.worst,
        out: args.out,
    };
    let bar = Bar::new();
    let response = tolerance::run(&request, &bar.context())?;
    drop(bar);
    if args.json {
        return print_json(&response.report);
    }
    table::print(&response, args.all);
    if let Some(out) = &request.out {
        eprintln!("written to {}", out.display());
    }
    Ok(ExitCode::SUCCESS)
}
