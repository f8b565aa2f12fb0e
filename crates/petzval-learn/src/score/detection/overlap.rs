//! The overlap of a detection with an object.

use super::picture::Xywh;

/// Area of the intersection over that of the union, 0..1. With a crowd it is over that of the detection: one that lies in the crowd
/// altogether has 1.
pub fn overlap(found: Xywh, object: Xywh, is_crowd: bool) -> f64 {
    let width = (found[0] + found[2]).min(object[0] + object[2]) - found[0].max(object[0]);
    let height = (found[1] + found[3]).min(object[1] + object[3]) - found[1].max(object[1]);
    // Minimum and maximum pass over what is no number: a box of such numbers overlaps nothing.
    let is_box = found.iter().chain(&object).all(|v| v.is_finite());
    if !is_box || width <= 0.0 || height <= 0.0 {
        return 0.0;
    }
    let shared = width * height;
    let (own, others) = (found[2] * found[3], object[2] * object[3]);
    shared / if is_crowd { own } else { own + others - shared }
}
