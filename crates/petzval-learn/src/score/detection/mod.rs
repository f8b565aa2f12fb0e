//! How well objects are detected: average precision after COCO and Pascal VOC, its uncertainty, and the state of traffic lights.
//!
//! ```text
//! Picture (objects, detections) -> Ranking (hits and misses by score) -> precision over recall -> average precision -> interval
//! ```
//!
//! [`coco_summary`] gives the twelve numbers of COCO as pycocotools computes them. [`Ranking`] holds what all of them are
//! made of; its average precision over pictures that are drawn with repetition ([`bootstrap`]) takes no second matching. A [`Group`]
//! restricts everything to some objects, such as those far from the optical axis: all others are ignored.
//!
//! The crate hotcoco (1.3) gives the twelve numbers as well, but a picture that is drawn several times counts once there (its module
//! `metrics::bootstrap` says so). A bootstrap needs a ranking in which pictures have weights.
//!
//! This module needs no tensors.

mod bootstrap;
mod curve;
mod group;
mod matching;
mod of_data_set;
mod overlap;
mod picture;
mod protocol;
mod ranking;
mod state;
mod summary;

pub use bootstrap::{Bootstrap, Interval, bootstrap, drawn_scores, percentiles};
pub use curve::{Interpolation, PrecisionRecall};
pub use group::Group;
pub use of_data_set::{clusters_of, clusters_of_data_set, pictures_of_data_set};
pub use overlap::overlap;
pub use picture::{FoundObject, Picture, TrueObject, Xywh};
pub use protocol::Protocol;
pub use ranking::{ClassRanking, Ranking};
pub use state::{StateConfusion, StateOf};
pub use summary::{COCO_LARGE_PX2, COCO_SMALL_PX2, CocoSummary, coco_summary, voc_average_precision};
