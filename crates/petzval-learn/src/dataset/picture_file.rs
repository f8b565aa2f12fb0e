//! A picture file as a run remembers it.

use std::io;
use std::path::Path;

use petzval_files::coco::content_digest;
use petzval_files::{Stamp, StoredPicture};
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
    /// SHA-256 of its content, hexadecimal; none in a large set, whose files are read when they are needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

impl PictureFile {
    /// Looks at a file and, if it `is_read`, reads it.
    pub fn of(path: &Path, name: &str, list: List, is_read: bool) -> Result<Self, DatasetError> {
        let digest = || content_digest(path);
        Self::with(Stamp::of(path), name, list, is_read.then_some(&digest), path)
    }

    /// The same of a picture of a set.
    pub fn stored(picture: &StoredPicture, list: List, is_read: bool) -> Result<Self, DatasetError> {
        let digest = || picture.digest().map(|digest| petzval_base::hex(&digest));
        Self::with(picture.stamp(), &picture.name, list, is_read.then_some(&digest), picture.path())
    }

    fn with(
        stamp: io::Result<Stamp>,
        name: &str,
        list: List,
        digest: Option<&dyn Fn() -> io::Result<String>>,
        path: &Path,
    ) -> Result<Self, DatasetError> {
        let failed = |source| DatasetError::Io { path: path.to_owned(), source };
        let Stamp { bytes, modified_s } = stamp.map_err(failed)?;
        let sha256 = digest.map(|digest| digest().map_err(failed)).transpose()?;
        Ok(Self { name: name.to_owned(), list, bytes, modified_s, sha256 })
    }
}
