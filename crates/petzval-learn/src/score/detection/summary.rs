//! The numbers that detectors are published with.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::curve::Interpolation;
use super::group::Group;
use super::picture::Picture;
use super::protocol::Protocol;
use super::ranking::Ranking;

/// Area below which COCO calls an object small, px^2.
pub const COCO_SMALL_PX2: f64 = 32.0 * 32.0;
/// Area above which COCO calls an object large, px^2.
pub const COCO_LARGE_PX2: f64 = 96.0 * 96.0;
/// Upper end of the areas of COCO, px^2.
const LARGEST_PX2: f64 = 1e10;

/// The numbers of COCO. What no object contributes to is `None`, where pycocotools has -1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CocoSummary {
    /// Average precision over overlaps of 0.5 to 0.95.
    pub ap: Option<f64>,
    /// Average precision at an overlap of 0.5.
    pub ap50: Option<f64>,
    /// Average precision at an overlap of 0.75.
    pub ap75: Option<f64>,
    /// Average precision of objects below 32^2 px^2.
    pub ap_small: Option<f64>,
    /// Average precision of objects from 32^2 to 96^2 px^2.
    pub ap_medium: Option<f64>,
    /// Average precision of objects above 96^2 px^2.
    pub ap_large: Option<f64>,
    /// Average recall with one detection of a class in a picture.
    pub ar1: Option<f64>,
    /// Average recall with 10 detections.
    pub ar10: Option<f64>,
    /// Average recall with 100 detections.
    pub ar100: Option<f64>,
    /// Average recall of small objects.
    pub ar_small: Option<f64>,
    /// Average recall of medium objects.
    pub ar_medium: Option<f64>,
    /// Average recall of large objects.
    pub ar_large: Option<f64>,
    /// Average precision of each class.
    pub class_ap: Vec<Option<f64>>,
}

/// The numbers of COCO for classes 0 to `classes`. They are those of pycocotools if its order is kept: pictures in the order of their ids,
/// and detections of a picture in the order of their file.
pub fn coco_summary(pictures: &[Picture], classes: usize) -> CocoSummary {
    const MOST: usize = 100;
    const AREA: Interpolation = Interpolation::Points101;
    let of = |protocol: &Protocol, group: &Group| Ranking::new(pictures, classes, protocol, group);
    let coco = Protocol::coco();
    let all = of(&coco, &Group::of_area(0.0, LARGEST_PX2));
    let [small, medium, large] =
        [(0.0, COCO_SMALL_PX2), (COCO_SMALL_PX2, COCO_LARGE_PX2), (COCO_LARGE_PX2, LARGEST_PX2)]
            .map(|(low, high)| of(&coco, &Group::of_area(low, high)));
    CocoSummary {
        ap: all.average_precision(AREA, None),
        ap50: all.average_precision_at(0, AREA, None),
        // Thresholds are 0.05 apart.
        ap75: all.average_precision_at(5, AREA, None),
        ap_small: small.average_precision(AREA, None),
        ap_medium: medium.average_precision(AREA, None),
        ap_large: large.average_precision(AREA, None),
        ar1: all.average_recall(1),
        ar10: all.average_recall(10),
        ar100: all.average_recall(MOST),
        ar_small: small.average_recall(MOST),
        ar_medium: medium.average_recall(MOST),
        ar_large: large.average_recall(MOST),
        class_ap: (0..classes).map(|class| all.class_average_precision(class, AREA, None)).collect(),
    }
}

/// Average precision of each class after Pascal VOC at an overlap of 0.5; `None` where a class has no objects. Objects to be ignored are the
/// difficult ones of VOC.
pub fn voc_average_precision(
    pictures: &[Picture],
    classes: usize,
    interpolation: Interpolation,
) -> Vec<Option<f64>> {
    let ranking = Ranking::new(pictures, classes, &Protocol::voc_at(0.5), &Group::all());
    (0..classes).map(|class| ranking.class_average_precision(class, interpolation, None)).collect()
}
