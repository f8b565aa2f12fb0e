//! Pictures of a folder, of a list or of tar shards: which there are, and where. No picture is decoded.

mod checked;
mod copies;
mod error;
mod list;
mod part_of_file;
mod places;
mod shard;
mod stored;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

pub(crate) use checked::checked_heads;
pub use checked::{
    CheckedPicture, CheckedPictures, CheckedSize, FoundPictures, UnreadPicture, check_stored,
    check_stored_up_to,
};
pub use copies::digests_of_alike;
pub use error::PictureSetError;
pub(crate) use places::Places;
pub use stored::{Stamp, StoredPicture, hex_digest};

use crate::picture_file::PICTURE_ENDINGS;

/// Ending of a shard.
const SHARD: &str = "tar";

/// The pictures of a place, each with a name of its own, in an order that depends on names alone but for lists, which state it.
///
/// | place | pictures | names |
/// |---|---|---|
/// | a folder | its pictures (PNG, JPEG, TIFF, WebP, BMP, by their endings), without subfolders; broken links, too, which cannot be read | file names |
/// | a folder without pictures and with `.tar` files | those of all its shards | `SHARD.tar/NAME` |
/// | a `.tar` file | its pictures, see [`StoredPicture`] | paths in it |
/// | another file | one path a line, from the folder of the list; empty lines and those that begin with `#` do not count | the paths as written |
///
/// Fails on a place without pictures, on a list that names a file which is not there or names one twice, also in two spellings, and on a file that is
/// no tar file.
pub fn stored_pictures(place: &Path) -> Result<Vec<StoredPicture>, PictureSetError> {
    let found = if place.is_dir() {
        let files = files_with(place, &PICTURE_ENDINGS)?;
        let shards = if files.is_empty() { files_with(place, &[SHARD])? } else { Vec::new() };
        let mut found: Vec<StoredPicture> = files.into_iter().map(StoredPicture::file).collect();
        for path in &shards {
            let shard = path.file_name().unwrap_or_default().to_string_lossy();
            let members = shard::pictures_of(path)?.into_iter();
            found.extend(members.map(|picture| picture.named(format!("{shard}/{}", picture.name))));
        }
        found
    } else if has_ending(place, &[SHARD]) {
        shard::pictures_of(place)?
    } else {
        list::pictures_of(place)?
    };
    if found.is_empty() {
        return Err(PictureSetError::Empty { path: place.to_owned() });
    }
    let mut names = BTreeSet::new();
    match found.iter().find(|picture| !names.insert(picture.name.as_str())) {
        Some(twice) => {
            let (path, name) = (place.to_owned(), twice.name.clone());
            Err(PictureSetError::Twice { path, name })
        }
        None => Ok(found),
    }
}

/// The files of a folder with one of these endings, sorted.
fn files_with(folder: &Path, endings: &[&str]) -> Result<Vec<PathBuf>, PictureSetError> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(PictureSetError::io(folder))? {
        let entry = entry.map_err(PictureSetError::io(folder))?;
        let path = entry.path();
        if has_ending(&path, endings) && is_file(&entry) {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// Whether an entry of a folder is a file, or a link to one. A link that cannot be followed is one that cannot be read.
fn is_file(entry: &std::fs::DirEntry) -> bool {
    match entry.file_type() {
        Ok(kind) if kind.is_symlink() => entry.path().metadata().map_or(true, |about| about.is_file()),
        Ok(kind) => kind.is_file(),
        Err(_) => false,
    }
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    ending.is_some_and(|ending| endings.contains(&ending.as_str()))
}

#[cfg(test)]
mod tests;
