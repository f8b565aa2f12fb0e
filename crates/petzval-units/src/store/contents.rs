//! The files of a result: which there are when the unit ends, and whether they are there still.

use std::io::{self, ErrorKind};
use std::path::Path;

use super::error::StoreError;
use super::record::{StoredFile, StoredResult};
use super::{PUT_BACK, Store};

/// Names that are no part of a result: a report or an evaluation of a run writes them again, and checkpoints serve to go on.
const LEFT_OUT: [&str; 7] =
    ["checkpoints", "report.html", "digests.json", "run.lock", "first-reads.jsonl", "device.json", "tuning"];

/// Folders in a folder of results that are looked into.
const DEPTH: usize = 64;

/// The number of the error ESTALE: another machine has replaced the file between two requests to the server.
const STALE: i32 = 116;

impl Store {
    /// The files below a folder of results, in the order of their paths. Hidden ones do not count. Fails with the system's errors.
    pub(super) fn contents(&self, folder: &Path) -> io::Result<Vec<StoredFile>> {
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
            match self.layer.size(&path) {
                Ok(bytes) => found.push(StoredFile { path: below, bytes, sha256: self.layer.digest(&path)? }),
                // A link to nothing, or a name that is not UTF-8.
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Sees that the files of a result are there with their sizes; if `reads_all`, with their contents. The error names the first that is not. The
    /// files of a result of an earlier build are believed.
    pub(super) fn check_contents(&self, result: &StoredResult, reads_all: bool) -> Result<(), StoreError> {
        let Some(folder) = self.files(result).filter(|_| !result.contents.is_empty()) else { return Ok(()) };
        // The record of the attempt says that it has ended after its files have come to their folder. Until that is visible, they may be under way.
        let record = self.attempt_record(&result.key, result.attempt);
        if record.is_ok_and(|record| record.is_none_or(|record| record.ended.is_none())) {
            return Ok(());
        }
        if !self.layer.is_folder(&folder) {
            let folder = self.folder(&result.key).join("files");
            return Err(StoreError::wrong(&folder, "the folder of the results is missing", PUT_BACK));
        }
        result.contents.iter().try_for_each(|file| self.check_file(&folder.join(&file.path), file, reads_all))
    }

    fn check_file(&self, path: &Path, file: &StoredFile, reads_all: bool) -> Result<(), StoreError> {
        let message = match self.layer.size(path) {
            Ok(bytes) if bytes != file.bytes => {
                format!("it has {bytes} bytes, and the unit wrote {}", file.bytes)
            }
            Ok(_) if !reads_all => return Ok(()),
            Ok(_) => {
                let sha256 = self.layer.digest(path).map_err(StoreError::io(path))?;
                if sha256 == file.sha256 {
                    return Ok(());
                }
                "its content is not what the unit wrote".to_owned()
            }
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                "this file of the result is missing".to_owned()
            }
            // It is there again at the next look.
            Err(error) if error.raw_os_error() == Some(STALE) => return Ok(()),
            Err(error) => return Err(StoreError::io(path)(error)),
        };
        Err(StoreError::wrong(path, message, PUT_BACK))
    }
}
