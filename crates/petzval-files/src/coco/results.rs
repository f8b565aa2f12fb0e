//! Detections in the format of COCO results: a list of `{image_id, category_id, bbox, score}`.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use petzval_base::{FileError, write_whole};
use serde::{Deserialize, Serialize};

use super::bounds::Bounds;
use super::data_set::{DataSet, Image};
use super::defect::{DefectKind, Defects};
use super::error::CocoError;
use super::ids::Ids;
use super::loose::{Fields, Loose, Record, Wrong};
use super::numbers::mark_numbers;
use super::read::json_error;
use super::write::{ImageId, TextIds, append_records};

/// An object that a detector reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Number of the picture.
    pub image_id: u64,
    /// Number of the class.
    pub category_id: u64,
    /// Its bounds.
    pub bounds: Bounds,
    /// How sure the detector is; only the order counts.
    pub score: f64,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct ResultRecord {
    image_id: Loose,
    category_id: Loose,
    bbox: Loose,
    score: Loose,
}

impl Fields for ResultRecord {}

/// Reads detections. Records that cannot be used are noted and left out. With a data set, so are detections in pictures or of
/// classes that it does not have. Where ids of its pictures are texts, those of detections are, too.
pub fn parse_results(
    mut bytes: Vec<u8>,
    data: Option<&DataSet>,
    defects: &mut Defects,
) -> Result<Vec<Detection>, FileError> {
    mark_numbers(&mut bytes);
    let records: Vec<Record<ResultRecord>> = serde_json::from_slice(&bytes).map_err(|e| {
        let error = json_error(&bytes, &e);
        if e.is_data() {
            error.hint("COCO results are a list of {image_id, category_id, bbox, score}")
        } else {
            error
        }
    })?;
    let known = data.map(|data| {
        let images: HashSet<u64> = data.images.iter().map(|image| image.id).collect();
        let categories: HashSet<u64> = data.categories.iter().map(|category| category.id).collect();
        (images, categories)
    });
    let images = data.map_or(&[][..], |data| &data.images);
    let texts: HashMap<String, u64> =
        images.iter().filter_map(|image| Some((image.text_id.clone()?, image.id))).collect();
    let ids = if texts.is_empty() { Ids::Numbers } else { Ids::Texts(texts) };
    let mut detections = Vec::with_capacity(records.len());
    for (i, record) in records.iter().enumerate() {
        let fault = match detection(record, &ids) {
            Err((key, wrong)) => Some(wrong.defect(key)),
            Ok(found) => {
                let fault = fault(&found, known.as_ref());
                if fault.is_none() {
                    detections.push(found);
                }
                fault
            }
        };
        if let Some((kind, what)) = fault {
            defects.add(kind, || format!("result [{i}]: {what}"));
        }
    }
    Ok(detections)
}

fn detection(record: &Record<ResultRecord>, ids: &Ids) -> Result<Detection, (&'static str, Wrong)> {
    let record = match record {
        Record::Table(record) => record,
        Record::Other(other) => return Err(("the record", Wrong::Type(other.to_string()))),
    };
    Ok(Detection {
        image_id: ids.number(&record.image_id).map_err(|wrong| ("image_id", wrong))?,
        category_id: record.category_id.whole().map_err(|wrong| ("category_id", wrong))?,
        bounds: Bounds::from(record.bbox.four().map_err(|wrong| ("bbox", wrong))?),
        score: record.score.number().map_err(|wrong| ("score", wrong))?,
    })
}

/// Why a detection cannot be scored. A detection without area overlaps nothing and stays: it is a mistake of the detector.
fn fault(found: &Detection, known: Option<&(HashSet<u64>, HashSet<u64>)>) -> Option<(DefectKind, String)> {
    let Bounds { x, y, width, height } = found.bounds;
    if !(found.bounds.area().is_finite() && (x + width).is_finite() && (y + height).is_finite()) {
        return Some((DefectKind::NotFinite, format!("bbox is {}", found.bounds)));
    }
    if width < 0.0 || height < 0.0 {
        return Some((DefectKind::NegativeSize, format!("bbox is {}", found.bounds)));
    }
    let (images, categories) = known?;
    if !images.contains(&found.image_id) {
        return Some((DefectKind::UnknownImage, format!("image_id is {}", found.image_id)));
    }
    let is_known = categories.contains(&found.category_id);
    (!is_known).then(|| (DefectKind::UnknownCategory, format!("category_id is {}", found.category_id)))
}

/// A detection as its file spells it.
#[derive(Serialize)]
struct DetectionRecord<'a> {
    image_id: ImageId<'a>,
    category_id: u64,
    bbox: Bounds,
    score: f64,
}

/// The bytes of a file of detections in these pictures, one in a line.
pub fn results_bytes(detections: &[Detection], images: &[Image]) -> Vec<u8> {
    let ids = TextIds::of(images);
    let record = |found: &Detection| DetectionRecord {
        image_id: ids.id(found.image_id),
        category_id: found.category_id,
        bbox: found.bounds,
        score: found.score,
    };
    let mut out = Vec::new();
    append_records(&mut out, detections.iter().map(record));
    out.push(b'\n');
    out
}

/// Writes a file of detections in these pictures, completely or not at all.
pub fn save_results(detections: &[Detection], images: &[Image], path: &Path) -> Result<(), CocoError> {
    write_whole(path, &results_bytes(detections, images)).map_err(CocoError::io(path))
}
