//! `petzval unit status`.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::jobs::{ErrorReport, JobError};
use crate::units::store::{Claim, Cost, Failure as FailedUnit, Seen, Store, UnitState};
use serde::Serialize;

use super::super::failure::Failure;
use super::super::plain;
use super::super::terminal::print_response;

/// Show where the units of a store stand.
///
/// Units that nobody has begun are not in a store. Whether a process of another machine still lives is seen only by who waits for it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the store
    dir: PathBuf,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// A unit, as JSON.
#[derive(Serialize)]
struct Row {
    key: String,
    name: String,
    job: String,
    state: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    attempt: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    claim: Option<Claim>,
    #[serde(skip_serializing_if = "Option::is_none")]
    failure: Option<Box<FailedUnit>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    damage: Option<Box<ErrorReport>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cost: Option<Cost>,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<Code, Failure> {
    let rows = rows(&args)?;
    print_response(args.json, &rows, || {
        for row in &rows {
            let more = match row {
                Row { failure: Some(failure), .. } => failure.error.in_words(),
                Row { damage: Some(damage), .. } => damage.in_words(),
                Row { claim: Some(claim), .. } => format!("{} since {}", claim.holder, claim.began),
                Row { cost: Some(cost), .. } => format!("{:.1} s", cost.seconds),
                _ => String::new(),
            };
            let line = format!("{}  {:<8} {:<20} {}  {more}", &row.key[..12], row.state, row.job, row.name);
            outln!("{}", plain::line(line.trim_end()));
        }
        let count = |state: &str| rows.iter().filter(|row| row.state == state).count();
        let counts =
            ["done", "running", "stopped", "stale", "failed", "damaged"].map(|state| (state, count(state)));
        let counts: Vec<String> =
            counts.iter().filter(|(_, n)| *n > 0).map(|(state, n)| format!("{n} {state}")).collect();
        outln!("{}", if counts.is_empty() { "no unit was begun here".to_owned() } else { counts.join(", ") });
    })
}

fn rows(args: &Args) -> Result<Vec<Row>, JobError> {
    let store = Store::open(&args.dir)?;
    let mut seen = Seen::default();
    let mut rows = Vec::new();
    for key in store.keys()? {
        // What cannot be read has no name; its state says why.
        let unit = store.unit(&key).ok().flatten();
        let (name, job) = unit.map_or_else(Default::default, |unit| (unit.name, unit.call.job));
        let state = store.state(&key, &mut seen)?;
        let bare = Row {
            key: key.to_string(),
            name,
            job,
            state: state.state().word(),
            attempt: None,
            claim: None,
            failure: None,
            damage: None,
            cost: None,
        };
        rows.push(match state {
            UnitState::Waiting => bare,
            UnitState::Running { attempt, claim } | UnitState::Stale { attempt, claim } => {
                Row { attempt: Some(attempt), claim, ..bare }
            }
            UnitState::Stopped { attempt } => Row { attempt: Some(attempt), ..bare },
            UnitState::Failed(failure) => {
                let (attempt, cost) = (Some(failure.attempt), Some(failure.cost.clone()));
                Row { attempt, cost, failure: Some(failure), ..bare }
            }
            UnitState::Damaged(damage) => Row { damage: Some(damage), ..bare },
            UnitState::Done(result) => Row { attempt: Some(result.attempt), cost: Some(result.cost), ..bare },
        });
    }
    rows.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(rows)
}
