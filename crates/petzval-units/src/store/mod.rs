//! A store of results by content, which processes of several machines share without locks.
//!
//! `STORE/KEY/` is the folder of a unit:
//!
//! | name | holds |
//! |---|---|
//! | `unit.json` | the unit with the digests of its inputs |
//! | `claim-0001.json` | who makes the first attempt; made exclusively, never changed |
//! | `attempt-0001.json` | how many times its claim was renewed, and how it ended |
//! | `log-0001.jsonl` | its events, one a line |
//! | `work-0001/` | its files: the checkpoint, and in the end the results |
//! | `error.json` | why the last failed attempt failed |
//! | `files/` | the results of the attempt that finished |
//! | `contents-0001.json` | sizes and digests of the files of the results of an attempt, with a digest of its own; made before `result.json` |
//! | `result.json` | the result with a digest of its content; written last, exclusively |
//!
//! Attempts are numbered. Whoever makes the claim of the next number has the unit, so that no claim is ever removed and no two processes take
//! over the same one. A claim is stale if its process is known to be gone, or if it has not changed for [`STALE_AFTER`] by the clock of the
//! process that looks at it. Each attempt works in a folder of its own, so that two at once do no harm: the first `result.json` counts.

mod attempt;
mod clock;
mod contents;
mod error;
mod gather;
mod layer;
mod log;
mod record;
mod runner;
mod state;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use self::error::is_stale;
use self::record::{AttemptRecord, StoreRecord, UnitRecord, is_as_written};
use crate::unit::{Key, PROGRAM, Prepared, Unit};

pub use attempt::{Attempt, Begun};
pub use clock::{Clock, SystemClock};
pub use error::{StoreError, may_pass};
pub use gather::{Joined, gather_tolerances, parts_of};
pub use layer::{Disk, FileLayer};
pub use petzval_design::run::Holder;
pub use record::{Claim, Cost, Failure, STORE_FORMAT, StoredResult};
pub use runner::{Damage, Outcome, RunOptions, Summary, run_all, run_unit};
pub use state::{Seen, State, UnitState};

/// How often a claim is renewed.
pub const RENEWED_EVERY: Duration = Duration::from_secs(10);

/// How long a claim may stay unchanged before its process counts as gone.
pub const STALE_AFTER: Duration = Duration::from_secs(300);

/// How long a file may take to become visible after it was made elsewhere.
const VISIBLE_WITHIN: Duration = Duration::from_secs(90);

/// The file that makes a folder a store.
pub(crate) const STORE: &str = "store.json";

/// What to do where a result is not what its unit wrote.
const PUT_BACK: &str =
    "put it back from a copy, or run the unit again with --retry, which sets its folder aside";

/// A store of results.
#[derive(Clone)]
pub struct Store {
    root: PathBuf,
    layer: Arc<dyn FileLayer>,
    clock: Arc<dyn Clock>,
}

impl Store {
    /// Opens a store, which is made if the folder is not there or empty. Fails if the folder holds something else, or results of another version.
    pub fn open_or_new(root: &Path) -> Result<Self, StoreError> {
        Self::on(root, Arc::new(Disk), Arc::new(SystemClock::default()))
    }

    /// Opens a store that is there.
    pub fn open(root: &Path) -> Result<Self, StoreError> {
        if !root.join(STORE).is_file() {
            let hint = "give the folder that `petzval unit run` had as --store";
            return Err(StoreError::wrong(root, "this is no store of units: it has no store.json", hint));
        }
        Self::open_or_new(root)
    }

    /// A store on a file layer and a clock of its own.
    pub fn on(root: &Path, layer: Arc<dyn FileLayer>, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        let root = std::path::absolute(root).map_err(StoreError::io(root))?;
        // What counts is the nearest part of the path that is there.
        if let Some(file) = root.ancestors().find(|part| part.exists()).filter(|part| !part.is_dir()) {
            let hint = "give the folder of a store; it is made if it does not exist";
            return Err(StoreError::wrong(file, "this is a file", hint));
        }
        let store = Self { root, layer, clock };
        let path = store.root.join(STORE);
        let own = StoreRecord { format: STORE_FORMAT, program: PROGRAM.to_owned() };
        if store.read_if_there::<StoreRecord>(&path)?.is_none() {
            store.layer.make_folder(&store.root).map_err(StoreError::io(&store.root))?;
            let names = store.layer.list(&store.root).map_err(StoreError::io(&store.root))?;
            // Another process may be making the store at this moment.
            if names
                .iter()
                .any(|name| name != STORE && !name.starts_with('.') && name.parse::<Key>().is_err())
            {
                let hint = "name an empty folder, or one that is not there yet";
                return Err(StoreError::wrong(
                    &store.root,
                    "this folder holds something else than a store",
                    hint,
                ));
            }
            store.layer.publish(&path, to_json(&own, &path)?.as_bytes()).map_err(StoreError::io(&path))?;
        }
        let there: StoreRecord = store.read_late(&path)?;
        if there != own {
            let StoreRecord { format, program } = there;
            let message = format!(
                "this store is of Petzval {program}, format {format}, and this program is Petzval {PROGRAM}, format {STORE_FORMAT}"
            );
            let hint = "use that version, or another store: results of two versions are not mixed";
            return Err(StoreError::wrong(&path, message, hint));
        }
        Ok(store)
    }

    /// Its folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The folder of a unit.
    pub fn folder(&self, key: &Key) -> PathBuf {
        self.root.join(key.as_str())
    }

    /// The keys of all units that were ever begun here, sorted.
    pub fn keys(&self) -> Result<Vec<Key>, StoreError> {
        let names = self.layer.list(&self.root).map_err(StoreError::io(&self.root))?;
        let mut keys: Vec<Key> = names.iter().filter_map(|name| name.parse().ok()).collect();
        keys.sort();
        Ok(keys)
    }

