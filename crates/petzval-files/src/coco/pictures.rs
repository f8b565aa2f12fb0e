//! Checks the picture files of a data set.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use petzval_base::Cancelled;
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::check::{check_entries, count_boxes};
use super::data_set::Image;
use super::defect::{DefectKind, Defects};
use super::folder::Loaded;
use super::turned::{BoxesOf, boxes_of, turned};
use crate::picture_file::{MOST_PICTURE_BYTES, PictureHead, decoded_head, picture_head};

/// What a second check of the values finds once sizes are known.
const NOTED_AGAIN: [DefectKind; 3] =
    [DefectKind::OutsidePicture, DefectKind::PictureOfLostLabels, DefectKind::ClippedBox];

/// Checks that the file of every picture exists, can be decoded from end to end, and has the stated size, and that no two have one content.
/// After every picture `watch` is called with the number of pictures that are decoded so far, by several threads at once.
///
/// Pictures for which this is not so are taken out with their boxes, and noted. A picture without a stated size gets that of its file. Of what is
/// left, pictures and classes without boxes are noted, and pictures with very many.
///
/// A picture with an EXIF orientation is turned upright. Its boxes are turned with it if the stated size is that of the stored pixels. If
/// the sizes do not decide it, the picture and its boxes are taken out.
///
/// All threads together take at most 2 GB of memory for files and decoded pictures.
///
/// `watch` is called with the number of pictures that are decoded, and its error ends the check; the data set is of no use then.
pub fn check_pictures(
    loaded: &mut Loaded,
    watch: &(dyn Fn(usize) -> Result<(), Cancelled> + Sync),
) -> Result<(), Cancelled> {
    let mut unusable = HashSet::new();
    let mut turning = HashMap::new();
    let mut is_clipping_due = false;
    let mut images = std::mem::take(&mut loaded.data.images);
    let with_boxes: HashSet<u64> = loaded.data.annotations.iter().map(|a| a.image_id).collect();
    let heads = decoded_heads(&images, loaded, watch)?;
    for (image, head) in images.iter_mut().zip(heads) {
        let name = image.file_name.clone();
        let stated = (image.width, image.height);
        let fault = match head {
            None => Some((DefectKind::MissingPicture, name)),
            Some(Err(error)) => Some((DefectKind::UnreadablePicture, error)),
            Some(Ok(head)) => {
                let is_stated = stated.0 > 0 && stated.1 > 0;
                (image.width, image.height) = head.upright();
                if !is_stated {
                    is_clipping_due = true;
                    loaded.defects.add(DefectKind::SizeNotStated, || name.clone());
                }
                let size = format!("{name}: {} x {} px", head.stored.0, head.stored.1);
                let says_turned = image.turned;
                image.turned = head.is_turned().then_some(true);
                match boxes_of(&head, says_turned, is_stated.then_some(stated)) {
                    BoxesOf::Upright => None,
                    BoxesOf::Stored => {
                        turning.insert(image.id, head);
                        loaded.defects.add(DefectKind::TurnedBoxes, || size);
                        None
                    }
                    BoxesOf::Unknown if !with_boxes.contains(&image.id) => None,
                    BoxesOf::Unknown => {
                        let exif = head.orientation.to_exif();
                        Some((DefectKind::UnknownTurn, format!("{size}, orientation {exif}")))
                    }
                    BoxesOf::Other => {
                        let (width, height) = head.upright();
                        let text =
                            format!("{name}: {width} x {height} px, stated {} x {}", stated.0, stated.1);
                        Some((DefectKind::OtherPictureSize, text))
                    }
                }
            }
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
    for annotation in &mut loaded.data.annotations {
        if let Some(head) = turning.get(&annotation.image_id) {
            annotation.bounds = turned(annotation.bounds, head);
            if let Some((bounds, _)) = &mut annotation.unclipped {
                *bounds = turned(*bounds, head);
            }
        }
    }
    // Boxes of pictures without a stated size were not clipped. A second check notes only what the first could not see.
    if is_clipping_due {
        let mut again = Defects::default();
        check_entries(&mut loaded.data, &mut again);
        loaded.defects.add_kinds(again, &NOTED_AGAIN);
    }
    if loaded.data.images.is_empty() && listed > 0 {
        loaded.defects.add(DefectKind::NoPicture, || format!("of {listed} listed pictures none is left"));
    }
    count_boxes(&loaded.data, &mut loaded.defects);
    Ok(())
}

/// The head of each picture, whose file is decoded as a whole, or why it cannot be; `None` where there is no file.
fn decoded_heads(
    images: &[Image],
    loaded: &Loaded,
    watch: &(dyn Fn(usize) -> Result<(), Cancelled> + Sync),
) -> Result<Vec<Option<Result<PictureHead, String>>>, Cancelled> {
    let paths: Vec<Option<PathBuf>> =
        images.par_iter().map(|image| loaded.picture(&image.file_name)).collect();
    // Some decoders read the whole file for its head.
    let length =
        |path: &Option<PathBuf>| path.as_ref().and_then(|p| p.metadata().ok()).map_or(0, |m| m.len());
    let lengths: Vec<u64> = paths.iter().map(length).collect();
    let heads = in_batches(&paths, &lengths, |path| {
        Ok(path.as_ref().map(|path| picture_head(path).map_err(|error| error.to_string())))
    })?;
    let bytes = |head: &Option<Result<PictureHead, String>>| match head {
        Some(Ok(head)) => head.reading_bytes(),
        _ => 0,
    };
    let bytes: Vec<u64> = heads.iter().map(bytes).collect();
    let decoded = AtomicUsize::new(0);
    let pictures: Vec<_> = paths.into_iter().zip(heads).collect();
    in_batches(&pictures, &bytes, |(path, head)| {
        let head = match (path, head) {
            (Some(path), Some(Ok(_))) => Some(decoded_head(path).map_err(|error| error.to_string())),
            (_, head) => head.clone(),
        };
        watch(decoded.fetch_add(1, Ordering::Relaxed) + 1)?;
        Ok(head)
    })
}

/// What a function makes of each value, on all threads; of so many at a time that they take at most [`MOST_PICTURE_BYTES`] together. Ends soon
/// after its first error.
fn in_batches<T: Sync, U: Send>(
    values: &[T],
    bytes: &[u64],
    make: impl Fn(&T) -> Result<U, Cancelled> + Sync,
) -> Result<Vec<U>, Cancelled> {
    let mut made = Vec::with_capacity(values.len());
    for batch in batches(bytes, MOST_PICTURE_BYTES) {
        made.extend(values[batch].par_iter().map(&make).collect::<Result<Vec<U>, Cancelled>>()?);
    }
    Ok(made)
}

/// Consecutive ranges of values whose sums are at most `most`; a larger value is a range of its own.
fn batches(values: &[u64], most: u64) -> Vec<Range<usize>> {
    let (mut ranges, mut first, mut sum) = (Vec::new(), 0, 0u64);
    for (i, value) in values.iter().enumerate() {
        if i > first && sum.saturating_add(*value) > most {
            ranges.push(first..i);
            (first, sum) = (i, 0);
        }
        sum = sum.saturating_add(*value);
    }
    ranges.push(first..values.len());
    ranges
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_keep_the_order_and_their_sums_below_the_limit() {
        let values = [5, 3, 2, 1, 12, 9, 1, 0, 0, 7];
        let ranges = batches(&values, 10);
        assert_eq!(ranges, [0..3, 3..4, 4..5, 5..9, 9..10]);
        assert_eq!(batches(&[], 10).iter().map(Range::len).collect::<Vec<_>>(), [0]);
    }
}
