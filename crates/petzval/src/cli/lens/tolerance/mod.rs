//! `petzval lens tolerance`: what becomes of a lens when it is made.

mod files;
mod result;
mod table;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use petzval::built_in_assets;
use petzval::design::error::DesignError;
use petzval::files::{ToleranceFile, parse_tolerances};
use petzval::optics::analysis::first_order_table;
use petzval::optics::lens::Lens;
use petzval::optics::merit::{Merit, Mtf, RmsSpot};
use petzval::optics::psf::PsfKind;
use petzval::optics::tolerance::{Grade, Study, ToleranceError, inverse, monte_carlo, sensitivities};

use crate::cli::{Failure, print_json};
use result::Findings;

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

/// What is set anew on every lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Compensate {
    /// The image plane goes where the merit is best.
    Focus,
    /// Nothing but what the tolerance file names.
    None,
}

/// Say how sensitive a lens is to errors in its making, and how good lenses made at random are.
///
/// With --out: tolerance.json (all figures), sensitivities.csv, trials.csv (every lens with what is off in it), tolerances.toml (every
/// tolerance, ready to be edited), yield.svg, sensitivity.svg, and the worst lenses as files.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Lens file, or a built-in name
    lens: String,
    /// Tolerance file
    #[arg(long, value_name = "FILE")]
    tolerances: Option<PathBuf>,
    /// Tolerances of good practice for all that the file does not name (without a file: precision)
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
    /// What is set anew on every lens
    #[arg(long, value_enum, default_value = "focus")]
    compensate: Compensate,
    /// Say how many lenses reach this merit
    #[arg(long, value_name = "MERIT", allow_negative_numbers = true)]
    limit: Option<f64>,
    /// Say how exactly each quantity must be made, if all together may cost this much of the merit
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

/// Lenses that are made at most.
const MOST_TRIALS: usize = 1_000_000;

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    check(args)?;
    let lens = built_in_assets().lens(&args.lens)?.lens;
    let tolerances = tolerance_file(args, &lens)?.tolerances(&lens, args.compensate == Compensate::Focus);
    if tolerances.perturbations.is_empty() {
        return Err(Failure::input(
            "nothing is off: there is no tolerance",
            "give a --grade, or name some in the file",
        ));
    }
    let cutoff = first_order_table(&lens).cutoff_per_mm;
    if matches!(args.merit, MeritName::Mtf) && args.frequency >= cutoff {
        return Err(Failure::input(
            format!("--frequency {}: the lens resolves nothing beyond {cutoff:.1} cycles/mm", args.frequency),
            "the cutoff is 1 / (wavelength x working f-number)",
        ));
    }
    let merit = merit(args, &lens);
    let study = Study::new(&lens, &tolerances, merit.as_ref()).map_err(|error| {
        let hint = match error {
            ToleranceError::NoMerit => "`petzval lens show` says which field has no spot",
            _ => "correct the tolerance file",
        };
        Failure::input(format!("{}: {error}", args.lens), hint)
    })?;
    if let Some(out) = &args.out {
        Failure::folder(out)?;
    }
    let count = tolerances.perturbations.len() as u64;
    let table = watched("sensitivities", count, |tick| sensitivities(&study, tick));
    let random = (args.trials > 0).then(|| {
        watched("lenses", args.trials as u64, |tick| monte_carlo(&study, args.seed, args.trials, tick))
    });
    let shared = args.inverse.map(|loss| watched("inverse", count, |tick| inverse(&study, loss, tick)));
    let findings = Findings { lens: &lens, study: &study, table, random, shared, limit: args.limit };
    if let Some(out) = &args.out {
        files::write(&findings, out, args.worst)?;
    }
    if args.json {
        return print_json(&result::json(&findings, args.worst));
    }
    table::print(&findings, args.all);
    if let Some(out) = &args.out {
        eprintln!("written to {}", out.display());
    }
    Ok(ExitCode::SUCCESS)
}

fn check(args: &Args) -> Result<(), Failure> {
    let positive = |v: f64| v > 0.0 && v.is_finite();
    let mtf = matches!(args.merit, MeritName::Mtf);
    for (name, ok, hint) in [
        (
            "--frequency",
            (0.01..=1e4).contains(&args.frequency),
            "in cycles per mm, 0.01 to 10000; a pixel of 5 um ends at 100",
        ),
        ("--trials", args.trials <= MOST_TRIALS, "at most 1000000; 0 leaves the random lenses out"),
        (
            "--limit",
            args.limit.is_none_or(|v| positive(v) && (!mtf || v <= 1.0)),
            "a merit: um for the RMS spot, 0 to 1 for the MTF",
        ),
        (
            "--inverse",
            args.inverse.is_none_or(|v| positive(v) && (!mtf || v < 1.0)),
            "a loss of the merit above 0: um for the RMS spot, less than 1 for the MTF",
        ),
    ] {
        if !ok {
            return Err(Failure::input(format!("{name}: out of range"), hint));
        }
    }
    Ok(())
}

/// What the file says, and the grade of the rest.
fn tolerance_file(args: &Args, lens: &Lens) -> Result<ToleranceFile, Failure> {
    let mut file = match &args.tolerances {
        None => ToleranceFile { grade: Some(Grade::Precision), ..ToleranceFile::default() },
        Some(path) => read(path, lens)?,
    };
    match args.grade {
        Some(GradeName::Commercial) => file.grade = Some(Grade::Commercial),
        Some(GradeName::Precision) => file.grade = Some(Grade::Precision),
        Some(GradeName::High) => file.grade = Some(Grade::High),
        None => {}
    }
    Ok(file)
}

fn read(path: &Path, lens: &Lens) -> Result<ToleranceFile, Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|e| Failure::input(format!("{}: {e}", path.display()), "--tolerances takes a TOML file"))?;
    Ok(parse_tolerances(&text, lens).map_err(DesignError::input(path))?)
}

fn merit(args: &Args, lens: &Lens) -> Box<dyn Merit> {
    let kind = match args.kind {
        Kind::Geometric => PsfKind::Geometric,
        Kind::Diffraction => PsfKind::Diffraction,
    };
    match args.merit {
        MeritName::Rms => Box::new(RmsSpot::new(lens)),
        MeritName::Mtf => Box::new(Mtf::new(lens, args.frequency, kind)),
    }
}

/// Does something many times under a progress bar.
fn watched<T>(what: &str, count: u64, job: impl FnOnce(&(dyn Fn() + Sync)) -> T) -> T {
    let bar = ProgressBar::new(count);
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {pos}/{len}, {eta} left") {
        bar.set_style(style);
    }
    bar.set_message(what.to_owned());
    let done = job(&|| bar.inc(1));
    bar.finish_and_clear();
    done
}
