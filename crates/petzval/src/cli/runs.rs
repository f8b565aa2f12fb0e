//! `petzval runs`: all runs below a folder in one table.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::base::time_text;
use crate::cli::code::Code;
use crate::units::jobs::runs::{self, Request};
use crate::units::runs::{RunRow, RunState, Runs, USUAL_FOLDER};

use super::failure::Failure;
use super::plain::{self, shown};
use super::signals;
use super::terminal::{Terminal, print_response};
use super::text_table::TextTable;

/// List all runs below a folder: how far each has come, its scores, and in which keys of their experiments they differ.
///
/// Units of stores, as `petzval sweep` keeps them, are listed by their names. A run is finished, running, stopped (it goes on with `petzval design --resume`) or damaged, with the reason. Scores are those of the
/// last finished camera that is no ceiling. Runs are compared with those of the same title.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder with runs, at any depth; links to folders are followed one level
    #[arg(default_value = USUAL_FOLDER)]
    dir: PathBuf,
    /// Print the table again whenever it changes, until a signal ends it
    #[arg(long, conflicts_with = "json")]
    watch: bool,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Between two looks of --watch.
const AGAIN: Duration = Duration::from_secs(2);

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let context = terminal.context();
    let request = Request { folder: args.dir.clone() };
    if args.watch {
        let stop = signals::end_on_signal()?;
        let context = context.with_cancellation(stop);
        let mut last = String::new();
        loop {
            let text = in_words(&runs::run(&request, &context)?, &args);
            if text != last {
                outln!("{text}");
                last = text;
            }
            std::thread::sleep(AGAIN);
        }
    }
    let runs = runs::run(&request, &context.with_cancellation(signals::end_on_signal()?))?;
    print_response(args.json, &runs, || out!("{}", in_words(&runs, &args)))
}

/// Keys that a line names of those that differ.
const NAMED: usize = 6;

/// The table, and what is damaged or failed.
fn in_words(runs: &Runs, args: &Args) -> String {
    if runs.runs.is_empty() && runs.units.is_empty() {
        return format!("no runs in {}\n", shown(&args.dir));
    }
    let mut table = TextTable::new(["run", "state", "step", "time", "scores", "differs in"]);
    let mut reasons = String::new();
    for row in &runs.runs {
        let name = name(&row.run, args);
        let state = state(row.state).to_owned();
        if let Some(reason) = &row.reason {
            reasons += &format!("{name}: {reason}\n");
        }
        table.row([name, state, steps(row), time_text(row.seconds), scores(row), differs(row, runs)]);
    }
    for unit in &runs.units {
        // A store that cannot be read has no units.
        let of_unit =
            if unit.name.is_empty() { String::new() } else { format!(": {}", plain::line(&unit.name)) };
        let name = name(&unit.store, args) + &of_unit;
        if let Some(reason) = &unit.reason {
            reasons += &format!("{name}: {}\n", plain::message(reason));
        }
        let none = || "-".to_owned();
        let run = unit.run.as_ref();
        let seconds = unit.seconds.or(run.map(|run| run.seconds));
        table.row([
            name,
            unit.state.clone(),
            run.map_or_else(none, steps),
            seconds.map_or_else(none, time_text),
            run.map_or_else(none, scores),
            run.map_or_else(String::new, |run| differs(run, runs)),
        ]);
    }
    table.text() + &reasons
}

/// A path below the folder that is listed.
fn name(path: &Path, args: &Args) -> String {
    let below = path.strip_prefix(&args.dir).ok().filter(|path| path.as_os_str() != "");
    shown(below.unwrap_or(path))
}

fn state(state: RunState) -> &'static str {
    match state {
        RunState::Finished => "finished",
        RunState::Running => "running",
        RunState::Stopped => "stopped",
        RunState::Damaged => "damaged",
    }
}

fn steps(row: &RunRow) -> String {
    match (row.state, row.total) {
        (RunState::Damaged, _) | (_, 0) => "-".to_owned(),
        (RunState::Finished, _) => row.step.to_string(),
        (_, total) => format!("{}/{total}", row.step),
    }
}

fn scores(row: &RunRow) -> String {
    let values: Vec<String> =
        row.scores.iter().map(|score| format!("{} {:.*}", score.name, score.decimals, score.value)).collect();
    match &row.camera {
        Some(camera) => format!("{camera}: {}", values.join(", ")),
        None => "-".to_owned(),
    }
}

/// The keys in which a run differs from others of its title, with its values.
fn differs(row: &RunRow, runs: &Runs) -> String {
    let keys = runs.keys_in_order(row).into_iter();
    let named: Vec<String> =
        keys.take(NAMED).filter_map(|key| Some(format!("{key}={}", row.differs.get(key)?))).collect();
    match row.differs.len().saturating_sub(NAMED) {
        0 => named.join(" "),
        more => format!("{} and {more} more", named.join(" ")),
    }
}
