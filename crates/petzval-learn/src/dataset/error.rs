//! Errors of a data set.

use std::path::PathBuf;

use petzval_base::{Cancelled, reason_and_hint};
use petzval_files::coco::CocoError;
use petzval_files::{ImageError, PictureSetError};

/// Why a data set cannot be used. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// A file is not a picture, or not labels, that this program can decode.
    #[error("{}", with_one_hint(.0))]
    Unreadable(#[from] ImageError),
    /// The folder or a file in it cannot be read.
    #[error("{}: cannot be read; check that it exists and may be read", path.display())]
    Io {
        /// The folder or file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// Pictures that cannot be listed.
    #[error(transparent)]
    Set(#[from] PictureSetError),
    /// A picture is not what it was.
    #[error(
        "{}: {name} is not what it was when this run read it first; put it back, or start a new run",
        path.display()
    )]
    Changed {
        /// Its file, or that of its shard.
        path: PathBuf,
        /// Its name.
        name: String,
    },
    /// The job was cancelled before all pictures were read.
    #[error("stopped before all pictures were read")]
    Stopped(#[from] Cancelled),
    /// A folder in COCO format cannot be read.
    #[error(transparent)]
    Coco(CocoError),
    /// The boxes of a folder are not enough to train and to score a detector.
    #[error("{}: {problem}; hint: {hint}", path.display())]
    Labels {
        /// The folder.
        path: PathBuf,
        /// What is missing.
        problem: String,
        /// What to do.
        hint: String,
    },
    /// Labels of pixels that cannot be used.
    #[error("{}: {problem}; hint: {hint}", path.display())]
    LabelImage {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong.
        problem: String,
        /// What to do.
        hint: String,
    },
    /// A folder holds no pictures.
    #[error("{}: no PNG, JPEG, TIFF, WebP or BMP file in this folder; name the folder that holds the pictures", path.display())]
    EmptyFolder {
        /// The folder.
        path: PathBuf,
    },
    /// A picture cannot hold the training window.
    #[error(
        "{name}: {width} x {height} pixels cannot hold a window of {needed} x {needed} (crop and margins); use larger pictures, or, for a \
         new run, a smaller `psf.grid` or a smaller crop: the larger of `training.crop` and `scoring.crop` counts"
    )]
    PhotoTooSmall {
        /// The picture.
        name: String,
        /// Its rows.
        height: usize,
        /// Its columns.
        width: usize,
        /// Side of the window that must fit.
        needed: usize,
    },
    /// The sensor cannot hold the crop.
    #[error(
        "sensor of {columns} x {rows} pixels cannot hold a crop of {crop} x {crop}; use a crop of 1 or more that fits"
    )]
    SensorTooSmall {
        /// Sensor rows.
        rows: usize,
        /// Sensor columns.
        columns: usize,
        /// Side of the crop.
        crop: usize,
    },
    /// A picture name of the split is not in the set.
    #[error(
        "{list} names {name:?}, which is not among the pictures ({known}); correct the name or add the file"
    )]
    UnknownName {
        /// `training` or `held_out`.
        list: &'static str,
        /// The unknown name.
        name: String,
        /// The names of all pictures, separated by commas.
        known: String,
    },
    /// Two pictures have one name.
    #[error("{name:?} occurs twice; every picture needs its own name and may stand in one list once")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// A picture is in both lists.
    #[error(
        "{name:?} is in both training and held_out; keep it in one, or the held-out result means nothing"
    )]
    InBothLists {
        /// The name.
        name: String,
    },
    /// A training picture and a held-out picture have different names and the same content.
    #[error(
        "{training:?} (training) and {held_out:?} (held_out) are the same picture; remove one, or the held-out result means nothing"
    )]
    SameContent {
        /// The name in the training list.
        training: String,
        /// The name in the held-out list.
        held_out: String,
    },
    /// A picture of a folder is the same as another one.
    #[error("{name} is the same picture as {first}")]
    Copy {
        /// The picture.
        name: String,
        /// The earlier one.
        first: String,
    },
    /// One side of the split is empty.
    #[error("{list} is empty; name at least one picture")]
    EmptyList {
        /// `training` or `held_out`.
        list: &'static str,
    },
}

/// The message of a file that cannot be read, with what to do about it in a set of pictures. Labels and pictures of wrong values keep their own hint.
fn with_one_hint(error: &ImageError) -> String {
    let text = error.to_string();
    match error {
        ImageError::NoLabels { .. } | ImageError::TooLarge { .. } | ImageError::NotFinite { .. } => text,
        ImageError::Io { .. } => format!("{text}; hint: check that it exists and may be read"),
        ImageError::Decode { .. } | ImageError::Empty { .. } | ImageError::Encode { .. } => {
            let (reason, _) = reason_and_hint(&text);
            format!(
                "{reason}; hint: use an undamaged PNG, JPEG, TIFF, WebP or BMP, or take it out of the set"
            )
        }
    }
}

impl From<CocoError> for DatasetError {
    fn from(error: CocoError) -> Self {
        match error {
            CocoError::Stopped(cancelled) => Self::Stopped(cancelled),
            error => Self::Coco(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_cannot_be_read_has_one_hint() {
        let [name, reason] = ["a.png", "it is damaged"].map(str::to_owned);
        let labels = ImageError::NoLabels { name: name.clone(), reason: reason.clone() };
        let said = labels.to_string();
        assert_eq!(DatasetError::from(labels).to_string(), said);
        let said = DatasetError::from(ImageError::Decode { name, reason }).to_string();
        assert!(said.contains("it is damaged; hint: use an undamaged PNG"), "{said}");
        assert_eq!(said.matches("hint: ").count(), 1, "{said}");
    }
}
