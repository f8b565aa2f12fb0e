//! An attempt at a unit: how it is begun, kept alive, and ended.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use cpu_time::ProcessTime;
use petzval_base::Cancel;
use petzval_base::simd::{level, widest};
use petzval_jobs::ErrorReport;
use serde_json::Value;

use super::error::StoreError;
use super::record::{AttemptRecord, Claim, Cost, Ended, Failure, STORE_FORMAT, StoredResult};
use super::state::{Other, Seen, UnitState};
use super::{Store, to_json};
use crate::unit::{Key, Prepared};
use petzval_design::run::{Holder, date};

/// What became of the beginning of a unit.
pub enum Begun {
    /// This process has it.
    Mine(Box<Attempt>),
    /// It has a result.
    Done(Box<StoredResult>),
    /// It has failed, and may not be run again.
    Failed(Box<Failure>),
    /// Another process works on it.
    Elsewhere(Option<Claim>),
    /// A file of its folder is damaged.
    Damaged(Box<ErrorReport>),
    /// It was cancelled while the files of its result were read.
    Cancelled,
}

/// What a process does at a unit.
enum Next {
    /// It begins the attempt of this number.
    Begin(u32),
    /// It leaves the unit as it is.
    Leave(Begun),
}

/// Attempts of a unit after which it counts as failed: something ends every process that begins it.
const MOST_ATTEMPTS: u32 = 200;

impl Store {
    /// Begins a unit, unless it has ended or another process has it. One that failed is begun again if `retries`; one whose folder is damaged as well,
    /// and the folder is set aside. If two processes retry a failed unit, one runs it, and its failure is that of both.
    ///
    /// The files of a result are compared by their sizes; if `retries`, all are read, and `cancel` ends that between two of them.
    ///
    /// `seen` remembers what claims of others were seen; a process keeps it for as long as it looks.
    pub fn begin(
        &self,
        prepared: &Prepared,
        holder: &Holder,
        retries: bool,
        seen: &mut Seen,
        cancel: &Cancel,
    ) -> Result<Begun, StoreError> {
        let key = &prepared.key;
        let number = match self.next_attempt(key, retries, seen, cancel)? {
            Next::Begin(number) => number,
            Next::Leave(begun) => return Ok(begun),
        };
        let folder = self.folder(key);
        self.layer.make_folder(&folder).map_err(StoreError::io(&folder))?;
        if number == 1 {
            self.keep_unit(prepared)?;
        }
        let (path, claim) = (self.claim_file(key, number), Claim { holder: holder.clone(), began: now() });
        let text = to_json(&claim, &path)?;
        if !self.layer.create(&path, text.as_bytes()).map_err(StoreError::io(&path))? {
            // Another process was faster; its claim may not be visible yet.
            seen.note_other(key, number, self.clock.now());
            return Ok(Begun::Elsewhere(self.read_if_there(&path)?));
        }
        let mut attempt = Attempt {
            store: self.clone(),
            prepared: prepared.clone(),
            number,
            claim,
            record: AttemptRecord::default(),
            began: self.clock.now(),
            cpu: ProcessTime::now(),
            cpu_before: 0.0,
            disk_stops: 0,
        };
        for earlier in 1..number {
            let Some(record) = self.attempt_record(key, earlier)? else { continue };
            attempt.cpu_before += record.cpu_seconds;
            attempt.disk_stops += u32::from(record.ended == Some(Ended::StoppedByDisk));
        }
        if number > MOST_ATTEMPTS {
            let message = format!("{MOST_ATTEMPTS} processes were killed while they worked on it");
            let hint = "look at its logs; it may need more memory than a process may have";
            let error = ErrorReport {
                kind: "failed".to_owned(),
                message,
                place: None,
                hint: hint.to_owned(),
                stopped: None,
            };
            return attempt.fail(error).map(|failure| Begun::Failed(Box::new(failure)));
        }
        attempt.write_record()?;
        // A result may have come since the first look.
        if let Some(result) = self.result(key)? {
            attempt.end(Ended::Superfluous)?;
            return Ok(Begun::Done(Box::new(result)));
        }
        Ok(Begun::Mine(Box::new(attempt)))
    }

