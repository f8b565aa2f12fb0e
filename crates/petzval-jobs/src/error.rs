//! Why a job ends without a response.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use petzval_base::{FileError, LONGEST_NAME, write_whole};
use petzval_camera::isp::IspError;
use petzval_design::error::DesignError;
use petzval_files::raw_file::RawFileError;
use petzval_files::{ImageError, decode};

/// Who has to change something before the job can succeed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The user: the request or a file is wrong.
    Input,
    /// Nobody: the request was proper, and the job failed.
    Job,
}

/// Why a job ends without a response.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// A setting of the request has a value that cannot be used.
    #[error("{key} {value}: {message}")]
    Setting {
        /// Field of the request, in snake case.
        key: &'static str,
        /// Its value as text; empty where it is not worth repeating.
        value: String,
        /// What is wrong.
        message: String,
        /// What to give instead.
        hint: String,
    },
    /// The request, or something that it names, cannot be used.
    #[error("{message}")]
    Input {
        /// What is wrong.
        message: String,
        /// What to do instead; may be empty.
        hint: String,
    },
    /// A place in a file is wrong.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong in it, where, and a hint.
        error: Box<FileError>,
    },
    /// The request was proper, and the job failed.
    #[error("{0}")]
    Failed(String),
    /// The job was cancelled before it had a result.
    #[error("{0}")]
    Stopped(String),
}

impl JobError {
    /// A setting with a value that cannot be used; the value may be empty.
    pub fn setting(
        key: &'static str,
        value: impl std::fmt::Display,
        message: impl Into<String>,
        hint: impl Into<String>,
    ) -> Self {
        Self::Setting { key, value: value.to_string(), message: message.into(), hint: hint.into() }
    }

    /// A request that cannot be used.
    pub fn input(message: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Input { message: message.into(), hint: hint.into() }
    }

    /// A job that failed though the request was proper.
    pub fn failed(message: impl Into<String>) -> Self {
        Self::Failed(message.into())
    }

    /// A file that could not be read or written. A full disk is nobody's mistake; everything else is one of the request.
    pub fn system(message: impl Into<String>, error: &std::io::Error, hint: &str) -> Self {
        match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Self::failed(message),
            _ => Self::input(message, hint),
        }
    }

    /// Who has to change something.
    pub fn fault(&self) -> Fault {
        match self {
            Self::Failed(_) | Self::Stopped(_) => Fault::Job,
            Self::Setting { .. } | Self::Input { .. } | Self::File { .. } => Fault::Input,
        }
    }
}

impl From<DesignError> for JobError {
    fn from(error: DesignError) -> Self {
        match error {
            DesignError::Input { path, error } => Self::File { path, error },
            DesignError::Isp(IspError::Stopped(_)) => Self::Stopped(error.to_string()),
            DesignError::Image(ImageError::Io { ref source, .. }) => {
                Self::system(error.to_string(), source, "give a PNG, JPEG or TIFF file that exists")
            }
            // What has no end, or is far too large to be read, was named by the request. What the system says of a file too large is about
            // one that was being written.
            DesignError::Io { error: ref why, .. }
                if why.raw_os_error().is_none()
                    && matches!(why.kind(), ErrorKind::InvalidInput | ErrorKind::FileTooLarge) =>
            {
                Self::input(error.to_string(), "")
            }
            DesignError::Io { error: ref why, .. }
                if matches!(
                    why.kind(),
                    ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge
                ) =>
            {
                Self::failed(format!(
                    "{error}; make room: a run goes on from its last checkpoint with --resume"
                ))
            }
            _ if error.is_input() => Self::input(error.to_string(), ""),
            _ => Self::failed(error.to_string()),
        }
    }
}

impl From<RawFileError> for JobError {
    fn from(error: RawFileError) -> Self {
        match error {
            RawFileError::Sidecar { path, error } => Self::File { path, error },
            RawFileError::Content { path, reason, hint } => {
                Self::input(format!("{}: {reason}", path.display()), hint)
            }
            RawFileError::Io { ref source, .. } => {
                let hint = "give a file that can be read, or a place that can be written";
                Self::system(error.to_string(), source, hint)
            }
        }
    }
}

/// Bytes of the largest file of which an error shows a line.
const LARGEST_SHOWN: u64 = 64 << 20;

/// The text of a file that an error names, to show the line; `None` if it cannot be read, or is very large.
pub fn text_of_file(path: &Path) -> Option<String> {
    petzval_base::read_at_most(path, LARGEST_SHOWN).ok().map(|bytes| decode(&bytes).into_owned())
}

/// Writes a file wholly or not at all.
pub(crate) fn write_file(path: &Path, contents: impl AsRef<[u8]>) -> Result<(), JobError> {
    Ok(write_whole(path, contents.as_ref()).map_err(DesignError::io(path))?)
}

/// Makes the folder for results, with its parents. A name at which none can be made is a mistake of the request.
pub(crate) fn make_folder(path: &Path) -> Result<(), JobError> {
    let wrong = |message: String| {
        JobError::setting("out", path.display(), message, "give a folder; it is made if it does not exist")
    };
    if path.exists() && !path.is_dir() {
        return Err(wrong("this is a file".to_owned()));
    }
    check_length(path)?;
    std::fs::create_dir_all(path).map_err(|e| wrong(e.to_string()))
}

/// Bytes of the longest path that systems take, with room for the names of files in a folder of results.
const LONGEST_PATH: usize = 3900;

/// Fails if a name or a path is longer than file systems hold. A folder that does not exist yet would fail only when it is made.
pub(crate) fn check_length(path: &Path) -> Result<(), JobError> {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let bytes = whole.as_os_str().len();
    let longest = whole.components().map(|part| part.as_os_str().len()).max().unwrap_or(0);
    let (message, hint) = if longest > LONGEST_NAME {
        let message = format!("a name of {longest} bytes is too long: file systems hold {LONGEST_NAME}");
        (message, "give a shorter name")
    } else if bytes > LONGEST_PATH {
        (format!("the path of {bytes} bytes is too long"), "give a place with a shorter path")
    } else {
        return Ok(());
    };
    Err(JobError::input(format!("{}: {message}", path.display()), hint))
}

/// A value as indented JSON, with the keys of its objects in alphabetical order.
pub fn json(value: &impl serde::Serialize) -> Result<String, JobError> {
    let text = || serde_json::to_string_pretty(&serde_json::to_value(value)?);
    text().map_err(|e: serde_json::Error| JobError::failed(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_no_file_system_holds_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(check_length(&folder.path().join("a".repeat(LONGEST_NAME))).is_ok());
        let long = check_length(&folder.path().join("ä".repeat(128))).unwrap_err().to_string();
        assert!(long.contains("256 bytes"), "{long}");
        let deep = ["a"; 2000].join("/");
        assert!(check_length(Path::new(&deep)).unwrap_err().to_string().contains("path"));
    }
}
