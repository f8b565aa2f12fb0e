//! Detections in the format of COCO results: a list of `{image_id, category_id, bbox, score}`.

use std::path::Path;

use petzval_base::{IoError, write_whole};
use serde::Serialize;

use super::bounds::Bounds;
use super::data_set::DataSet;
use super::error::CocoError;
use super::write::{SpelledId, TextIds, append_records};

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

/// A detection as its file spells it.
#[derive(Serialize)]
struct DetectionRecord<'a> {
    image_id: SpelledId<'a>,
    category_id: SpelledId<'a>,
    bbox: Bounds,
    score: f64,
}

/// The bytes of a file of detections in the pictures and of the classes of a data set, one in a line.
pub fn results_bytes(detections: &[Detection], data: &DataSet) -> Vec<u8> {
    let ids = TextIds::of(&data.images, &data.categories);
    let record = |found: &Detection| DetectionRecord {
        image_id: ids.image(found.image_id),
        category_id: ids.category(found.category_id),
        bbox: found.bounds,
        score: found.score,
    };
    let mut out = Vec::new();
    append_records(&mut out, detections.iter().map(record));
    out.push(b'\n');
    out
}

/// Writes a file of detections in the pictures of a data set, completely or not at all.
pub fn save_results(detections: &[Detection], data: &DataSet, path: &Path) -> Result<(), CocoError> {
    Ok(write_whole(path, &results_bytes(detections, data)).map_err(IoError::at(path))?)
}
