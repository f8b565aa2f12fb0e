//! The files of a result: which there are when the unit ends, and whether they are there still.

use std::io::{self, ErrorKind};
use std::path::Path;
use std::time::Duration;

use petzval_base::Cancel;

use super::error::{StoreError, is_stale};
use super::record::{Claim, ContentsRecord, StoredFile, StoredResult};
use super::state::Seen;
use super::{PUT_BACK, Store, VISIBLE_WITHIN, to_json};
use crate::unit::Key;

/// Names that are no part of a result: a report or an evaluation of a run writes them again, and checkpoints serve to go on.
const LEFT_OUT: [&str; 7] =
    ["checkpoints", "report.html", "digests.json", "run.lock", "first-reads.jsonl", "device.json", "tuning"];

/// Folders in a folder of results that are looked into.
const DEPTH: usize = 64;

/// How long a process waits before it looks again whether files have become visible.
const LOOK_AGAIN: Duration = Duration::from_secs(1);

impl Store {
    /// Whether there is anything in the folder of an attempt.
    pub(super) fn has_files(&self, folder: &Path) -> bool {
        self.layer.list(folder).is_ok_and(|names| !names.is_empty())
    }

    /// Keeps the list of the files of an attempt, all of which are read. Does nothing if there are none. Fails if the store cannot be read or written.
    pub(super) fn keep_contents(&self, key: &Key, number: u32) -> Result<(), StoreError> {
        let own = self.work_folder(key, number);
        if !self.has_files(&own) {
            return Ok(());
        }
        let files = self.contents(&own).map_err(StoreError::io(&own))?;
        let path = self.contents_file(key, number);
        let record = ContentsRecord::new(files).map_err(|e| StoreError::wrong(&path, e.to_string(), ""))?;
        let text = to_json(&record, &path)?;
        self.layer.publish(&path, text.as_bytes()).map_err(StoreError::io(&path)).map(|_| ())
    }

    /// The files below a folder of results, in the order of their paths. Hidden ones do not count. Fails with the system's errors.
    fn contents(&self, folder: &Path) -> io::Result<Vec<StoredFile>> {
        let mut found = Vec::new();
        self.collect(folder, "", DEPTH, &mut found)?;
        found.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(found)
    }

    fn collect(
        &self,
        folder: &Path,
        below: &str,
        depth: usize,
        found: &mut Vec<StoredFile>,
    ) -> io::Result<()> {
        for name in self.layer.list(folder)? {
            if name.starts_with('.') || LEFT_OUT.contains(&name.as_str()) {
                continue;
            }
            let path = folder.join(&name);
            let below = if below.is_empty() { name } else { format!("{below}/{name}") };
            if self.layer.is_folder(&path) {
                if depth > 0 {
                    self.collect(&path, &below, depth - 1, found)?;
                }
                continue;
            }
            let sized = self.layer.size(&path);
            match sized.and_then(|bytes| Ok((bytes, self.layer.digest(&path)?))) {
                Ok((bytes, sha256)) => found.push(StoredFile { path: below, bytes, sha256 }),
                // A link to nothing, or a name that is not UTF-8.
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Sees that the files of a result are there with their sizes, once they have had time to become visible. The error names the first that is not.
    /// The files of a result without a list, as an earlier build wrote it, are believed.
    pub(super) fn check_sizes(&self, result: &StoredResult, seen: &mut Seen) -> Result<(), StoreError> {
        if !self.has_settled(result, seen)? {
            return Ok(());
        }
        self.check_files(result, |path, file| self.check_file(path, file, false)).map(|_| ())
    }

    /// As [`Store::check_sizes`], with the contents; waits until the files have had time to become visible. Looks at `cancel` between two files.
    /// Returns `false` if it was cancelled.
    pub(super) fn check_contents(
        &self,
        result: &StoredResult,
        seen: &mut Seen,
        cancel: &Cancel,
    ) -> Result<bool, StoreError> {
        while !self.has_settled(result, seen)? {
            if cancel.is_set() {
                return Ok(false);
            }
            self.clock.wait(LOOK_AGAIN);
        }
        let check = |path: &Path, file: &StoredFile| {
            if cancel.is_set() { Ok(false) } else { self.check_file(path, file, true) }
        };
        self.check_files(result, check)
    }

    /// Whether the files of a result have come to their folder, as far as this process can see. The attempt then says that it has ended. If its process
    /// was killed before it could, it is known to be gone, or the result has been seen for [`VISIBLE_WITHIN`].
    fn has_settled(&self, result: &StoredResult, seen: &mut Seen) -> Result<bool, StoreError> {
        let (key, number) = (&result.key, result.attempt);
        // A record that is damaged says nothing, and does not keep the files from being looked at.
        let record = self.attempt_record(key, number);
        let is_open = record.is_ok_and(|record| record.is_none_or(|record| record.ended.is_none()));
        if result.files.is_none() || !is_open {
            return Ok(true);
        }
        let shown = seen.shown(result, self.clock.now());
        let claim: Option<Claim> = self.read_if_there(&self.claim_file(key, number))?;
        Ok(shown > VISIBLE_WITHIN || claim.is_some_and(|claim| claim.holder.is_gone()))
    }

    /// Looks at the files of a result in their order, until `check` fails or returns `false`. Returns whether it came to the end.
    fn check_files(
        &self,
        result: &StoredResult,
        check: impl Fn(&Path, &StoredFile) -> Result<bool, StoreError>,
    ) -> Result<bool, StoreError> {
        let Some(folder) = self.files(result) else { return Ok(true) };
        let path = self.contents_file(&result.key, result.attempt);
        let Some(record) = self.read_as_written::<ContentsRecord>(&path)? else { return Ok(true) };
        if record.files.is_empty() {
            return Ok(true);
        }
        if !self.layer.is_folder(&folder) {
            let folder = self.folder(&result.key).join("files");
            return Err(StoreError::wrong(&folder, "the folder of the results is missing", PUT_BACK));
        }
        for file in &record.files {
            if !check(&folder.join(&file.path), file)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Sees that a file has its size; if `reads_all`, its content. Returns `true`, or an error that says what it has.
    fn check_file(&self, path: &Path, file: &StoredFile, reads_all: bool) -> Result<bool, StoreError> {
        let sized = self.layer.size(path);
        let found = sized.and_then(|bytes| {
            let is_read = reads_all && bytes == file.bytes;
            Ok((bytes, is_read.then(|| self.layer.digest(path)).transpose()?))
        });
        let message = match found {
            Ok((bytes, _)) if bytes != file.bytes => {
                format!("it has {bytes} bytes, and the unit wrote {}", file.bytes)
            }
            Ok((_, Some(sha256))) if sha256 != file.sha256 => {
                "its content is not what the unit wrote".to_owned()
            }
            Ok(_) => return Ok(true),
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                "this file of the result is missing".to_owned()
            }
            Err(error) if is_stale(&error) => return Ok(true),
            Err(error) => return Err(StoreError::io(path)(error)),
        };
        Err(StoreError::wrong(path, message, PUT_BACK))
    }
}
