//! Data sets for object detection in the format of COCO: pictures, classes, boxes; and detections.
//!
//! This is the one format in which Petzval takes such data; [`convert`] brings other formats into it. [`load_coco`] reads a data set
//! and checks its values, [`check_pictures`] checks its pictures. What cannot be used is left out, and every defect is listed with a count, the first
//! cases and the worst.
//!
//! <https://cocodataset.org/#format-data>. Beyond it, a picture may name its film (`sequence` or `video_id`) and its part of the data
//! set (`split`), and an annotation may have `ignore` and `attributes`, such as the `state` of a traffic light.

mod bounded;
mod bounds;
mod check;
pub mod convert;
mod data_set;
mod defect;
mod error;
mod folder;
mod ids;
mod light_state;
mod loose;
mod mask;
mod numbers;
mod outline;
mod parts;
mod picture_names;
mod pictures;
mod read;
mod results;
mod rotation;
mod spelling;
mod statistics;
mod turned;
mod write;

pub use bounds::Bounds;
pub use check::{MANY_BOXES, check_values};
pub use data_set::{Annotation, Attribute, Category, DataSet, Image};
pub use defect::{Defect, DefectKind, Defects, Severity};
pub use error::CocoError;
pub use folder::{ANNOTATIONS, LARGEST_ANNOTATIONS, Loaded, has_annotations, load_coco, save_coco};
pub use light_state::{LIGHT_STATES, light_state};
pub use pictures::{PictureCheck, check_pictures, check_pictures_by, content_digest};
pub use read::parse_coco;
pub use results::{Detection, results_bytes, save_results};
pub use statistics::{ClassStatistics, LARGE_PX2, SMALL_PX2, Statistics};
pub use write::coco_bytes;
