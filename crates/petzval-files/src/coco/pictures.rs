//! Checks the picture files of a data set.

use std::collections::{HashMap, HashSet};
use std::io;
use std::path::Path;

use petzval_base::{Cancel, Cancelled};
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::check::{check_entries, check_form, count_boxes};
use super::data_set::Image;
use super::defect::{DefectKind, Defects};
use super::folder::Loaded;
use super::turned::{BoxesOf, boxes_of, turned};
use crate::picture_file::PictureHead;
use crate::picture_set::{CheckedPictures, StoredPicture, checked_heads, digests_of_alike};

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
/// `watch` is called with the number of pictures that are decoded, 0 before each head, and its error ends the check; the data set is of no use then.
pub fn check_pictures(
    loaded: &mut Loaded,
    watch: &(dyn Fn(usize) -> Result<(), Cancelled> + Sync),
) -> Result<(), Cancelled> {
    let how = PictureCheck { most_light_bytes: u64::MAX, remembered: &CheckedPictures::default() };
    check_pictures_by(loaded, &how, watch).map(|_| ())
}

/// How pictures are checked.
#[derive(Clone, Copy, Debug)]
pub struct PictureCheck<'a> {
    /// Bytes of light up to which all pictures are decoded. Of a larger set only the heads of files are read.
    pub most_light_bytes: u64,
    /// Pictures that were decoded before, which are not decoded again.
    pub remembered: &'a CheckedPictures,
}

/// [`check_pictures`] by other means. Says whether all pictures were decoded.
pub fn check_pictures_by(
    loaded: &mut Loaded,
    how: &PictureCheck,
    watch: &(dyn Fn(usize) -> Result<(), Cancelled> + Sync),
) -> Result<bool, Cancelled> {
    let mut unusable = HashSet::new();
    let mut turning = HashMap::new();
    let mut is_clipping_due = false;
    let mut images = std::mem::take(&mut loaded.data.images);
    let with_boxes: HashSet<u64> = loaded.data.annotations.iter().map(|a| a.image_id).collect();
    let picture = |image: &Image| loaded.picture(&image.file_name).map(StoredPicture::file);
    let pictures: Vec<Option<StoredPicture>> = images.par_iter().map(picture).collect();
    let (heads, are_decoded) = checked_heads(&pictures, how.most_light_bytes, how.remembered, watch)?;
    for (image, head) in images.iter_mut().zip(heads) {
        let name = image.file_name.clone();
        let stated = (image.width, image.height);
        let fault = match head {
            None => Some((DefectKind::MissingPicture, name)),
            Some(Err(unread)) => Some((DefectKind::of_unread(&unread), unread.message)),
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
                        let ((width, height), of) = match says_turned {
                            Some(false) if head.is_turned() => {
                                (head.stored, " as stored (`turned` is false)")
                            }
                            _ => (head.upright(), ""),
                        };
                        let text =
                            format!("{name}: {width} x {height} px{of}, stated {} x {}", stated.0, stated.1);
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
    note_copies(loaded, how.remembered);
    loaded.data.annotations.retain(|annotation| !unusable.contains(&annotation.image_id));
    // Sizes that the file does not state show corners. What the first check found is found again.
    if is_clipping_due && loaded.check_form().is_ok() {
        let mut form = Defects::default();
        let labelled_size = |image: &Image| {
            turning.get(&image.id).map_or((image.width, image.height), |head: &PictureHead| head.stored)
        };
        check_form(&loaded.data, labelled_size, &mut form);
        loaded.defects.add_kinds(form, &[DefectKind::CornerBoxes, DefectKind::ShareBoxes]);
    }
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
    Ok(are_decoded)
}

/// Notes pictures whose files have the content of an earlier one. Of those whose digest is not known, files of one length whose first and last
/// bytes agree are read.
fn note_copies(loaded: &mut Loaded, remembered: &CheckedPictures) {
    let stored: Vec<(&str, StoredPicture, Option<String>)> = (loaded.data.images.par_iter())
        .filter_map(|image| {
            let picture = StoredPicture::file(loaded.picture(&image.file_name)?);
            let digest = remembered.digest(&picture);
            Some((image.file_name.as_str(), picture, digest))
        })
        .collect();
    let are_known = stored.iter().all(|(_, _, digest)| digest.is_some());
    let digests: Vec<Option<String>> = if are_known {
        stored.iter().map(|(_, _, digest)| digest.clone()).collect()
    } else {
        let pictures: Vec<Option<&StoredPicture>> =
            stored.iter().map(|(_, picture, _)| Some(picture)).collect();
        // It takes seconds, and is not stopped.
        let Ok(digests) = digests_of_alike(&pictures, &Cancel::default()) else { return };
        digests.iter().map(|digest| digest.as_ref().map(|digest| petzval_base::hex(digest))).collect()
    };
    let mut first: HashMap<String, &str> = HashMap::new();
    let mut copies = Vec::new();
    for ((name, ..), digest) in stored.iter().zip(digests) {
        let Some(digest) = digest else { continue };
        match first.get(&digest) {
            // Entries of one file are noted by their names.
            Some(original) if original == name => {}
            Some(original) => copies.push(format!("{original} and {name}")),
            None => drop(first.insert(digest, name)),
        }
    }
    copies.into_iter().for_each(|both| loaded.defects.add(DefectKind::SamePicture, || both));
}

/// The SHA-256 of the content of a file, hexadecimal.
pub fn content_digest(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    io::copy(&mut petzval_base::open_file(path)?, &mut hash)?;
    Ok(petzval_base::hex(&hash.finalize()))
}
