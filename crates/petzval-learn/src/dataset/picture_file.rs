//! A picture file as a run remembers it.

use std::path::Path;
use std::time::UNIX_EPOCH;

use petzval_files::coco::content_digest;
use serde::{Deserialize, Serialize};

use super::{DatasetError, List};

/// A picture file: its name, size, time and content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PictureFile {
    /// Its name in the folder or data set.
    pub name: String,
    /// What it is for.
    pub list: List,
    /// Its size, bytes.
    pub bytes: u64,
    /// Time of the last change, seconds since 1970; none if the system does not report it.
    pub modified_s: Option<u64>,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
}

impl PictureFile {
    /// Looks at a file and reads it.
    pub fn read(path: &Path, name: &str, list: List) -> Result<Self, DatasetError> {
        let failed = |source| DatasetError::Io { path: path.to_owned(), source };
        let about = path.metadata().map_err(failed)?;
        let since_1970 = about.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        Ok(Self {
            name: name.to_owned(),
            list,
            bytes: about.len(),
            modified_s: since_1970.map(|since| since.as_secs()),
            sha256: content_digest(path).map_err(failed)?,
        })
    }
}
