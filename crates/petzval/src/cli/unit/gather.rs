//! `petzval unit gather`.

use std::path::{Path, PathBuf};

use crate::base::counted;
use crate::cli::code::Code;
use crate::jobs::JobError;
use crate::units::jobs::unit_gather::{self, Analysis, Request};
use crate::units::store::Store;
use crate::units::unit::read_units;

use super::super::failure::Failure;
use super::super::number::figure;
use super::super::plain::{self, shown};
use super::super::terminal::{Terminal, print_response};
use super::run::context;

/// Join the random lenses of `lens-tolerance` units that are parts of one analysis.
///
/// Units that differ in `part` alone become one analysis, the same to the bit as that of a single run. Sensitivities are computed here, once.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// File of units, one in each line as JSON
    file: PathBuf,
    /// Folder of the store
    #[arg(long, value_name = "DIR")]
    store: PathBuf,
    /// Folder for the files of the analysis, as `lens tolerance --out` writes them; of several analyses one folder each in it
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let file = read_units(&args.file)?;
    let store = Store::open(&args.store).map_err(JobError::from)?;
    let absolute = |path: &Path| {
        std::path::absolute(path).map_err(|e| Failure::input(format!("{}: {e}", shown(path)), ""))
    };
    let out = args.out.as_deref().map(absolute).transpose()?;
    // Its analyses are computed with the instruction set of their lenses.
    if let Some(unit) = file.units.iter().find(|unit| unit.call.job == "lens-tolerance") {
        super::run::with_level(unit, terminal)?;
    }
    let context = context(&args.file, terminal)?;
    let request = Request { units: file.units, store: store.root().to_path_buf(), out };
    let joined = unit_gather::run(&request, &context);
    drop(context);
    let joined = joined?;
    print_response(args.json, &joined, || {
        for Analysis { units, report } in &joined {
            let lenses = report.monte_carlo.as_ref();
            let figures = lenses.map_or_else(String::new, |random| {
                format!(
                    ": {} lenses, mean {} {}, standard deviation {}",
                    random.trials,
                    figure(random.mean, 4),
                    report.unit,
                    figure(random.standard_deviation, 4)
                )
            });
            outln!(
                "{}",
                plain::message(&format!("{} from {}{figures}", report.lens, counted(units.len(), "unit")))
            );
        }
        if let Some(out) = &request.out {
            noteln!("written to {}", shown(out));
        }
    })
}