    /// What this process does at a unit.
    fn next_attempt(
        &self,
        key: &Key,
        retries: bool,
        seen: &mut Seen,
        cancel: &Cancel,
    ) -> Result<Next, StoreError> {
        // Before the look at the unit: what another process sets aside after that look has this name.
        let aside = retries.then(|| self.name_aside(key));
        let state = match self.state(key, seen)? {
            UnitState::Done(result) if retries => match self.read_in_full(result, seen, cancel)? {
                Some(state) => state,
                None => return Ok(Next::Leave(Begun::Cancelled)),
            },
            other => other,
        };
        let now = self.clock.now();
        Ok(match state {
            UnitState::Done(result) => Next::Leave(Begun::Done(result)),
            UnitState::Running { attempt, claim } => {
                seen.note_other(key, attempt, now);
                Next::Leave(Begun::Elsewhere(claim))
            }
            UnitState::Failed(failure) if !retries || seen.has_failed_since(key, failure.attempt) => {
                Next::Leave(Begun::Failed(failure))
            }
            UnitState::Failed(failure) => match seen.other(key, failure.attempt, now) {
                Other::Unseen => Next::Begin(failure.attempt + 1),
                Other::MayRun => Next::Leave(Begun::Elsewhere(None)),
                Other::Ended => Next::Leave(Begun::Failed(failure)),
            },
            UnitState::Damaged(error) => match (aside, seen.other(key, 0, now)) {
                (None, _) | (_, Other::Ended) => Next::Leave(Begun::Damaged(error)),
                (_, Other::MayRun) => Next::Leave(Begun::Elsewhere(None)),
                (Some(aside), Other::Unseen) if self.set_aside(key, &aside)? => Next::Begin(1),
                (Some(_), Other::Unseen) => {
                    seen.note_other(key, 1, now);
                    Next::Leave(Begun::Elsewhere(None))
                }
            },
            UnitState::Waiting => Next::Begin(1),
            UnitState::Stopped { attempt } | UnitState::Stale { attempt, .. } => Next::Begin(attempt + 1),
        })
    }

    /// A name for the folder of a damaged unit that is none of a unit, and that no folder has.
    fn name_aside(&self, key: &Key) -> PathBuf {
        let aside = |number: u32| self.root().join(format!(".damaged-{}-{number}", key.as_str()));
        let mut number = 1;
        while self.layer.is_folder(&aside(number)) {
            number += 1;
        }
        aside(number)
    }

    /// Gives the folder of a damaged unit another name, so that what is in it can be looked at. Returns `false` if another process has done so: a
    /// folder never takes the place of one with files, so the folder of a new attempt stays where it is.
    fn set_aside(&self, key: &Key, aside: &Path) -> Result<bool, StoreError> {
        let folder = self.folder(key);
        match self.layer.rename_folder(&folder, aside) {
            Ok(()) => Ok(true),
            Err(error) => match error.kind() {
                ErrorKind::AlreadyExists | ErrorKind::DirectoryNotEmpty | ErrorKind::NotFound => Ok(false),
                _ => Err(StoreError::io(&folder)(error)),
            },
        }
    }
}

/// An attempt of this process at a unit.
pub struct Attempt {
    store: Store,
    prepared: Prepared,
    number: u32,
    claim: Claim,
    record: AttemptRecord,
    began: Duration,
    cpu: ProcessTime,
    /// CPU seconds of earlier attempts.
    cpu_before: f64,
    /// Earlier attempts that a fault of the disk has stopped.
    disk_stops: u32,
}

impl Attempt {
    /// The unit.
    pub fn prepared(&self) -> &Prepared {
        &self.prepared
    }

    /// Its number, from 1.
    pub fn number(&self) -> u32 {
        self.number
    }

    /// Earlier attempts that ended before the unit did, without those that a fault of the disk has stopped.
    pub fn stops_before(&self) -> u32 {
        self.number - 1 - self.disk_stops
    }

    /// CPU seconds of earlier attempts.
    pub fn cpu_seconds_before(&self) -> f64 {
        self.cpu_before
    }

    /// The folder for its files.
    pub fn folder(&self) -> PathBuf {
        self.store.work_folder(self.key(), self.number)
    }

    /// The file of its events.
    pub fn log(&self) -> PathBuf {
        self.store.log_file(self.key(), self.number)
    }

    fn key(&self) -> &Key {
        &self.prepared.key
    }

    /// Folders of earlier attempts that may hold a checkpoint, the newest first, and whether nobody can be working there any more.
    pub fn earlier(&self) -> Result<Vec<(PathBuf, bool)>, StoreError> {
        let mut found = Vec::new();
        for number in (1..self.number).rev() {
            let folder = self.store.work_folder(self.key(), number);
            if self.store.layer.is_folder(&folder) {
                let has_ended = self
                    .store
                    .attempt_record(self.key(), number)?
                    .is_some_and(|record| record.ended.is_some());
                found.push((folder, has_ended));
            }
        }
        Ok(found)
    }

    /// Takes over what an earlier attempt has left: its folder where it has ended, else a copy, since its process may still live.
    pub fn take_over(&self, earlier: &Path, has_ended: bool) -> Result<(), StoreError> {
        let own = self.folder();
        let layer = &self.store.layer;
        layer.remove_folder(&own).map_err(StoreError::io(&own))?;
        let taken =
            if has_ended { layer.rename_folder(earlier, &own) } else { layer.copy_folder(earlier, &own) };
        taken.map_err(StoreError::io(&own))
    }

    /// Empties the folder.
    pub fn clear(&self) -> Result<(), StoreError> {
        let own = self.folder();
        self.store.layer.remove_folder(&own).map_err(StoreError::io(&own))
    }

