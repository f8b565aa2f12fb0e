//! Where a unit stands.

use std::collections::HashMap;
use std::time::Duration;

use petzval_base::Cancel;
use petzval_jobs::{ErrorReport, JobError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::StoreError;
use super::record::{AttemptRecord, Claim, Ended, Failure, StoredResult};
use super::{STALE_AFTER, Store, VISIBLE_WITHIN};
use crate::unit::Key;

/// Where a unit stands.
#[derive(Clone, Debug, PartialEq)]
pub enum UnitState {
    /// Nobody has begun it.
    Waiting,
    /// A process works on it.
    Running {
        /// Number of the attempt.
        attempt: u32,
        /// Who; none if the file system does not show it yet.
        claim: Option<Claim>,
    },
    /// The process that worked on it is gone: the next one goes on.
    Stale {
        /// Number of the attempt.
        attempt: u32,
        /// Who worked on it.
        claim: Option<Claim>,
    },
    /// It was stopped; the next process goes on.
    Stopped {
        /// Number of the attempt.
        attempt: u32,
    },
    /// It has failed.
    Failed(Box<Failure>),
    /// It has a result.
    Done(Box<StoredResult>),
    /// A file of its folder holds what this program does not write there, or a file of its result is missing. It is neither run nor counted.
    Damaged(Box<ErrorReport>),
}

/// How a unit stands, in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// It has a result.
    Done,
    /// A process works on it.
    Running,
    /// The process that worked on it is gone; the next one goes on.
    Stale,
    /// It was stopped; the next process goes on.
    Stopped,
    /// It has failed.
    Failed,
    /// A file of its folder holds what this program does not write there.
    Damaged,
    /// Nobody has begun it.
    Waiting,
}

impl State {
    /// All, in the order in which they are counted.
    pub const ALL: [Self; 7] =
        [Self::Done, Self::Running, Self::Stale, Self::Stopped, Self::Failed, Self::Damaged, Self::Waiting];

    /// In one word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Running => "running",
            Self::Stale => "stale",
            Self::Stopped => "stopped",
            Self::Failed => "failed",
            Self::Damaged => "damaged",
            Self::Waiting => "waiting",
        }
    }
}

impl UnitState {
    /// Without what is known beside it.
    pub fn state(&self) -> State {
        match self {
            Self::Waiting => State::Waiting,
            Self::Running { .. } => State::Running,
            Self::Stale { .. } => State::Stale,
            Self::Stopped { .. } => State::Stopped,
            Self::Failed(_) => State::Failed,
            Self::Done(_) => State::Done,
            Self::Damaged(_) => State::Damaged,
        }
    }
}

/// What one process has seen of claims, by its own clock.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Number and renewals of the newest claim of a unit, and since when they are unchanged.
    claims: HashMap<Key, (u32, Option<u64>, Duration)>,
    /// Number of the newest attempt that another process is known to have begun at a unit, and when that was seen.
    others: HashMap<Key, (u32, Duration)>,
    /// Number of the attempt by which a unit had failed when this process set out to run units again; 0 if it had not.
    failed_before: HashMap<Key, u32>,
    /// Digest of the result of a unit whose attempt does not say that it has ended, and since when it is seen.
    results: HashMap<Key, (Option<String>, Duration)>,
}

/// What is known of another process at a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Other {
    /// None was seen.
    Unseen,
    /// It has begun a later attempt, which may not be visible yet.
    MayRun,
    /// Its attempt is the one that has ended.
    Ended,
}

impl Seen {
    /// How long attempt `number` of a unit has shown this many renewals.
    fn unchanged(&mut self, key: &Key, number: u32, renewed: Option<u64>, now: Duration) -> Duration {
        match self.claims.get(key) {
            Some((n, r, since)) if (*n, *r) == (number, renewed) => now.saturating_sub(*since),
            _ => {
                self.claims.insert(key.clone(), (number, renewed, now));
                Duration::ZERO
            }
        }
    }

    /// How long a result has been seen.
    pub(super) fn shown(&mut self, result: &StoredResult, now: Duration) -> Duration {
        match self.results.get(&result.key) {
            Some((sha256, since)) if *sha256 == result.sha256 => now.saturating_sub(*since),
            _ => {
                self.results.insert(result.key.clone(), (result.sha256.clone(), now));
                Duration::ZERO
            }
        }
    }

