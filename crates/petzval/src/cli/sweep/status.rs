//! `petzval sweep status`.

use std::path::PathBuf;
use std::time::Duration;

use crate::base::{Cancel, time_text};
use crate::units::jobs::sweep_status::{self, Request};
use crate::units::store::Seen;
use crate::units::sweep::{KeptSweep, State, SweepStatus, UnitStatus, status};

use super::super::code::Code;
use super::super::failure::Failure;
use super::super::plain;
use super::super::signals;
use super::super::terminal::{Terminal, print_response};
use super::super::text_table::TextTable;

/// Show how the units of a sweep stand: done, running, stale (their process is gone, the next one goes on), stopped, failed or waiting.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the store
    dir: PathBuf,
    /// List units that are done or waiting, too
    #[arg(long)]
    all: bool,
    /// Print it again whenever it changes, until all units have ended or a signal comes
    #[arg(long, conflicts_with = "json")]
    watch: bool,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Between two looks of --watch.
const AGAIN: Duration = Duration::from_secs(2);

/// Runs the verb.
pub fn run(args: &Args, terminal: &Terminal) -> Result<Code, Failure> {
    if !args.watch {
        let request = Request { store: args.dir.clone() };
        let now = sweep_status::run(&request, &terminal.context())?;
        return print_response(args.json, &now, || out!("{}", in_words(&now, args.all)));
    }
    // Looks one after another see which claims stay unchanged.
    let (kept, mut seen) = (KeptSweep::read(&args.dir)?, Seen::default());
    let _stop = signals::end_on_signal()?;
    let mut last = String::new();
    loop {
        let now = status(&kept, &args.dir, &mut seen, &Cancel::default())?;
        let text = in_words(&now, args.all);
        if text != last {
            outln!("{text}");
            last = text;
        }
        if now.units.iter().all(|unit| unit.state == State::Done || unit.has_error()) {
            return Ok(Code::SUCCESS);
        }
        std::thread::sleep(AGAIN);
    }
}

fn in_words(now: &SweepStatus, all: bool) -> String {
    let mut table = TextTable::new(["unit", "state", "attempt", "time", "by"]);
    let is_shown = |unit: &&UnitStatus| all || !matches!(unit.state, State::Done | State::Waiting);
    let mut shown = 0;
    for unit in now.units.iter().filter(is_shown) {
        shown += 1;
        let attempt = if unit.attempt == 0 { "-".to_owned() } else { unit.attempt.to_string() };
        let seconds = unit.seconds.map_or_else(|| "-".to_owned(), time_text);
        table.row([unit.name.clone(), unit.state.word().to_owned(), attempt, seconds, unit.holder.clone()]);
    }
    let table = if shown > 0 { table.text() } else { String::new() };
    format!("{table}{}{}", errors(now), counts(now))
}

/// Why units have failed, and what of others is damaged, a line each.
pub(super) fn errors(now: &SweepStatus) -> String {
    let error = |unit: &UnitStatus| {
        let error = unit.error.as_ref()?;
        Some(format!("{}: {}\n", plain::line(&unit.name), plain::message(error)))
    };
    now.units.iter().filter_map(error).collect()
}

/// How many units stand how: `4 of 6 units: 4 done, 1 failed, 1 damaged`.
pub(super) fn counts(now: &SweepStatus) -> String {
    format!("{} of {} units: {}\n", now.count(State::Done), now.units.len(), now.in_words())
}
