//! `petzval sweep gather`.

use std::path::PathBuf;

use crate::base::pasted;
use crate::units::jobs::sweep_gather::{self, Request, Response};
use crate::units::sweep::{
    Column, Gathered, GatheredRow, KeptSweep, figures_that_vary, in_words, number, units_file,
};

use super::super::code::Code;
use super::super::failure::Failure;
use super::super::plain::{self, shown};
use super::super::terminal::{Terminal, print_response};
use super::super::text_table::TextTable;
use super::status::{counts, errors};

/// Gather the results of a sweep: a table in which the keys that vary are columns, with mean, standard deviation over the seeds, and range.
///
/// It is written as table.csv, the single units as units.csv, and sweep.html shows the table, the same picture by every unit, and one scatter
/// plot. A sweep that still runs is gathered as far as it has come; units that failed or are damaged are listed with their errors.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the store
    dir: PathBuf,
    /// Folder for the tables and the page [default: the store]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Key or figure along the axis of the scatter plot to the right [default: the key with the most values other than the seed, else the second figure]
    #[arg(long, value_name = "NAME")]
    x: Option<String>,
    /// Key or figure along its upward axis [default: the first figure that varies]
    #[arg(long, value_name = "NAME")]
    y: Option<String>,
    /// Figure that the page shows; may be repeated [default: those that vary: all scores and those of the lens]
    #[arg(long, value_name = "NAME")]
    figure: Vec<String>,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// The job whose units may be parts of one analysis, and the key that says so.
const TOLERANCES: &str = "lens-tolerance";
const PART: &str = "part";

/// Runs the verb.
pub fn run(args: &Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = Request {
        store: args.dir.clone(),
        out: Some(args.out.as_ref().unwrap_or(&args.dir).clone()),
        x: args.x.clone(),
        y: args.y.clone(),
        figure: args.figure.clone(),
    };
    let response = sweep_gather::run(&request, &terminal.context())?;
    let kept = KeptSweep::read(&args.dir)?;
    print_response(args.json, &response, || {
        let Response { gathered, files } = &response;
        out!("{}", table(gathered));
        out!("{}{}", errors(&gathered.status), counts(&gathered.status));
        if kept.job == TOLERANCES && kept.keys.iter().any(|key| key == PART) {
            let units = pasted(&units_file(&args.dir));
            outln!("join the parts: petzval unit gather {units} --store {}", pasted(&args.dir));
        }
        files.iter().for_each(|path| outln!("{}", shown(path)));
    })
}

/// Figures of the table on the terminal.
const SHOWN: usize = 4;

/// The table with its first figures that vary.
fn table(gathered: &Gathered) -> String {
    let figures: Vec<usize> = figures_that_vary(gathered).into_iter().take(SHOWN).collect();
    let columns = gathered.shown_columns(&figures);
    let line = |text: &str| plain::line(text).into_owned();
    let heads: Vec<String> = columns.iter().map(|column| line(&gathered.head(*column))).collect();
    let mut table = TextTable::new(heads.iter().map(String::as_str));
    for row in &gathered.rows {
        table.row(columns.iter().map(|column| line(&cell(gathered, row, *column))));
    }
    table.text()
}

/// A cell of the table; a dash where there is nothing.
fn cell(gathered: &Gathered, row: &GatheredRow, column: Column) -> String {
    match column {
        Column::Key(k) => in_words(&row.values[k]),
        Column::Camera if row.camera.is_empty() => "-".to_owned(),
        Column::Camera => row.camera.clone(),
        Column::Repeats => row.units.len().to_string(),
        Column::Figure(k) => {
            let (Some(spread), figure) = (row.figures[k], &gathered.figures[k]) else {
                return "-".to_owned();
            };
            let deviation = spread.deviation.map(|deviation| format!(" ± {}", number(figure, deviation)));
            number(figure, spread.mean) + &deviation.unwrap_or_default()
        }
        Column::Status => row.status.clone(),
    }
}
