//! The files below a folder.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::{Cancel, FileError};

use crate::coco::bounded::read_bounded;
use crate::coco::error::CocoError;
use crate::encoding::{decode_strictly, decode_xml};

/// Levels of folders that are searched.
const DEEPEST: usize = 8;

/// Files that are listed. The largest data sets have a few million.
const MOST_FILES: usize = 10_000_000;

/// Largest file of the labels of one picture.
const LARGEST_LABELS: u64 = 16 << 20;

/// What to do about a larger one.
const LABELS_HINT: &str = "a file of labels is of one picture";

/// Endings of picture files.
const PICTURES: [&str; 7] = ["jpg", "jpeg", "png", "tif", "tiff", "bmp", "webp"];

/// The files below a folder, in the order of their paths. Hidden files are left out.
pub(super) fn files_below(root: &Path, cancel: &Cancel) -> Result<Vec<PathBuf>, CocoError> {
    let (mut found, mut open) = (Vec::new(), vec![(root.to_owned(), 0)]);
    while let Some((folder, depth)) = open.pop() {
        cancel.check()?;
        for entry in std::fs::read_dir(&folder).map_err(CocoError::io(&folder))? {
            let entry = entry.map_err(CocoError::io(&folder))?;
            let path = entry.path();
            if entry.file_name().as_encoded_bytes().starts_with(b".") {
                continue;
            }
            match path.is_dir() {
                true if depth < DEEPEST => open.push((path, depth + 1)),
                true => {
                    let reason = format!("folders are nested deeper than {DEEPEST} levels");
                    return Err(CocoError::content(&path, reason, "name the folder of the data set itself"));
                }
                false => found.push(path),
            }
        }
        if found.len() > MOST_FILES {
            let reason = format!("there are more than {MOST_FILES} files");
            return Err(CocoError::content(root, reason, "name the folder of the data set itself"));
        }
    }
    found.sort();
    Ok(found)
}

/// Whether a file has this ending.
pub(super) fn ends_with(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// Whether the name is that of a picture.
pub(super) fn is_picture(path: &Path) -> bool {
    PICTURES.iter().any(|ending| ends_with(path, ending))
}

/// The picture files among some.
pub(super) fn pictures_among(files: &[PathBuf]) -> impl DoubleEndedIterator<Item = &Path> {
    files.iter().map(PathBuf::as_path).filter(|path| is_picture(path))
}

/// The picture files among some, by a name.
pub(super) fn pictures_by(
    files: &[PathBuf],
    name: impl Fn(&Path) -> Option<&OsStr>,
) -> HashMap<&OsStr, &Path> {
    // The first of several files with one name is taken.
    pictures_among(files).rev().filter_map(|path| Some((name(path)?, path))).collect()
}

/// The part of a data set that a path names, such as `train`.
pub(super) fn split_of(path: &Path) -> Option<String> {
    let name = |part: std::path::Component| -> Option<String> {
        let part = part.as_os_str().to_str()?.to_ascii_lowercase();
        let stem = part.trim_end_matches(|c: char| c.is_ascii_digit());
        matches!(stem, "train" | "training" | "val" | "valid" | "validation" | "test" | "testing").then(
            || match stem {
                "training" => "train".to_owned(),
                "val" | "validation" => "valid".to_owned(),
                "testing" => "test".to_owned(),
                stem => stem.to_owned(),
            },
        )
    };
    path.components().rev().find_map(name)
}

/// The text of a file of labels. Fails where it is not text in UTF-8 or UTF-16.
pub(super) fn labels_text(path: &Path) -> Result<String, CocoError> {
    let bytes = read_bounded(path, LARGEST_LABELS, LABELS_HINT)?;
    decode_strictly(&bytes).map(|text| text.into_owned()).map_err(|error| CocoError::file(path, error))
}

/// The text of a file of labels in XML, in the encoding that it declares; as an inner error, why it is not such text.
pub(super) fn xml_text(path: &Path) -> Result<Result<String, FileError>, CocoError> {
    let bytes = read_bounded(path, LARGEST_LABELS, LABELS_HINT)?;
    Ok(decode_xml(&bytes).map(|text| text.into_owned()))
}
