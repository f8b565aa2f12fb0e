//! Reads annotations in COCO format.

use std::collections::{BTreeMap, HashMap};

use petzval_base::FileError;
use serde::Deserialize;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserializer, MapAccess, Visitor};

use super::bounds::Bounds;
use super::data_set::{Annotation, Attribute, Category, DataSet, Image};
use super::defect::{DefectKind, Defects, note_unread};
use super::ids::Ids;
use super::loose::{Fields, Loose, Record, Wrong};
use super::numbers::mark_numbers;
use super::outline::Outline;
use super::rotation::{is_rotation, take_rotation_deg, unread_angles};
use crate::encoding::decode;

#[derive(Deserialize)]
struct FileRecord {
    #[serde(default)]
    info: serde_json::Value,
    #[serde(default)]
    licenses: serde_json::Value,
    images: Vec<Record<ImageRecord>>,
    annotations: Vec<Record<AnnotationRecord>>,
    categories: Vec<Record<CategoryRecord>>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct ImageRecord {
    id: Loose,
    file_name: Loose,
    width: Loose,
    height: Loose,
    sequence: Loose,
    video_id: Loose,
    split: Loose,
    turned: Loose,
    #[serde(skip)]
    unread: Vec<String>,
}

impl Fields for ImageRecord {
    const KNOWN: Option<&'static [&'static str]> = Some(&[
        "id",
        "file_name",
        "width",
        "height",
        "sequence",
        "video_id",
        "split",
        "turned",
        "license",
        "date_captured",
        "flickr_url",
        "coco_url",
        "url",
        "frame_id",
    ]);

    fn set_unread(&mut self, fields: Vec<String>) {
        self.unread = fields;
    }
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct CategoryRecord {
    id: Loose,
    name: Loose,
    supercategory: Loose,
    #[serde(skip)]
    unread: Vec<String>,
}

impl Fields for CategoryRecord {
    const KNOWN: Option<&'static [&'static str]> = Some(&["id", "name", "supercategory", "color"]);

    fn set_unread(&mut self, fields: Vec<String>) {
        self.unread = fields;
    }
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct AnnotationRecord {
    id: Loose,
    image_id: Loose,
    category_id: Loose,
    bbox: Loose,
    area: Loose,
    iscrowd: Loose,
    ignore: Loose,
    state: Loose,
    attributes: Attributes,
    bbox_mode: Loose,
    segmentation: Outline,
    #[serde(skip)]
    unread: Vec<String>,
}

impl Fields for AnnotationRecord {
    const KNOWN: Option<&'static [&'static str]> = Some(&[
        "id",
        "image_id",
        "category_id",
        "bbox",
        "area",
        "iscrowd",
        "ignore",
        "state",
        "attributes",
        "bbox_mode",
        "segmentation",
    ]);

    fn set_unread(&mut self, fields: Vec<String>) {
        self.unread = fields;
    }
}

impl Fields for FileRecord {}

impl AnnotationRecord {
    /// Whether there is an outline and no box. Some programs write an empty list for none.
    fn is_outline_alone(&self) -> bool {
        let has_no_box = match &self.bbox {
            Loose::Absent => true,
            Loose::List(values) => values.is_empty(),
            _ => false,
        };
        has_no_box && self.segmentation != Outline::Absent
    }
}

/// The values of `attributes`, whatever their types.
#[derive(Default)]
struct Attributes(Vec<(String, Loose)>);

impl<'de> Deserialize<'de> for Attributes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries;
        impl<'de> Visitor<'de> for Entries {
            type Value = Attributes;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a table of attributes")
            }

            fn visit_unit<E>(self) -> Result<Attributes, E> {
                Ok(Attributes::default())
            }

            // Some programs write an empty list in place of an empty table.
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, list: A) -> Result<Attributes, A::Error> {
                let list = Loose::deserialize(SeqAccessDeserializer::new(list))?;
                let is_empty = matches!(&list, Loose::List(values) if values.is_empty());
                Ok(Attributes(if is_empty { Vec::new() } else { vec![("attributes".to_owned(), list)] }))
            }

            fn visit_map<A: MapAccess<'de>>(self, mut table: A) -> Result<Attributes, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = table.next_entry()? {
                    entries.push(entry);
                }
                Ok(Attributes(entries))
            }
        }
        deserializer.deserialize_any(Entries)
    }
}

