//! Pascal VOC: an XML file for each picture.
//!
//! `annotation/object` has `name`, `bndbox` (`xmin`, `ymin`, `xmax`, `ymax`: pixels counted from 1, both ends included), `difficult` and `truncated`.
//! <http://host.robots.ox.ac.uk/pascal/VOC/voc2012/htmldoc/>. Difficult objects are to be ignored.

use std::collections::{BTreeMap, HashMap};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::{FileError, quote};
use roxmltree::{Document, Node, ParsingOptions};

use super::builder::{Builder, Converted, Label};
use super::tree::{ends_with, files_below, labels_text, pictures_among, pictures_by, split_of};
use crate::coco::bounds::Bounds;
use crate::coco::data_set::Attribute;
use crate::coco::defect::DefectKind;
use crate::coco::error::CocoError;

/// Elements and texts of a file that are read.
const MOST_NODES: u32 = 1_000_000;

/// A file of labels.
#[derive(Debug, Default, PartialEq)]
struct Labels {
    file_name: Option<String>,
    /// Columns and rows, if the file states them.
    size: Option<[f64; 2]>,
    objects: Vec<Object>,
}

#[derive(Debug, PartialEq)]
struct Object {
    class: String,
    bounds: Bounds,
    is_difficult: bool,
    attributes: BTreeMap<String, Attribute>,
}

/// Reads a folder with `Annotations/*.xml` and `JPEGImages/`, or with XML files beside the pictures.
pub(super) fn convert_voc(root: &Path) -> Result<Converted, CocoError> {
    let files = files_below(root)?;
    let labels: Vec<&PathBuf> = files.iter().filter(|path| ends_with(path, "xml")).collect();
    if labels.is_empty() {
        let hint = "name the folder that holds `Annotations` and `JPEGImages`";
        return Err(CocoError::content(root, "there is no XML file", hint));
    }
    let by_name = pictures_by(&files, Path::file_name);
    let by_stem = pictures_by(&files, Path::file_stem);
    let splits = splits(&files)?;
    let mut builder = Builder::default();
    for path in labels {
        let text = labels_text(path)?;
        let read = match parse(&text) {
            Ok(read) => read,
            Err(error) => {
                builder.wrong(path, error);
                continue;
            }
        };
        // Names of pictures are not always kept up to date; the name of the labels is.
        let stem = path.file_stem().unwrap_or(OsStr::new(""));
        let beside = ["jpg", "jpeg", "png"]
            .map(|ending| path.with_extension(ending))
            .into_iter()
            .find(|p| p.is_file());
        let named = read.file_name.as_deref().and_then(|name| Path::new(name).file_name());
        let found = by_stem.get(stem).or_else(|| by_name.get(named?)).map(|path| path.to_path_buf());
        let Some(picture) = beside.or(found) else {
            builder.defects.add(DefectKind::MissingPicture, || format!("no picture for {}", path.display()));
            continue;
        };
        let listed = splits.get(stem).cloned();
        let split = listed.or_else(|| split_of(picture.strip_prefix(root).unwrap_or(&picture)));
        let Some(image) = builder.picture(root, &picture, split) else { continue };
        let (id, is) = (image.id, [f64::from(image.width), f64::from(image.height)]);
        if let Some(stated) = read.size.filter(|stated| stated.iter().all(|v| *v > 0.0) && *stated != is) {
            builder.defects.add(DefectKind::OtherPictureSize, || {
                format!(
                    "{}: {} x {} px, stated {} x {}",
                    picture.display(),
                    is[0],
                    is[1],
                    stated[0],
                    stated[1]
                )
            });
            builder.drop_picture(id);
            continue;
        }
        for object in read.objects {
            let label = Label {
                ignore: object.is_difficult,
                attributes: object.attributes,
                ..Label::new(&object.class, object.bounds)
            };
            builder.object(id, label);
        }
    }
    builder.note_unlabelled(pictures_among(&files));
    builder.finish("Pascal VOC")
}

/// The part of the data set of each picture, from `ImageSets/Main/train.txt`, `val.txt` and `test.txt`.
fn splits(files: &[PathBuf]) -> Result<HashMap<std::ffi::OsString, String>, CocoError> {
    let mut parts = HashMap::new();
    for path in files.iter().filter(|path| path.parent().is_some_and(|p| p.ends_with("ImageSets/Main"))) {
        // Lists of single classes, `car_train.txt`, have another stem; `trainval` is of two parts.
        let Some(part) = path.with_extension("").file_name().and_then(|name| split_of(Path::new(name)))
        else {
            continue;
        };
        for line in labels_text(path)?.lines() {
            if let Some(stem) = line.split_whitespace().next() {
                parts.insert(stem.into(), part.clone());
            }
        }
    }
    Ok(parts)
}

