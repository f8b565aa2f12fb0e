//! Writes annotations in COCO format.

use std::collections::BTreeMap;

use serde::Serialize;

use super::data_set::{Annotation, Attribute, DataSet};

/// An annotation as its file spells it.
#[derive(Serialize)]
struct AnnotationRecord<'a> {
    id: u64,
    image_id: u64,
    category_id: u64,
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

impl<'a> From<&'a Annotation> for AnnotationRecord<'a> {
    fn from(a: &'a Annotation) -> Self {
        Self {
            id: a.id,
            image_id: a.image_id,
            category_id: a.category_id,
            bbox: a.bounds.into(),
            area: a.area,
            iscrowd: u8::from(a.crowd),
            ignore: u8::from(a.ignore),
            attributes: &a.attributes,
        }
    }
}

/// The bytes of a file in COCO format, one record in a line, so that two versions can be compared line by line.
pub fn coco_bytes(data: &DataSet) -> Vec<u8> {
    let mut out = b"{\n\"info\": ".to_vec();
    append(&mut out, &data.info);
    append_list(&mut out, "licenses", &data.licenses);
    append_list(&mut out, "images", &data.images);
    append_list(&mut out, "categories", &data.categories);
    append_list(&mut out, "annotations", data.annotations.iter().map(AnnotationRecord::from));
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
