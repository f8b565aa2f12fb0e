//! How the units of a sweep stand.

use std::path::Path;

use petzval_base::Cancel;
use petzval_jobs::{ErrorReport, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kept::KeptSweep;
use crate::store::{Seen, State, Store, UnitState};

/// A unit and how it stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UnitStatus {
    /// Its name.
    pub name: String,
    /// Its key in the store.
    pub key: String,
    /// How it stands.
    pub state: State,
    /// Number of the attempt, from 1; 0 before the first.
    pub attempt: u32,
    /// Who works or worked on it; empty where nobody did, or where the file system does not show it yet.
    pub holder: String,
    /// Wall-clock seconds of the attempt that ended it, s.
    pub seconds: Option<f64>,
    /// CPU seconds of all its attempts, s.
    pub cpu_seconds: Option<f64>,
    /// Why it failed or what is damaged, with its place and the hint.
    pub error: Option<String>,
}

/// How a sweep stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SweepStatus {
    /// Title.
    pub title: String,
    /// Units, in the order of the sweep.
    pub units: Vec<UnitStatus>,
}

impl UnitStatus {
    /// Whether it will have no result by itself.
    pub fn has_error(&self) -> bool {
        matches!(self.state, State::Failed | State::Damaged)
    }
}

impl SweepStatus {
    /// How many units stand so.
    pub fn count(&self, state: State) -> usize {
        self.units.iter().filter(|unit| unit.state == state).count()
    }

    /// `4 done, 1 failed, 1 waiting`.
    pub fn in_words(&self) -> String {
        let counts = State::ALL.map(|state| (self.count(state), state.word()));
        let there: Vec<String> = counts
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, word)| format!("{count} {word}"))
            .collect();
        there.join(", ")
    }
}

/// How the units of a sweep stand, as this process sees it. `seen` holds what earlier looks have seen: without it no claim of another machine is stale.
///
/// Each unit costs reads of a file system that may be slow: `cancel` ends the look between two of them.
pub fn status(sweep: &KeptSweep, root: &Path, seen: &mut Seen, cancel: &Cancel) -> Result<SweepStatus> {
    let store = Store::open(root)?;
    let mut units = Vec::with_capacity(sweep.units.len());
    for unit in &sweep.units {
        cancel.check()?;
        let bare = UnitStatus {
            name: unit.name.clone(),
            key: unit.key.to_string(),
            state: State::Waiting,
            attempt: 0,
            holder: String::new(),
            seconds: None,
            cpu_seconds: None,
            error: None,
        };
        let of_claim = |state, attempt, claim: Option<crate::store::Claim>| {
            let holder = claim.map_or_else(String::new, |claim| claim.holder.to_string());
            UnitStatus { state, attempt, holder, ..bare.clone() }
        };
        units.push(match store.state(&unit.key, seen)? {
            UnitState::Waiting => bare,
            UnitState::Running { attempt, claim } => of_claim(State::Running, attempt, claim),
            UnitState::Stale { attempt, claim } => of_claim(State::Stale, attempt, claim),
            UnitState::Stopped { attempt } => of_claim(State::Stopped, attempt, None),
            UnitState::Failed(failure) => UnitStatus {
                state: State::Failed,
                attempt: failure.attempt,
                holder: failure.cost.holder.to_string(),
                seconds: Some(failure.cost.seconds),
                cpu_seconds: Some(failure.cost.all_cpu_seconds),
                error: Some(in_one_text(&failure.error)),
                ..bare
            },
            UnitState::Damaged(error) => {
                UnitStatus { state: State::Damaged, error: Some(in_one_text(&error)), ..bare }
            }
            UnitState::Done(result) => UnitStatus {
                state: State::Done,
                attempt: result.attempt,
                holder: result.cost.holder.to_string(),
                seconds: Some(result.cost.seconds),
                cpu_seconds: Some(result.cost.all_cpu_seconds),
                ..bare
            },
        });
    }
    Ok(SweepStatus { title: sweep.title.clone(), units })
}

/// An error with its place and its hint.
fn in_one_text(error: &ErrorReport) -> String {
    match error.hint.as_str() {
        "" => error.in_words(),
        hint => format!("{} (hint: {hint})", error.in_words()),
    }
}
