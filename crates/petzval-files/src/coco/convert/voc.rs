//! Pascal VOC: an XML file for each picture.
//!
//! `annotation/object` has `name`, `bndbox` (`xmin`, `ymin`, `xmax`, `ymax`: pixels counted from 1, both ends included), `difficult`, `truncated`,
//! `occluded` and `pose`. <http://host.robots.ox.ac.uk/pascal/VOC/voc2012/htmldoc/>. Difficult objects are to be ignored.
//!
//! Two further forms are rotated boxes. They become the upright boxes around them. roLabelImg has `robndbox` in place of `bndbox`, with
//! `cx`, `cy`, `w`, `h` in pixels and `angle` in radians. CVAT has the attribute `rotation` (`attributes/attribute` with `name` and
//! `value`): the angle in degrees by which the box is rotated about its middle. Further attributes of that kind become attributes. Parts of
//! a person, actions, outlines and other elements are not read; they are counted.

use std::collections::{HashMap, HashSet};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use petzval_base::Cancel;

use super::builder::{Builder, Converted, Label};
use super::tree::{
    ListedParts, Pictures, ends_with, files_below, is_picture, labels_text, pictures_among, split_of,
    xml_text,
};
use super::voc_file::{Labels, Object, parse};
use crate::coco::defect::{DefectKind, Defects};
use crate::coco::error::CocoError;

/// Reads a folder with `Annotations/*.xml` and `JPEGImages/`, or with XML files beside the pictures.
pub(super) fn convert(root: &Path, turned: Option<bool>, cancel: &Cancel) -> Result<Converted, CocoError> {
    let files = files_below(root, cancel)?;
    let labels: Vec<&PathBuf> = files.iter().filter(|path| ends_with(path, "xml")).collect();
    if labels.is_empty() {
        let hint = "name the folder that holds `Annotations` and `JPEGImages`";
        return Err(CocoError::content(root, "there is no XML file", hint));
    }
    let pictures = Pictures::among(root, &files);
    let mut builder = Builder::new(turned);
    let splits = splits(&files, &pictures, &mut builder.defects)?;
    let mut labels_of: HashMap<&Path, &Path> = HashMap::new();
    for path in labels {
        cancel.check()?;
        let read = xml_text(path)?.and_then(|text| parse(&text));
        let Some(read) = builder.understood(path, read) else { continue };
        // Names of pictures are not always kept up to date; the name of the labels is.
        let stem = path.file_stem().unwrap_or(OsStr::new(""));
        let stated = Path::new(read.file_name.as_deref().unwrap_or(""));
        let found = pictures.by_stem(stem, path, stated).or(|| pictures.by_name(path, stated));
        let place = || format!("no picture for {}", path.display());
        let Some(picture) = found.noted(&place, &mut builder.defects) else { continue };
        // Labels may have another name than their picture.
        let mut names = [Some(stem), picture.file_stem()].into_iter().flatten();
        let listed = names.find_map(|name| splits.get(name)).map(str::to_owned);
        let split = listed.or_else(|| split_of(picture.strip_prefix(root).unwrap_or(picture)));
        let Some(image) = builder.picture(root, picture, split) else { continue };
        let id = image.id;
        if let Some(first) = labels_of.insert(picture, path) {
            let said = || format!("{} and {}: {}", first.display(), path.display(), picture.display());
            builder.defects.add(DefectKind::RepeatedFile, said);
        }
        let Labels { size, objects, unread, .. } = read;
        if let Some(size) = size {
            builder.stated(id, size);
        }
        unread.iter().for_each(|field| builder.unread(field));
        for Object { class, bounds, is_rotated, is_difficult, attributes } in objects {
            // Further out it is an overhang.
            let begins_at_zero = [bounds.x, bounds.y].iter().any(|edge| (-1.0..0.0).contains(edge));
            if begins_at_zero && !is_rotated {
                builder.defects.add(DefectKind::CountedFromZero, || format!("{}: {class}", path.display()));
            }
            if is_rotated {
                builder.defects.add(DefectKind::RotatedBox, || format!("{}: {class}", path.display()));
            }
            builder.object(id, Label { ignore: is_difficult, attributes, ..Label::new(&class, bounds) });
        }
    }
    builder.note_unlabelled(pictures_among(&files));
    builder.finish("Pascal VOC")
}

/// The parts of the lists of `ImageSets/Main`, in the order in which they count.
const LISTS: [&str; 3] = ["test", "valid", "train"];

/// The part of the data set of each picture, by its name without ending, from `ImageSets/Main/train.txt`, `val.txt`, `test.txt` and `trainval.txt`.
/// A picture of `trainval` that no list of one part names is for training, or for validation where only `train` has a list.
fn splits(
    files: &[PathBuf],
    pictures: &Pictures,
    defects: &mut Defects,
) -> Result<ListedParts<OsString>, CocoError> {
    let mut lists: Vec<(&str, &PathBuf)> = Vec::new();
    let mut of_both: Vec<&PathBuf> = Vec::new();
    for path in files.iter().filter(|path| path.parent().is_some_and(|p| p.ends_with("ImageSets/Main"))) {
        // Lists of single classes, `car_train.txt`, have another stem.
        let stem = path.file_stem().unwrap_or(OsStr::new(""));
        if stem.eq_ignore_ascii_case("trainval") {
            of_both.push(path);
        }
        let part = split_of(Path::new(stem));
        lists.extend(LISTS.iter().find(|known| part.as_deref() == Some(**known)).map(|part| (*part, path)));
    }
    let has = |part: &str| lists.iter().any(|(known, _)| *known == part);
    let rest = if has("train") && !has("valid") { "valid" } else { "train" };
    let mut parts = ListedParts::default();
    // Lists name pictures, or their labels where these have another name.
    let labels: HashSet<&OsStr> =
        files.iter().filter(|path| ends_with(path, "xml")).filter_map(|path| path.file_stem()).collect();
    let is_there = |stem: &OsStr| pictures.has_stem(stem) || labels.contains(stem);
    let order = |part: &str| LISTS.iter().position(|known| *known == part);
    lists.sort_by_key(|(part, _)| order(part));
    for (part, path, is_of_both) in (lists.iter().map(|(part, path)| (*part, *path, false)))
        .chain(of_both.into_iter().map(|path| (rest, path, true)))
    {
        for (number, line) in (1..).zip(labels_text(path)?.lines()) {
            let Some(name) = line.split_whitespace().next() else { continue };
            // Some lists have names with their ending.
            let stem = match Path::new(name) {
                whole if is_picture(whole) && !is_there(OsStr::new(name)) => whole.file_stem(),
                _ => Some(OsStr::new(name)),
            };
            let stem = stem.unwrap_or(OsStr::new(name));
            let place = || format!("{}: line {number}: {name}", path.display());
            if !is_there(stem) {
                defects.add(DefectKind::ListedWithoutPicture, place);
                continue;
            }
            let other = parts.add(stem.to_owned(), part);
            if let Some(other) = other.filter(|other| !is_of_both || *other == "test") {
                defects.add(DefectKind::PictureInTwoParts, || format!("{}, and in {other}", place()));
            }
        }
    }
    Ok(parts)
}