/// Reads annotations in COCO format. Records that lack a value or hold one of a wrong type are defects and left out; ids and boxes are
/// as written, see [`check_values`](super::check_values). Ids of pictures, classes or annotations that are all texts become numbers. Text that is not
/// JSON, or not of this format, is an error.
pub fn parse_coco(bytes: Vec<u8>, defects: &mut Defects) -> Result<DataSet, FileError> {
    let bytes = plain_json(bytes);
    let file: FileRecord = match serde_json::from_slice(&bytes).map_err(|e| json_error(&bytes, &e))? {
        Record::Table(file) => file,
        Record::Other(other) => {
            let hint =
                "a COCO detection file is a table with the lists `images`, `annotations` and `categories`";
            let message = "this is not the format: the file holds no table";
            return Err(FileError::at_line(1, &other.to_string(), message).hint(hint));
        }
    };
    note_unread(&unread(&file), defects);
    let info = match file.info {
        serde_json::Value::Object(info) => info,
        _ => serde_json::Map::new(),
    };
    let licenses = match file.licenses {
        serde_json::Value::Array(licenses) => licenses,
        _ => Vec::new(),
    };
    let states_form = |record: &Record<AnnotationRecord>| {
        record.table().is_some_and(|record| matches!(record.bbox_mode, Loose::Whole(1)))
    };
    let states_form = !file.annotations.is_empty() && file.annotations.iter().all(states_form);
    let mut data = DataSet { info, licenses, states_form, ..DataSet::default() };
    let image_ids = Ids::of(file.images.iter().filter_map(Record::table).map(|record| &record.id));
    let category_ids = Ids::of(file.categories.iter().filter_map(Record::table).map(|record| &record.id));
    let annotation_ids = Ids::of(file.annotations.iter().filter_map(Record::table).map(|record| &record.id));
    for (i, record) in file.images.into_iter().enumerate() {
        let found = with(record, |record| image(record, &image_ids));
        data.images.extend(usable(found, || format!("images[{i}]"), defects));
    }
    let sizes: HashMap<u64, [u32; 2]> =
        data.images.iter().map(|image| (image.id, [image.height, image.width])).collect();
    let lists = Lists { pictures: image_ids, sizes, categories: category_ids, annotations: annotation_ids };
    for (i, record) in file.categories.into_iter().enumerate() {
        data.categories.extend(usable(
            with(record, |record| category(record, &lists.categories)),
            || format!("categories[{i}]"),
            defects,
        ));
    }
    for (i, record) in file.annotations.into_iter().enumerate() {
        let place = || format!("annotations[{i}]");
        let mut warn = |kind, what| defects.add(kind, || format!("{}: {what}", place()));
        let image_id = record.table().and_then(|record| {
            let ids = &lists.pictures;
            ids.number(&record.image_id).ok().or_else(|| ids.meant(&record.image_id))
        });
        let found = with(record, |record| annotation(record, i, &lists, &mut warn));
        let found = usable(found, place, defects);
        match (found, image_id) {
            (Some(annotation), _) => data.annotations.push(annotation),
            (None, Some(image_id)) => defects.lose_label(image_id),
            (None, None) => {}
        }
    }
    Ok(data)
}

/// The fields of all records that are not read, with the number of records that have each. Outlines are one of them, where there is a box, and
/// attributes that may be angles of boxes.
fn unread(file: &FileRecord) -> BTreeMap<String, usize> {
    let mut fields: BTreeMap<String, usize> = BTreeMap::new();
    let mut count = |list: &str, names: &[String]| {
        for name in names {
            *fields.entry(format!("{list}[].{name}")).or_default() += 1;
        }
    };
    file.images.iter().filter_map(Record::table).for_each(|r| count("images", &r.unread));
    file.categories.iter().filter_map(Record::table).for_each(|r| count("categories", &r.unread));
    for record in file.annotations.iter().filter_map(Record::table) {
        count("annotations", &record.unread);
        if record.segmentation != Outline::Absent && !record.is_outline_alone() {
            count("annotations", &["segmentation".to_owned()]);
        }
        let angles = unread_angles(record.attributes.0.iter().map(|(name, value)| (name, value)));
        let angles: Vec<String> = angles.map(|name| format!("attributes.{name}")).collect();
        count("annotations", &angles);
    }
    fields
}