    /// Renews the claim. Returns the claim of another process that took the unit over, as it saw no renewal for too long.
    pub fn renew(&mut self) -> Result<Option<Claim>, StoreError> {
        self.record.renewed += 1;
        self.write_record()?;
        self.store.read_if_there(&self.store.claim_file(self.key(), self.number + 1))
    }

    fn write_record(&mut self) -> Result<(), StoreError> {
        self.record.seconds = self.seconds();
        self.record.cpu_seconds = self.cpu.elapsed().as_secs_f64();
        let path = self.store.attempt_file(self.key(), self.number);
        let text = to_json(&self.record, &path)?;
        self.store.layer.replace(&path, text.as_bytes()).map_err(StoreError::io(&path))
    }

    fn seconds(&self) -> f64 {
        (self.store.clock.now() - self.began).as_secs_f64()
    }

    fn cost(&self) -> Cost {
        let cpu_seconds = self.cpu.elapsed().as_secs_f64();
        Cost {
            holder: self.claim.holder.clone(),
            began: self.claim.began.clone(),
            seconds: self.seconds(),
            cpu_seconds,
            all_cpu_seconds: self.cpu_before + cpu_seconds,
            peak_memory_mb: peak_memory_mb(),
            threads: rayon::current_num_threads(),
            simd: level().to_owned(),
            widest_simd: widest().to_owned(),
        }
    }

    /// Keeps the list of its files, all of which are read: for the end of the work, while the claim is still renewed. Without it the files of the result
    /// are believed. Fails if the store cannot be read or written.
    pub fn keep_contents(&self) -> Result<(), StoreError> {
        self.store.keep_contents(self.key(), self.number)
    }

    /// Ends with a response. The first result of a unit counts, and is returned; the files of all others are removed.
    pub fn finish(mut self, response: Value) -> Result<StoredResult, StoreError> {
        let (store, key) = (self.store.clone(), self.key().clone());
        let own = self.folder();
        let has_files = store.has_files(&own);
        let path = store.result_file(&key);
        let result = StoredResult {
            format: STORE_FORMAT,
            unit: self.prepared.unit.clone(),
            key: key.clone(),
            inputs: self.prepared.inputs.clone(),
            attempt: self.number,
            response,
            files: has_files.then(|| own.file_name().map(PathBuf::from)).flatten(),
            cost: self.cost(),
            sha256: None,
        };
        let result = result.with_digest().map_err(|e| StoreError::wrong(&path, e.to_string(), ""))?;
        let text = to_json(&result, &path)?;
        let published = store.layer.publish(&path, text.as_bytes()).map_err(StoreError::io(&path));
        if published.is_err() {
            // Others need not wait until the claim is stale. A disk that is full may not even take this.
            let _unended = self.end(Ended::StoppedByDisk);
        }
        if !published? {
            let first: StoredResult = store.read_late(&path)?;
            if first.attempt != self.number {
                self.clear()?;
                self.end(Ended::Superfluous)?;
            }
            return Ok(first);
        }
        // The result counts from here on: what fails now is untidy, and nothing else.
        let files = store.folder(&key).join("files");
        // Files of an earlier result that was taken away are of no result.
        let _gone = store.layer.remove_folder(&files);
        let _tidied =
            if has_files { store.layer.rename_folder(&own, &files) } else { store.layer.remove_folder(&own) };
        for number in (1..=self.number).filter(|number| *number != self.number) {
            let _stays = store.layer.remove_folder(&store.work_folder(&key, number));
        }
        let _unknown = self.end(Ended::Finished);
        Ok(result)
    }

    /// Ends before the result. Anyone may go on from what the folder holds.
    pub fn stop(mut self) -> Result<(), StoreError> {
        self.end(Ended::Stopped)
    }

    /// Ends as [`Attempt::stop`] does, by a fault of the disk.
    pub fn stop_by_disk(mut self) -> Result<(), StoreError> {
        self.end(Ended::StoppedByDisk)
    }

    /// Ends with an error of the unit, which is not run again by itself.
    pub fn fail(mut self, error: ErrorReport) -> Result<Failure, StoreError> {
        let failure =
            Failure { unit: self.prepared.unit.name.clone(), attempt: self.number, error, cost: self.cost() };
        let path = self.store.folder(self.key()).join("error.json");
        let text = to_json(&failure, &path)?;
        self.store.layer.replace(&path, text.as_bytes()).map_err(StoreError::io(&path))?;
        self.end(Ended::Failed(Box::new(failure.clone())))?;
        Ok(failure)
    }

    fn end(&mut self, how: Ended) -> Result<(), StoreError> {
        self.record.ended = Some(how);
        self.write_record()
    }
}

/// Most memory that this process held since [`forget_peak`], MB.
fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kilobytes * 1024.0 / 1e6)
}

/// Makes the system count the most memory of this process anew.
pub(super) fn forget_peak() {
    // Where it cannot, the peak is that of all units so far.
    let _kept = std::fs::write("/proc/self/clear_refs", "5");
}

/// The time of day, as text.
fn now() -> String {
    date(SystemTime::now())
}