    /// Remembers that another process has begun attempt `number` of a unit.
    pub(super) fn note_other(&mut self, key: &Key, number: u32, now: Duration) {
        self.others.insert(key.clone(), (number, now));
    }

    /// What is known of another process at a unit, whose newest visible attempt is `number`.
    pub(super) fn other(&self, key: &Key, number: u32, now: Duration) -> Other {
        match self.others.get(key) {
            None => Other::Unseen,
            Some((newest, since)) if *newest > number && now.saturating_sub(*since) <= VISIBLE_WITHIN => {
                Other::MayRun
            }
            Some(_) => Other::Ended,
        }
    }

    /// Whether attempt `number` of a unit failed after this process had set out to run units again.
    pub(super) fn has_failed_since(&self, key: &Key, number: u32) -> bool {
        self.failed_before.get(key).is_some_and(|before| number > *before)
    }
}

/// A state, where what is wrong in the folder of the unit is one as well.
fn or_damaged(state: Result<UnitState, StoreError>) -> Result<UnitState, StoreError> {
    match state {
        Err(damage @ StoreError::Wrong { .. }) => {
            Ok(UnitState::Damaged(Box::new(JobError::from(damage).report())))
        }
        state => state,
    }
}

impl Store {
    /// Remembers which units have failed by now. What fails later, in another process, is not run again by this one.
    pub fn note_failures<'k>(
        &self,
        keys: impl IntoIterator<Item = &'k Key>,
        seen: &mut Seen,
    ) -> Result<(), StoreError> {
        for key in keys {
            let number = match self.state(key, seen)? {
                UnitState::Failed(failure) => failure.attempt,
                _ => 0,
            };
            seen.failed_before.insert(key.clone(), number);
        }
        Ok(())
    }

    /// Where a unit stands, as this process sees it. A claim of another machine counts as stale if `seen` has known it unchanged for
    /// [`STALE_AFTER`]. Files of a result are looked at by their sizes. Fails if the store cannot be read; a damaged unit is no such failure.
    pub fn state(&self, key: &Key, seen: &mut Seen) -> Result<UnitState, StoreError> {
        or_damaged(self.state_by_files(key, seen))
    }

    /// A unit with a result, of which every file was read: damaged if one has another content. None if it was cancelled.
    pub(super) fn read_in_full(
        &self,
        result: Box<StoredResult>,
        seen: &mut Seen,
        cancel: &Cancel,
    ) -> Result<Option<UnitState>, StoreError> {
        match self.check_contents(&result, seen, cancel) {
            Ok(is_read) => Ok(is_read.then_some(UnitState::Done(result))),
            Err(error) => or_damaged(Err(error)).map(Some),
        }
    }

    fn state_by_files(&self, key: &Key, seen: &mut Seen) -> Result<UnitState, StoreError> {
        if let Some(result) = self.result(key)? {
            self.check_sizes(&result, seen)?;
            return Ok(UnitState::Done(Box::new(result)));
        }
        // Claims are numbered without gaps, and never removed.
        let mut newest: Option<(u32, Claim)> = None;
        loop {
            let next = newest.as_ref().map_or(1, |(number, _)| number + 1);
            match self.read_if_there(&self.claim_file(key, next))? {
                Some(claim) => newest = Some((next, claim)),
                None => break,
            }
        }
        let Some((attempt, claim)) = newest else { return Ok(UnitState::Waiting) };
        let record = self.attempt_record(key, attempt)?;
        let renewed = record.as_ref().map(|record| record.renewed);
        Ok(match record {
            Some(AttemptRecord { ended: Some(Ended::Failed(failure)), .. }) => UnitState::Failed(failure),
            Some(AttemptRecord { ended: Some(Ended::Stopped | Ended::StoppedByDisk), .. }) => {
                UnitState::Stopped { attempt }
            }
            record => {
                let unchanged = seen.unchanged(key, attempt, renewed, self.clock.now());
                // An attempt that has ended with a result has one that is not visible yet, or that was taken away since.
                let has_result = record.is_some_and(|record| record.ended.is_some());
                let is_gone = !has_result && claim.holder.is_gone();
                let claim = Some(claim);
                if is_gone || unchanged >= STALE_AFTER {
                    UnitState::Stale { attempt, claim }
                } else {
                    UnitState::Running { attempt, claim }
                }
            }
        })
    }
}