/// What a record holds, unless it is no table.
fn with<T, U>(
    record: Record<T>,
    read: impl FnOnce(T) -> Result<U, (&'static str, Wrong)>,
) -> Result<U, (&'static str, Wrong)> {
    match record {
        Record::Table(record) => read(record),
        Record::Other(other) => Err(("the record", Wrong::Type(other.to_string()))),
    }
}

/// The record, or `None` after a note of what is wrong with it.
fn usable<T>(
    record: Result<T, (&'static str, Wrong)>,
    place: impl Fn() -> String,
    defects: &mut Defects,
) -> Option<T> {
    let (key, wrong) = match record {
        Ok(record) => return Some(record),
        Err(wrong) => wrong,
    };
    let (kind, what) = wrong.defect(key);
    defects.add(kind, || format!("{}: {what}", place()));
    None
}

fn image(record: ImageRecord, ids: &Ids) -> Result<Image, (&'static str, Wrong)> {
    // Many files state no size, or 0; the size is then read from the picture file.
    let side = |value: &Loose, key| match value {
        Loose::Absent => Ok(0),
        value => {
            let whole = value.whole().map_err(|wrong| (key, wrong))?;
            u32::try_from(whole).map_err(|_| (key, Wrong::Type(value.to_string())))
        }
    };
    let sequence = record.sequence.name().map_err(|wrong| ("sequence", wrong))?;
    let video = record.video_id.name().map_err(|wrong| ("video_id", wrong))?;
    Ok(Image {
        id: ids.number(&record.id).map_err(|wrong| ("id", wrong))?,
        text_id: ids.text(&record.id),
        file_name: file_name(&record.file_name).map_err(|wrong| ("file_name", wrong))?,
        width: side(&record.width, "width")?,
        height: side(&record.height, "height")?,
        sequence: sequence.or(video),
        split: record.split.name().map_err(|wrong| ("split", wrong))?,
        turned: match record.turned {
            Loose::Absent => None,
            turned => Some(turned.flag().map_err(|wrong| ("turned", wrong))?),
        },
    })
}

/// The name of a picture, which is not empty.
fn file_name(value: &Loose) -> Result<String, Wrong> {
    let text = value.text()?;
    if text.trim().is_empty() { Err(Wrong::Type(value.to_string())) } else { Ok(text.to_owned()) }
}

fn category(record: CategoryRecord, ids: &Ids) -> Result<Category, (&'static str, Wrong)> {
    Ok(Category {
        id: ids.number(&record.id).map_err(|wrong| ("id", wrong))?,
        text_id: ids.text(&record.id),
        name: record.name.text().map_err(|wrong| ("name", wrong))?.to_owned(),
        supercategory: record.supercategory.text().unwrap_or("").to_owned(),
    })
}

/// What annotations have to know of the lists of their file.
struct Lists {
    /// Ids of pictures.
    pictures: Ids,
    /// Rows and columns of pictures by number, px; 0 where the file states none.
    sizes: HashMap<u64, [u32; 2]>,
    categories: Ids,
    annotations: Ids,
}

fn annotation(
    record: AnnotationRecord,
    place: usize,
    lists: &Lists,
    warn: &mut impl FnMut(DefectKind, String),
) -> Result<Annotation, (&'static str, Wrong)> {
    // Detectron2 counts its kinds of boxes: 1 is the one of COCO.
    if !matches!(record.bbox_mode, Loose::Absent | Loose::Whole(1)) {
        return Err(("bbox_mode", Wrong::Type(record.bbox_mode.to_string())));
    }
    let image_id = lists.pictures.number(&record.image_id).map_err(|wrong| ("image_id", wrong))?;
    let mut bounds = match record.segmentation {
        Outline::Polygons(bounds) if record.is_outline_alone() => {
            warn(DefectKind::OutlineBox, bounds.to_string());
            bounds
        }
        Outline::Mask(mask) if record.is_outline_alone() => {
            // A mask of another size is of other pixels.
            let stated = lists.sizes.get(&image_id).filter(|size| !size.contains(&0));
            if stated.is_some_and(|stated| *stated != mask.size) {
                let [rows, columns] = mask.size;
                return Err(("segmentation", Wrong::Type(format!("a mask of {columns} x {rows} px"))));
            }
            warn(DefectKind::OutlineBox, mask.bounds.to_string());
            mask.bounds
        }
        Outline::Other if record.is_outline_alone() => {
            return Err(("bbox", Wrong::Type("missing, and segmentation no outline or mask".to_owned())));
        }
        _ => Bounds::from(record.bbox.four().map_err(|wrong| ("bbox", wrong))?),
    };
    let id = match record.id {
        // An annotation without id is usual in files made by hand; its place is one.
        Loose::Absent => place as u64 + 1,
        id => lists.annotations.number(&id).map_err(|wrong| ("id", wrong))?,
    };
    let mut attributes = BTreeMap::new();
    for (name, value) in record.attributes.0.into_iter().chain([("state".to_owned(), record.state)]) {
        let value = match value {
            Loose::Absent => continue,
            Loose::Flag(flag) => Attribute::Flag(flag),
            Loose::Text(text) => Attribute::Text(text),
            Loose::Whole(n) => Attribute::Number(n as f64),
            Loose::Number(v) if v.is_finite() => Attribute::Number(v),
            other if is_rotation(&name) => {
                return Err(("attributes.rotation", Wrong::Type(other.to_string())));
            }
            other => {
                warn(DefectKind::LooseAttribute, format!("{name} is {other}"));
                continue;
            }
        };
        attributes.insert(name, value);
    }
    // CVAT writes the box before it is rotated about its middle. By an angle that is not read it would be the wrong box.
    let rotation_deg = take_rotation_deg(&mut attributes);
    if let Some(degrees) = rotation_deg.map_err(|value| ("attributes.rotation", Wrong::Type(value)))? {
        let around = bounds.around_rotated(degrees.to_radians());
        warn(DefectKind::RotatedBox, format!("{bounds} by {degrees} degrees becomes {around}"));
        bounds = around;
    }
    Ok(Annotation {
        id,
        image_id,
        category_id: lists.categories.number(&record.category_id).map_err(|wrong| ("category_id", wrong))?,
        bounds,
        // An area that is no number is that of the box, which the check of values notes.
        area: record.area.number().unwrap_or(f64::NAN),
        crowd: record.iscrowd.flag().map_err(|wrong| ("iscrowd", wrong))?,
        ignore: record.ignore.flag().map_err(|wrong| ("ignore", wrong))?,
        attributes,
        unclipped: None,
    })
}

/// The bytes of a file without what is not JSON: a byte order mark, of which one of UTF-16 says how to read the rest, and [numbers that JSON
/// does not have](mark_numbers).
pub(super) fn plain_json(mut bytes: Vec<u8>) -> Vec<u8> {
    if bytes.starts_with(b"\xef\xbb\xbf") {
        bytes[..3].fill(b' ');
    } else if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        bytes = decode(&bytes).into_owned().into_bytes();
    }
    mark_numbers(&mut bytes);
    bytes
}

/// An error of the JSON reader with its place, and the line there.
pub(super) fn json_error(bytes: &[u8], error: &serde_json::Error) -> FileError {
    let line = u32::try_from(error.line()).ok().filter(|line| *line > 0);
    let text = error.to_string();
    let message = text.split(" at line ").next().unwrap_or(&text).to_owned();
    let is_format = error.is_data();
    let hint = match is_format {
        true => "a COCO detection file is a table with the lists `images`, `annotations` and `categories`",
        false if error.is_eof() => "the file is cut off; copy or export it again",
        false => "correct the JSON there, or export the file again",
    };
    let message = if is_format {
        format!("this is not the format: {message}")
    } else {
        format!("this is not JSON: {message}")
    };
    let near = bytes.split(|b| *b == b'\n').nth(error.line().saturating_sub(1)).unwrap_or(b"");
    // Files in one line have it up to the place.
    let from = error.column().saturating_sub(30).min(near.len());
    let to = (error.column() + 10).min(near.len());
    let column = line.and(u32::try_from(error.column()).ok());
    let near = String::from_utf8_lossy(&near[from..to.max(from)]);
    FileError { line, column, ..FileError::at_line(0, &near, message).hint(hint) }
}
