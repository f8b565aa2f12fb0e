//! Brings other formats of labelled pictures into the one of [`coco`](super).
//!
//! Every converter reads labels and the heads of the pictures, and returns a [`Converted`] data set with the file of each picture.
//! A line that cannot be understood is an error that names the file, the line, the value and what to write instead; all of them are counted.
//! Values that are understood and make no sense, such as boxes outside the picture, are defects, as in a file in COCO format.

mod bdd100k;
mod builder;
mod image_sets;
mod kitti;
mod kitti_lines;
mod kitti_tracking;
mod tree;
mod voc;
mod voc_file;
mod yolo;
mod yolo_long;
mod yolo_names;
mod yolo_parts;

use std::path::Path;

use petzval_base::Cancel;
use schemars::JsonSchema;

pub use builder::Converted;

use super::error::CocoError;

/// A format that can be converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SourceFormat {
    /// KITTI object detection: `label_2/*.txt` and `image_2/`; or tracking: `label_02/*.txt` and `image_02/`.
    Kitti,
    /// BDD100K: JSON with `labels[].box2d`, and the pictures.
    Bdd100k,
    /// YOLO: `data.yaml` and `labels/*.txt`, also as Roboflow, Ultralytics and Darknet lay them out.
    Yolo,
    /// Pascal VOC: `Annotations/*.xml` and `JPEGImages/`.
    Voc,
}

/// Reads a folder in another format. `turned` says whether the boxes of pictures that EXIF turns are of the pictures as they are shown (`true`), or of
/// the stored pixels (`false`), where the stated sizes do not. Fails with [`CocoError::Stopped`] before the next picture or file of labels once `cancel` is set.
pub fn convert(
    format: SourceFormat,
    root: &Path,
    turned: Option<bool>,
    cancel: &Cancel,
) -> Result<Converted, CocoError> {
    match format {
        SourceFormat::Kitti => kitti::convert(root, turned, cancel),
        SourceFormat::Bdd100k => bdd100k::convert(root, turned, cancel),
        SourceFormat::Yolo => yolo::convert(root, turned, cancel),
        SourceFormat::Voc => voc::convert(root, turned, cancel),
    }
}