fn parse(text: &str) -> Result<Labels, FileError> {
    let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document =
        Document::parse_with_options(text.trim_start_matches('\u{feff}'), options).map_err(|e| {
            let is_cut_off =
                matches!(e, roxmltree::Error::UnexpectedEndOfStream | roxmltree::Error::UnclosedRootNode);
            // The reader gives no place for the end of the file.
            let (line, column, hint) = match is_cut_off {
                true => (
                    text.trim_end().lines().count() as u32,
                    None,
                    "the file is cut off; copy or export it again",
                ),
                false => (e.pos().row, Some(e.pos().col), "correct the line, or export the file again"),
            };
            let message = e.to_string();
            let reason = message.split(" at ").next().unwrap_or(&message);
            FileError {
                line: Some(line),
                column,
                key: String::new(),
                value: quote(text.lines().nth(line.saturating_sub(1) as usize).unwrap_or("")),
                message: format!("this is not XML: {reason}"),
                hint: Some(hint.to_owned()),
            }
        })?;
    let root = document.root_element();
    if root.tag_name().name() != "annotation" {
        return Err(error(root, "the outermost element is not `annotation`", "give files of Pascal VOC"));
    }
    let size = match child(root, "size") {
        Some(size) => Some([number(size, "width")?, number(size, "height")?]),
        None => None,
    };
    let mut labels = Labels { file_name: text_of(root, "filename"), size, objects: Vec::new() };
    for object in root.children().filter(|node| node.has_tag_name("object")) {
        labels.objects.push(read_object(object)?);
    }
    Ok(labels)
}

fn read_object(object: Node) -> Result<Object, FileError> {
    let Some(class) = text_of(object, "name").filter(|name| !name.is_empty()) else {
        return Err(error(object, "the object has no `name`", "add the name of its class"));
    };
    let Some(corners) = child(object, "bndbox") else {
        return Err(error(object, "the object has no `bndbox`", "add xmin, ymin, xmax and ymax"));
    };
    let value = |name| number(corners, name);
    // Pixels are counted from 1, and the last one is inside.
    let (left, top) = (value("xmin")? - 1.0, value("ymin")? - 1.0);
    let bounds = Bounds::between(left, top, value("xmax")?, value("ymax")?);
    let is_set =
        |name| text_of(object, name).is_some_and(|text| text == "1" || text.eq_ignore_ascii_case("true"));
    let mut attributes = BTreeMap::new();
    for name in ["truncated", "occluded"] {
        if child(object, name).is_some() {
            attributes.insert(name.to_owned(), Attribute::Flag(is_set(name)));
        }
    }
    // Views of an object; `Unspecified` is none.
    if let Some(pose) = text_of(object, "pose").filter(|pose| !pose.is_empty() && pose != "Unspecified") {
        attributes.insert("pose".to_owned(), Attribute::Text(pose));
    }
    Ok(Object { class, bounds, is_difficult: is_set("difficult"), attributes })
}

fn child<'a, 'b>(node: Node<'a, 'b>, name: &str) -> Option<Node<'a, 'b>> {
    node.children().find(|child| child.has_tag_name(name))
}

fn text_of(node: Node, name: &str) -> Option<String> {
    Some(child(node, name)?.text().unwrap_or("").trim().to_owned())
}

/// The number in an element.
fn number(node: Node, name: &'static str) -> Result<f64, FileError> {
    let Some(element) = child(node, name) else {
        return Err(error(node, format!("`{name}` is missing"), "write a number of pixels"));
    };
    let text = element.text().unwrap_or("").trim();
    text.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| {
        let found = error(element, "this is no number", "write a number of pixels");
        FileError { key: name.to_owned(), value: quote(text), ..found }
    })
}

fn error(node: Node, message: impl Into<String>, hint: &str) -> FileError {
    let place = node.document().text_pos_at(node.range().start);
    FileError {
        line: Some(place.row),
        column: Some(place.col),
        key: String::new(),
        value: format!("<{}>", node.tag_name().name()),
        message: message.into(),
        hint: Some(hint.to_owned()),
    }
}
