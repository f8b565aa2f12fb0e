//! `petzval unit status`.

use std::path::PathBuf;

use crate::cli::code::Code;
use crate::units::jobs::unit_status::{self, Entry, Request};
use crate::units::store::State;

use super::super::failure::Failure;
use super::super::plain;
use super::super::terminal::{Terminal, print_response};

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

/// States in the order in which they are counted. A unit in a store was begun.
const SHOWN: [State; 6] =
    [State::Done, State::Running, State::Stopped, State::Stale, State::Failed, State::Damaged];

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let units = unit_status::run(&Request { store: args.dir }, &terminal.context())?;
    print_response(args.json, &units, || {
        for unit in &units {
            let more = match unit {
                Entry { failure: Some(failure), .. } => failure.error.in_words(),
                Entry { damage: Some(damage), .. } => damage.in_words(),
                Entry { claim: Some(claim), .. } => format!("{} since {}", claim.holder, claim.began),
                Entry { cost: Some(cost), .. } => format!("{:.1} s", cost.seconds),
                _ => String::new(),
            };
            let (key, state) = (unit.key.short(), unit.state.word());
            let line = format!("{key}  {state:<8} {:<20} {}  {more}", unit.job, unit.name);
            outln!("{}", plain::line(line.trim_end()));
        }
        let counts =
            SHOWN.map(|state| (state.word(), units.iter().filter(|unit| unit.state == state).count()));
        let counts: Vec<String> =
            counts.iter().filter(|(_, n)| *n > 0).map(|(state, n)| format!("{n} {state}")).collect();
        outln!("{}", if counts.is_empty() { "no unit was begun here".to_owned() } else { counts.join(", ") });
    })
}
