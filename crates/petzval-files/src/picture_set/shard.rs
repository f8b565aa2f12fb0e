//! Pictures in a tar file, by the convention of WebDataset: files with one stem belong together.

use std::collections::BTreeMap;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

use tar::{Archive, EntryType};

use super::{PictureSetError, StoredPicture};
use crate::picture_file::PICTURE_ENDINGS;

/// The pictures of a shard in their order. The stem of a file is its path up to the first dot of its name. `0001.jpg` is a picture; `0001.json` and
/// `0001.seg.png` belong to it and are none.
///
/// Only the heads of members are read.
pub(super) fn pictures_of(path: &Path) -> Result<Vec<StoredPicture>, PictureSetError> {
    let wrong = |problem: String, hint| PictureSetError::Shard { path: path.to_owned(), problem, hint };
    let damaged = |error: std::io::Error| {
        let hint = "give an uncompressed tar file: members of a compressed one cannot be read one by one";
        wrong(format!("it cannot be read as a tar file ({error})"), hint)
    };
    let file = petzval_base::open_file(path).map_err(PictureSetError::io(path))?;
    let length = file.metadata().map_err(PictureSetError::io(path))?.len();
    let shard: Arc<Path> = path.into();
    let mut archive = Archive::new(BufReader::new(file));
    let mut found = Vec::new();
    let mut stems: BTreeMap<String, String> = BTreeMap::new();
    for entry in archive.entries_with_seek().map_err(damaged)? {
        let entry = entry.map_err(damaged)?;
        if !matches!(entry.header().entry_type(), EntryType::Regular | EntryType::Continuous) {
            continue;
        }
        let name = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
        let Some((stem, ending)) = stem_and_ending(&name) else { continue };
        if !PICTURE_ENDINGS.contains(&ending.to_lowercase().as_str()) {
            continue;
        }
        let (first, bytes) = (entry.raw_file_position(), entry.size());
        if first.saturating_add(bytes) > length {
            let hint = "copy the shard again: it is cut off";
            return Err(wrong(format!("it ends before its member {name:?} does"), hint));
        }
        if let Some(other) = stems.insert(stem.to_owned(), name.clone()) {
            let hint = "files of one stem are one sample, which has one picture";
            return Err(wrong(format!("{other:?} and {name:?} are two pictures of one stem"), hint));
        }
        found.push(StoredPicture::member(name, shard.clone(), first, bytes));
    }
    Ok(found)
}

/// The path up to the first dot of its file name, and what follows the dot. None for names that begin with a dot, as macOS writes beside each file.
fn stem_and_ending(name: &str) -> Option<(&str, &str)> {
    let start = name.rfind('/').map_or(0, |slash| slash + 1);
    let dot = name[start..].find('.').filter(|dot| *dot > 0)?;
    Some((&name[..start + dot], &name[start + dot + 1..]))
}
