//! `unit-status`: where the units of a store stand.

use std::path::PathBuf;

use petzval_jobs::{Context, ErrorReport, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::store::{Claim, Cost, Failure, Seen, State, Store, UnitState};
use crate::unit::Key;

/// A store of units.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Its folder.
    pub store: PathBuf,
}

/// A unit that was begun.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Entry {
    /// Its key.
    pub key: Key,
    /// Its name; empty if it cannot be read.
    pub name: String,
    /// Its job; empty if it cannot be read.
    pub job: String,
    /// How it stands.
    pub state: State,
    /// Number of the attempt, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attempt: Option<u32>,
    /// Who works or worked on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub claim: Option<Claim>,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<Box<Failure>>,
    /// Which file of it is damaged, and what to do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damage: Option<Box<ErrorReport>>,
    /// What the attempt cost that ended it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<Cost>,
}

/// Looks at every unit once, in the order of their names. Units that nobody has begun are not in a store.
pub fn run(request: &Request, context: &Context) -> Result<Vec<Entry>> {
    let store = Store::open(&request.store)?;
    let (mut entries, mut seen) = (Vec::new(), Seen::default());
    for key in store.keys()? {
        context.check(|| format!("stopped after {} units", entries.len()))?;
        entries.push(entry(key, &store, &mut seen)?);
    }
    entries.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(entries)
}

fn entry(key: Key, store: &Store, seen: &mut Seen) -> Result<Entry> {
    // What cannot be read has no name; its state says why.
    let unit = store.unit(&key).ok().flatten();
    let (name, job) = unit.map_or_else(Default::default, |unit| (unit.name, unit.call.job));
    let found = store.state(&key, seen)?;
    let bare = Entry {
        key,
        name,
        job,
        state: found.state(),
        attempt: None,
        claim: None,
        failure: None,
        damage: None,
        cost: None,
    };
    Ok(match found {
        UnitState::Waiting => bare,
        UnitState::Running { attempt, claim } | UnitState::Stale { attempt, claim } => {
            Entry { attempt: Some(attempt), claim, ..bare }
        }
        UnitState::Stopped { attempt } => Entry { attempt: Some(attempt), ..bare },
        UnitState::Failed(failure) => {
            let (attempt, cost) = (Some(failure.attempt), Some(failure.cost.clone()));
            Entry { attempt, cost, failure: Some(failure), ..bare }
        }
        UnitState::Damaged(damage) => Entry { damage: Some(damage), ..bare },
        UnitState::Done(result) => Entry { attempt: Some(result.attempt), cost: Some(result.cost), ..bare },
    })
}
