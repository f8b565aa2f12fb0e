//! What is wrong with a store.

use std::io;
use std::path::{Path, PathBuf};

use petzval_jobs::{Fault, JobError};

/// The number of the error ESTALE: another machine has replaced the file between two requests to the server.
const STALE: i32 = 116;

/// Whether a file was replaced by another machine between two requests to the server. It is there again at the next look.
pub(super) fn is_stale(error: &io::Error) -> bool {
    error.raw_os_error() == Some(STALE)
}

/// What is wrong with a store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// A file or folder of the store cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The folder is no store, or one of another version.
    #[error("{}: {message}", path.display())]
    Wrong {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong.
        message: String,
        /// What to do.
        hint: String,
    },
}

impl StoreError {
    /// Makes an error of the system one of a path.
    pub(crate) fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    /// A file of a store that holds what it should not.
    pub(crate) fn wrong(path: &Path, message: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Wrong { path: path.to_owned(), message: message.into(), hint: hint.into() }
    }
}

impl From<StoreError> for JobError {
    fn from(error: StoreError) -> Self {
        let message = format!("store: {error}");
        match error {
            StoreError::Wrong { hint, .. } => Self::input(message, hint),
            StoreError::Io { source, .. } => match source.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::failed(format!(
                    "{message}; make room and run the same command again: every unit goes on from its last checkpoint"
                )),
                io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => {
                    Self::input(message, "name a store that this process may write to")
                }
                _ => Self::failed(format!("{message}; run the same command again: no unit is lost")),
            },
        }
    }
}

/// Whether an error of [`run_all`](super::run_all) is one of a disk or a file server alone: the same command goes on once it works again. One that is
/// read-only is none: somebody has to name another store.
pub fn may_pass(error: &JobError) -> bool {
    error.fault() == Fault::Job && is_of_the_disk(&error.to_string())
}

/// Whether a message of a job is about a disk or a file server, not about the unit: running it again elsewhere or later may succeed.
///
/// Jobs pass errors of the system on as text, which ends in its number: ENOSPC, EROFS, EDQUOT, ESTALE, EIO; and of a file server that does not answer
/// ENOTCONN, ETIMEDOUT, EHOSTDOWN, EHOSTUNREACH.
pub(crate) fn is_of_the_disk(message: &str) -> bool {
    [28, 30, 122, STALE, 5, 107, 110, 112, 113]
        .iter()
        .any(|number| message.contains(&format!("(os error {number})")))
}
