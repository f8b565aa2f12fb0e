//! Checks the picture files of a data set.

use std::collections::{BTreeMap, HashSet};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::check::{check_entries, count_boxes};
use super::data_set::Image;
use super::defect::{DefectKind, Defects};
use super::folder::Loaded;
use crate::picture_file::decoded_size;

/// Checks that the file of every picture exists, can be decoded from end to end, and has the stated size, and that no two have one content.
/// After every picture `watch` is called with the number of pictures that are decoded so far, by several threads at once.
///
/// Pictures for which this is not so are taken out with their boxes, and noted. A picture without a stated size gets that of its file. Of what is
/// left, pictures and classes without boxes are noted, and pictures with very many.
pub fn check_pictures(loaded: &mut Loaded, watch: &(dyn Fn(usize) + Sync)) {
    let mut unusable = HashSet::new();
    let mut is_clipping_due = false;
    let mut images = std::mem::take(&mut loaded.data.images);
    let decoded = AtomicUsize::new(0);
    let size = |image: &Image| {
        let size = loaded.picture(&image.file_name).map(|path| decoded_size(&path));
        watch(decoded.fetch_add(1, Ordering::Relaxed) + 1);
        size
    };
    let sizes: Vec<_> = images.par_iter().map(size).collect();
    for (image, size) in images.iter_mut().zip(sizes) {
        let name = image.file_name.clone();
        let stated = (image.width, image.height);
        let fault = match size {
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
    let listed = images.len();
    images.retain(|image| !unusable.contains(&image.id));
    loaded.data.images = images;
    note_copies(loaded);
    loaded.data.annotations.retain(|annotation| !unusable.contains(&annotation.image_id));
    // Boxes of pictures without a stated size were not clipped. A second check notes only what the first could not see.
    if is_clipping_due {
        let mut again = Defects::default();
        check_entries(&mut loaded.data, &mut again);
        loaded.defects.add_kinds(again, &[DefectKind::OutsidePicture, DefectKind::ClippedBox]);
    }
    if loaded.data.images.is_empty() && listed > 0 {
        loaded.defects.add(DefectKind::NoPicture, || format!("of {listed} listed pictures none is left"));
    }
    count_boxes(&loaded.data, &mut loaded.defects);
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
                // Entries of one file are noted by their names.
                Some(original) if *original == name => {}
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
