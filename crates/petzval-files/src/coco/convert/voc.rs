//! Pascal VOC: an XML file for each picture.
//!
//! `annotation/object` has `name`, `bndbox` (`xmin`, `ymin`, `xmax`, `ymax`: pixels counted from 1, both ends included), `difficult`, `truncated`,
//! `occluded` and `pose`. <http://host.robots.ox.ac.uk/pascal/VOC/voc2012/htmldoc/>. Difficult objects are to be ignored.
//!
//! An object without a box may have an outline, `polygon` with `x1`, `y1`, `x2`, `y2` and so on, or with `pt` (`x`, `y`) as in LabelMe: the upright box
//! around it is taken. Two further forms are rotated boxes. They become the upright boxes around them. roLabelImg has `robndbox` in place of `bndbox`, with
//! `cx`, `cy`, `w`, `h` in pixels and `angle` in radians. CVAT has the attribute `rotation` (`attributes/attribute` with `name` and
//! `value`): the angle in degrees by which the box is rotated about its middle. Further attributes of that kind become attributes. An angle within
//! `bndbox` has no known unit and is an error. Parts of a person, actions, outlines beside a box and other elements are not read; they are counted.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::Cancel;

use super::builder::{Builder, Converted, Label};
use super::image_sets::{IMAGE_SETS, Named, parts_of, read_lists};
use super::tree::{Pictures, ends_with, files_below, pictures_among, split_of, xml_text};
use super::voc_file::{Form, Labels, Object, parse};
use crate::coco::defect::DefectKind;
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
    let named = Named::among(pictures_among(&files).chain(labels.iter().map(|path| path.as_path())));
    let lists = files.iter().map(PathBuf::as_path).filter(|path| is_in_main(path));
    let parts = parts_of(read_lists(lists, &named)?, &mut builder.defects);
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
        let listed =
            [path.as_path(), picture].into_iter().find_map(|file| parts.get(file)).map(str::to_owned);
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
        for Object { class, bounds, form, is_difficult, attributes } in objects {
            // Further out it is an overhang.
            let begins_at_zero = [bounds.x, bounds.y].iter().any(|edge| (-1.0..0.0).contains(edge));
            if begins_at_zero && form == Form::Upright {
                builder.defects.add(DefectKind::CountedFromZero, || format!("{}: {class}", path.display()));
            }
            let around = match form {
                Form::Upright => None,
                Form::Rotated => Some(DefectKind::RotatedBox),
                Form::Outline => Some(DefectKind::OutlineBox),
            };
            if let Some(kind) = around {
                builder.defects.add(kind, || format!("{}: {class}", path.display()));
            }
            builder.object(id, Label { ignore: is_difficult, attributes, ..Label::new(&class, bounds) });
        }
    }
    builder.note_unlabelled(pictures_among(&files));
    builder.finish("Pascal VOC")
}

/// Whether a file is in the folder of the lists of pictures.
fn is_in_main(path: &Path) -> bool {
    path.parent().is_some_and(|folder| folder.ends_with(Path::new(IMAGE_SETS).join("Main")))
}
