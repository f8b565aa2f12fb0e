//! `data check` of photographs without annotations: a folder, a list, or tar shards.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use petzval_design::error::DesignError;
use petzval_files::coco::{DataSet, DefectKind, Defects, Image, Loaded, has_annotations};
use petzval_files::{CheckedPictures, StoredPicture, check_stored, digests_of_alike, stored_pictures};
use petzval_learn::dataset::DatasetError;

use super::warn_of_notes;
use crate::context::Context;
use crate::error::Result;
use crate::event::WarningKind;

/// Endings of files that usually hold labels.
const LABEL_ENDINGS: [&str; 3] = ["csv", "tsv", "xml"];

/// Least shorter side of a photograph, px, that holds a training window of the main job with its margins.
const LEAST_SIDE_PX: u32 = 126;

/// The photographs of a place: none where it has annotations, or no pictures either.
pub(super) fn photographs_of(place: &Path) -> Result<Option<Vec<StoredPicture>>> {
    let is_list = place.extension().is_some_and(|ending| {
        ["txt", "lst", "list", "tar"].iter().any(|known| ending.eq_ignore_ascii_case(known))
    });
    if has_annotations(place) || place.is_file() && !is_list || !place.exists() {
        return Ok(None);
    }
    match stored_pictures(place) {
        Ok(pictures) => Ok(Some(pictures)),
        // The message on annotations says what is missing in a folder without pictures.
        Err(_) if place.is_dir() => Ok(None),
        Err(error) => Err(DesignError::from(DatasetError::from(error)).into()),
    }
}

/// Decodes all photographs, and notes those that cannot be opened or decoded, those that are too small, and files of one content.
pub(super) fn checked(
    place: &Path,
    pictures: &[StoredPicture],
    remembered: &CheckedPictures,
    context: &Context,
) -> Result<Loaded> {
    let count = pictures.len() as u64;
    let watch = |done: usize| {
        if done > 0 {
            context.progress(done as u64, count, "pictures are decoded");
        }
        context.cancel().check()
    };
    warn_of_labels(place, context);
    let sizes = check_stored(pictures, remembered, &watch)?;
    warn_of_notes(remembered, context);
    let digests = digests(pictures, remembered, context)?;
    let (mut data, mut defects) = (DataSet::default(), Defects::default());
    let mut first: HashMap<String, &str> = HashMap::new();
    for (((id, picture), size), digest) in (0..).zip(pictures).zip(sizes).zip(digests) {
        let (width, height) = match size {
            Ok(size) => size,
            Err(unread) => {
                defects.add(DefectKind::of_unread(&unread), || unread.message.clone());
                continue;
            }
        };
        let side = width.min(height);
        if side < LEAST_SIDE_PX {
            let said = || format!("{}: {width} x {height} px", picture.name);
            defects.add_measured(DefectKind::SmallPicture, -f64::from(side), said);
        }
        if let Some(digest) = digest {
            match first.get(&digest) {
                Some(original) => {
                    defects.add(DefectKind::SamePicture, || format!("{original} and {}", picture.name))
                }
                None => drop(first.insert(digest, &picture.name)),
            }
        }
        data.images.push(Image { id, file_name: picture.name.clone(), width, height, ..Image::default() });
    }
    let folder = if place.is_dir() { place } else { place.parent().unwrap_or(Path::new("")) };
    Ok(Loaded { data, defects, file: place.to_owned(), folders: vec![folder.to_owned()] })
}

/// Warns of files in a folder and its own folders that may hold labels, which are not read.
fn warn_of_labels(place: &Path, context: &Context) {
    let inner = entries(place).into_iter().filter(|path| path.is_dir()).flat_map(|folder| entries(&folder));
    let is_label = |path: &PathBuf| {
        let ending = path.extension().unwrap_or_default();
        LABEL_ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known)) && path.is_file()
    };
    let mut found: Vec<PathBuf> = entries(place).into_iter().chain(inner).filter(is_label).collect();
    found.sort();
    let Some(first) = found.first() else { return };
    let (others, may) = match found.len() - 1 {
        0 => (String::new(), "may hold some and is not read"),
        1 => (" and another file".to_owned(), "may hold some and are not read"),
        n => (format!(" and {n} other files"), "may hold some and are not read"),
    };
    context.warning(
        WarningKind::DataSet,
        format!(
            "{}: taken as pictures without labels: {}{others} {may}; `petzval data convert` makes COCO annotations of KITTI, BDD100K, YOLO and \
             Pascal VOC, and others must be written as COCO first",
            place.display(),
            first.display()
        ),
    );
}

/// What a folder holds; nothing of what cannot be read.
fn entries(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect()
}

/// The digest of each picture that another one may equal.
fn digests(
    pictures: &[StoredPicture],
    remembered: &CheckedPictures,
    context: &Context,
) -> Result<Vec<Option<String>>> {
    let known: Vec<Option<String>> = pictures.iter().map(|picture| remembered.digest(picture)).collect();
    if known.iter().all(Option::is_some) {
        return Ok(known);
    }
    let pictures: Vec<Option<&StoredPicture>> = pictures.iter().map(Some).collect();
    Ok(digests_of_alike(&pictures, context.cancel())?
        .iter()
        .map(|digest| digest.as_ref().map(|digest| petzval_base::hex(digest)))
        .collect())
}
