//! Writes annotations in COCO format.

use std::collections::{BTreeMap, HashMap};

use serde::Serialize;

use super::data_set::{Annotation, Attribute, Category, DataSet, Image};

/// The id of a picture or of a class as its file spells it.
#[derive(Clone, Copy, Serialize)]
#[serde(untagged)]
pub(super) enum SpelledId<'a> {
    Number(u64),
    Text(&'a str),
}

impl<'a> SpelledId<'a> {
    fn of(number: u64, text: Option<&'a str>) -> Self {
        text.map_or(Self::Number(number), Self::Text)
    }
}

/// The ids of pictures and classes that are texts in their file, by number.
pub(super) struct TextIds<'a> {
    images: HashMap<u64, &'a str>,
    categories: HashMap<u64, &'a str>,
}

impl<'a> TextIds<'a> {
    pub fn of(images: &'a [Image], categories: &'a [Category]) -> Self {
        let categories = categories.iter().filter_map(|class| Some((class.id, class.text_id.as_deref()?)));
        let images = images.iter().filter_map(|image| Some((image.id, image.text_id.as_deref()?)));
        Self { images: images.collect(), categories: categories.collect() }
    }

    pub fn image(&self, number: u64) -> SpelledId<'a> {
        SpelledId::of(number, self.images.get(&number).copied())
    }

    pub fn category(&self, number: u64) -> SpelledId<'a> {
        SpelledId::of(number, self.categories.get(&number).copied())
    }
}

/// A picture as its file spells it.
#[derive(Serialize)]
struct ImageRecord<'a> {
    id: SpelledId<'a>,
    file_name: &'a str,
    width: u32,
    height: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    sequence: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    split: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    turned: Option<bool>,
}

impl<'a> From<&'a Image> for ImageRecord<'a> {
    fn from(image: &'a Image) -> Self {
        Self {
            id: SpelledId::of(image.id, image.text_id.as_deref()),
            file_name: &image.file_name,
            width: image.width,
            height: image.height,
            sequence: image.sequence.as_deref(),
            split: image.split.as_deref(),
            turned: image.turned,
        }
    }
}

/// A class as its file spells it.
#[derive(Serialize)]
struct CategoryRecord<'a> {
    id: SpelledId<'a>,
    name: &'a str,
    #[serde(skip_serializing_if = "str::is_empty")]
    supercategory: &'a str,
}

impl<'a> From<&'a Category> for CategoryRecord<'a> {
    fn from(class: &'a Category) -> Self {
        let id = SpelledId::of(class.id, class.text_id.as_deref());
        Self { id, name: &class.name, supercategory: &class.supercategory }
    }
}

/// An annotation as its file spells it.
#[derive(Serialize)]
struct AnnotationRecord<'a> {
    id: u64,
    image_id: SpelledId<'a>,
    category_id: SpelledId<'a>,
    bbox: [f64; 4],
    area: f64,
    iscrowd: u8,
    #[serde(skip_serializing_if = "is_zero")]
    ignore: u8,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    attributes: &'a BTreeMap<String, Attribute>,
}

fn is_zero(n: &u8) -> bool {
    *n == 0
}

impl<'a> AnnotationRecord<'a> {
    fn of(a: &'a Annotation, ids: &TextIds<'a>) -> Self {
        Self {
            id: a.id,
            image_id: ids.image(a.image_id),
            category_id: ids.category(a.category_id),
            bbox: a.bounds.into(),
            area: a.area,
            iscrowd: u8::from(a.crowd),
            ignore: u8::from(a.ignore),
            attributes: &a.attributes,
        }
    }
}

/// The bytes of a file in COCO format, one record in a line, so that two versions can be compared line by line. Ids of pictures and classes
/// that were texts are texts again.
pub fn coco_bytes(data: &DataSet) -> Vec<u8> {
    let mut out = b"{\n\"info\": ".to_vec();
    append(&mut out, &data.info);
    append_list(&mut out, "licenses", &data.licenses);
    append_list(&mut out, "images", data.images.iter().map(ImageRecord::from));
    append_list(&mut out, "categories", data.categories.iter().map(CategoryRecord::from));
    let ids = TextIds::of(&data.images, &data.categories);
    append_list(&mut out, "annotations", data.annotations.iter().map(|a| AnnotationRecord::of(a, &ids)));
    out.extend_from_slice(b"\n}\n");
    out
}

fn append_list(out: &mut Vec<u8>, name: &str, records: impl IntoIterator<Item = impl Serialize>) {
    out.extend_from_slice(format!(",\n\"{name}\": ").as_bytes());
    append_records(out, records);
}

/// Appends a list with one record in a line.
pub(super) fn append_records(out: &mut Vec<u8>, records: impl IntoIterator<Item = impl Serialize>) {
    out.push(b'[');
    for (i, record) in records.into_iter().enumerate() {
        out.extend_from_slice(if i == 0 { b"\n" } else { b",\n" });
        append(out, &record);
    }
    out.push(b']');
}

fn append(out: &mut Vec<u8>, value: &impl Serialize) {
    // Writing to memory fails only for keys that are not texts, and there are none.
    serde_json::to_writer(out, value).expect("texts as keys");
}
