//! Why the pictures of a place cannot be listed.

use std::path::{Path, PathBuf};

/// Why the pictures of a place cannot be listed. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum PictureSetError {
    /// The place, or a file in it, cannot be read.
    #[error("{}: cannot be read; check that it exists and may be read", path.display())]
    Io {
        /// The folder or file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// There is no picture.
    #[error(
        "{}: no PNG, JPEG, TIFF, WebP or BMP file in it; name a folder of pictures or of .tar shards, a shard, or a list with one path a line",
        path.display()
    )]
    Empty {
        /// The place.
        path: PathBuf,
    },
    /// The place is a picture itself.
    #[error("{}: this is one picture; name its folder, a .tar shard of pictures, or a list with one path a line", path.display())]
    Picture {
        /// The picture.
        path: PathBuf,
    },
    /// Two pictures have one name.
    #[error("{}: {name:?} is there twice; every picture needs its own name", path.display())]
    Twice {
        /// The place.
        path: PathBuf,
        /// The name.
        name: String,
    },
    /// Two names of a list mean one file.
    #[error("{}: {first:?} and {name:?} are one file; hint: name every picture once", path.display())]
    OneFile {
        /// The list.
        path: PathBuf,
        /// The first name.
        first: String,
        /// The other name.
        name: String,
    },
    /// A line of a list.
    #[error("{} line {line}: {value:?} {problem}; hint: one path of a picture a line, from the folder of the list", path.display())]
    Line {
        /// The list.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What it says.
        value: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A shard.
    #[error("{}: {problem}; hint: {hint}", path.display())]
    Shard {
        /// The tar file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
        /// What to do.
        hint: &'static str,
    },
}

impl PictureSetError {
    /// A failure of the system at a path.
    pub(super) fn io(path: &Path) -> impl Fn(std::io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}
