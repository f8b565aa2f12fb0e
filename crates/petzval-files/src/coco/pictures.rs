//! Checks the picture files of a data set.

use std::collections::{BTreeMap, HashSet};
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::check::check_values;
use super::defect::{DefectKind, Defects};
use super::folder::Loaded;
use crate::picture_file::{CUT_OFF, ImageError, is_cut_off, picture_size};

/// Checks that the file of every picture exists, is of a kind that is read, is whole, and has the stated size, and that no two have one content.
/// Files are read from end to end; only those of OpenEXR are decoded.
///
/// Pictures for which this is not so are taken out with their boxes, and noted. A picture without a stated size gets that of its file.
pub fn check_pictures(loaded: &mut Loaded) {
    let mut unusable = HashSet::new();
    let mut is_clipping_due = false;
    let mut images = std::mem::take(&mut loaded.data.images);
    for image in &mut images {
        let name = image.file_name.clone();
        let stated = (image.width, image.height);
        let fault = match loaded.picture(&name).map(|path| size_of_whole(&path)) {
            None => Some((DefectKind::MissingPicture, name)),
            Some(Err(error)) => Some((DefectKind::UnreadablePicture, error.to_string())),
            Some(Ok(found)) if stated.0 == 0 || stated.1 == 0 => {
                (image.width, image.height) = found;
                is_clipping_due = true;
                loaded.defects.add(DefectKind::SizeNotStated, || name);
                None
            }
            Some(Ok(found)) if found != stated => {
                let text =
                    format!("{name}: {} x {} px, stated {} x {}", found.0, found.1, stated.0, stated.1);
                Some((DefectKind::OtherPictureSize, text))
            }
            Some(Ok(_)) => None,
        };
        if let Some((kind, text)) = fault {
            unusable.insert(image.id);
            loaded.defects.add(kind, || text);
        }
    }
    images.retain(|image| !unusable.contains(&image.id));
    loaded.data.images = images;
    note_copies(loaded);
    loaded.data.annotations.retain(|annotation| !unusable.contains(&annotation.image_id));
    // Boxes of pictures without a stated size were not clipped. A second check notes only what the first could not see.
    if is_clipping_due {
        let mut again = Defects::default();
        check_values(&mut loaded.data, &mut again);
        loaded.defects.add_kinds(again, &[DefectKind::OutsidePicture, DefectKind::ClippedBox]);
    }
}

/// Columns and rows of a picture whose file is not cut off.
fn size_of_whole(path: &Path) -> Result<(u32, u32), ImageError> {
    let size = picture_size(path)?;
    let bytes =
        petzval_base::read_whole(path).map_err(|source| ImageError::Io { path: path.to_owned(), source })?;
    match is_cut_off(&bytes) {
        true => Err(ImageError::Decode { name: path.display().to_string(), reason: CUT_OFF.to_owned() }),
        false => Ok(size),
    }
}

/// Notes pictures whose files have the content of an earlier one.
fn note_copies(loaded: &mut Loaded) {
    let mut by_length: BTreeMap<u64, Vec<(&str, PathBuf)>> = BTreeMap::new();
    for image in &loaded.data.images {
        let Some(path) = loaded.picture(&image.file_name) else { continue };
        let Ok(file) = path.metadata() else { continue };
        by_length.entry(file.len()).or_default().push((&image.file_name, path));
    }
    for files in by_length.into_values().filter(|files| files.len() > 1) {
        let mut first: BTreeMap<String, &str> = BTreeMap::new();
        for (name, path) in files {
            let Ok(digest) = content_digest(&path) else { continue };
            match first.get(&digest) {
                Some(original) => {
                    loaded.defects.add(DefectKind::SamePicture, || format!("{original} and {name}"))
                }
                None => drop(first.insert(digest, name)),
            }
        }
    }
}

/// The SHA-256 of the content of a file, hexadecimal.
pub fn content_digest(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    io::copy(&mut petzval_base::open_file(path)?, &mut hash)?;
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}