    /// The unit of a key; none if it is not there, or not visible yet.
    pub fn unit(&self, key: &Key) -> Result<Option<Unit>, StoreError> {
        let record: Option<UnitRecord> = self.read_if_there(&self.folder(key).join("unit.json"))?;
        Ok(record.map(|record| record.unit))
    }

    /// The result of a unit; none if it has none yet. Fails if it was edited, or is that of another unit.
    pub fn result(&self, key: &Key) -> Result<Option<StoredResult>, StoreError> {
        let path = self.result_file(key);
        let Some(result) = self.read_as_written::<StoredResult>(&path)? else { return Ok(None) };
        // A file that was copied by hand: its figures are those of other values.
        if result.key != *key {
            let (name, short) = (&result.unit.name, result.key.short());
            let message = format!("this is the result of another unit, \"{name}\" with the key {short}");
            let hint = "run the unit again with --retry, which sets its folder aside";
            return Err(StoreError::wrong(&path, message, hint));
        }
        Ok(Some(result))
    }

    /// The folder of the results of a unit; none if its job wrote nothing.
    pub fn files(&self, result: &StoredResult) -> Option<PathBuf> {
        let folder = self.folder(&result.key);
        let (named, renamed) = (folder.join(result.files.as_ref()?), folder.join("files"));
        Some(if self.layer.is_folder(&renamed) { renamed } else { named })
    }

    fn result_file(&self, key: &Key) -> PathBuf {
        self.folder(key).join("result.json")
    }

    fn claim_file(&self, key: &Key, number: u32) -> PathBuf {
        self.folder(key).join(format!("claim-{number:04}.json"))
    }

    fn attempt_file(&self, key: &Key, number: u32) -> PathBuf {
        self.folder(key).join(format!("attempt-{number:04}.json"))
    }

    fn log_file(&self, key: &Key, number: u32) -> PathBuf {
        self.folder(key).join(format!("log-{number:04}.jsonl"))
    }

    fn contents_file(&self, key: &Key, number: u32) -> PathBuf {
        self.folder(key).join(format!("contents-{number:04}.json"))
    }

    fn work_folder(&self, key: &Key, number: u32) -> PathBuf {
        self.folder(key).join(format!("work-{number:04}"))
    }

    fn attempt_record(&self, key: &Key, number: u32) -> Result<Option<AttemptRecord>, StoreError> {
        self.read_if_there(&self.attempt_file(key, number))
    }

    /// Keeps what the folder of a unit is about.
    fn keep_unit(&self, prepared: &Prepared) -> Result<(), StoreError> {
        let path = self.folder(&prepared.key).join("unit.json");
        let record = UnitRecord { unit: prepared.unit.clone(), inputs: prepared.inputs.clone() };
        let text = to_json(&record, &path)?;
        self.layer.create(&path, text.as_bytes()).map_err(StoreError::io(&path)).map(|_| ())
    }

    /// The value in a file; none if there is no such file.
    fn read_if_there<T: DeserializeOwned>(&self, path: &Path) -> Result<Option<T>, StoreError> {
        self.bytes_if_there(path)?.map(|bytes| self.parse(&bytes, path)).transpose()
    }

    /// The value in a file that has a digest of its content; none if there is no such file. Fails if the file was edited.
    fn read_as_written<T: DeserializeOwned>(&self, path: &Path) -> Result<Option<T>, StoreError> {
        let Some(bytes) = self.bytes_if_there(path)? else { return Ok(None) };
        // The digest is that of the file. A value may add fields that have a default.
        let written: Value = self.parse(&bytes, path)?;
        if !is_as_written(&written) {
            let message = "this is not what the unit wrote: its content does not agree with its `sha256`";
            return Err(StoreError::wrong(path, message, PUT_BACK));
        }
        self.parse(&bytes, path).map(Some)
    }

    /// The content of a file; none if there is no such file.
    fn bytes_if_there(&self, path: &Path) -> Result<Option<Vec<u8>>, StoreError> {
        match self.layer.read(path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == ErrorKind::NotFound || is_stale(&error) => Ok(None),
            Err(error) => Err(StoreError::io(path)(error)),
        }
    }

    /// The value in the content of a file.
    fn parse<T: DeserializeOwned>(&self, bytes: &[u8], path: &Path) -> Result<T, StoreError> {
        serde_json::from_slice(bytes).map_err(|e| {
            let remedy = if path.parent() == Some(self.root.as_path()) {
                format!(
                    "write {{\"format\": {STORE_FORMAT}, \"program\": \"{PROGRAM}\"}} there if this version made the results"
                )
            } else {
                "run the unit again with --retry, which sets its folder aside".to_owned()
            };
            let hint = format!("it was changed since it was written, or another version wrote it; {remedy}");
            StoreError::wrong(path, e.to_string(), hint)
        })
    }

    /// The value in a file that is there, though it may not be visible yet.
    fn read_late<T: DeserializeOwned>(&self, path: &Path) -> Result<T, StoreError> {
        let first = self.clock.now();
        loop {
            if let Some(value) = self.read_if_there(path)? {
                return Ok(value);
            }
            if self.clock.now() - first > VISIBLE_WITHIN {
                let message =
                    format!("the file was made, but is not visible after {} s", VISIBLE_WITHIN.as_secs());
                return Err(StoreError::wrong(path, message, "look whether this file system works"));
            }
            self.clock.wait(Duration::from_secs(1));
        }
    }
}

/// A value as indented JSON.
fn to_json(of: &impl Serialize, path: &Path) -> Result<String, StoreError> {
    serde_json::to_string_pretty(of).map_err(|e| StoreError::wrong(path, e.to_string(), ""))
}
