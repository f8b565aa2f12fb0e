//! Non-maximum suppression: of boxes around the same object, the best is kept.

use super::BBox;

/// Numbers of the first `count` boxes that are kept, best first: a box goes if its intersection over union with a better one of its group that is kept is
/// above `most`. Boxes of different groups, such as classes, do not suppress each other. Of equal scores the earlier box is the better one.
pub fn suppress(boxes: &[BBox], scores: &[f32], groups: &[usize], most: f32, count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]));
    let mut kept: Vec<usize> = Vec::new();
    for i in order {
        if kept.len() == count {
            break;
        }
        let is_covered = |k: &usize| groups[*k] == groups[i] && boxes[*k].iou(&boxes[i]) > most;
        if !kept.iter().any(is_covered) {
            kept.push(i);
        }
    }
    kept
}
