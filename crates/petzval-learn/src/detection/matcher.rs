//! Which object an anchor or a proposal is to find.

use serde::Serialize;

use super::BBox;

/// What a box is matched with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Match {
    /// The object of this number.
    Object(usize),
    /// Nothing: it is to say that there is no object.
    Background,
    /// It overlaps an object neither well nor badly, or lies in a region that is not judged: it is left out of the loss.
    Ignored,
}

/// Overlaps above which a box is matched with an object, and below which it is background.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Matcher {
    /// Least intersection over union of a match.
    pub high: f32,
    /// Intersection over union below which a box is background; between the two it is ignored.
    pub low: f32,
    /// Whether each object is also matched with the boxes that overlap it most, however little.
    pub keep_best: bool,
}

/// Share of a box inside an ignored region above which the box itself is ignored.
const IGNORED_SHARE: f32 = 0.5;

impl Matcher {
    /// Matches each box with the object that it overlaps most. A box that would be background, but lies in one of the `ignored` regions for
    /// more than half of its area, is ignored.
    pub fn matches(&self, objects: &[BBox], ignored: &[BBox], boxes: &[BBox]) -> Vec<Match> {
        let overlaps: Vec<Vec<f32>> =
            objects.iter().map(|object| boxes.iter().map(|bbox| object.iou(bbox)).collect()).collect();
        let mut matches = self.by_overlap(&overlaps, boxes.len());
        for (found, bbox) in matches.iter_mut().zip(boxes) {
            if *found == Match::Background && is_ignored(bbox, ignored) {
                *found = Match::Ignored;
            }
        }
        matches
    }

    /// Matches `boxes` boxes by a table of intersections over unions, one row per object.
    pub fn by_overlap(&self, overlaps: &[Vec<f32>], boxes: usize) -> Vec<Match> {
        // The best object of each box, and its overlap; the first of equals.
        let best: Vec<(usize, f32)> = (0..boxes)
            .map(|i| {
                let of_box = overlaps.iter().map(|row| row[i]).enumerate();
                of_box.fold((0, -1.0), |best, next| if next.1 > best.1 { next } else { best })
            })
            .collect();
        let mut matches: Vec<Match> = (best.iter())
            .map(|(object, overlap)| match *overlap {
                overlap if overlap >= self.high => Match::Object(*object),
                overlap if overlap >= self.low => Match::Ignored,
                _ => Match::Background,
            })
            .collect();
        if self.keep_best {
            for row in overlaps {
                // The largest overlap of an object, by however many boxes it is shared.
                let largest = row.iter().copied().fold(0.0, f32::max);
                let shared = row.iter().enumerate().filter(|(_, o)| largest > 0.0 && **o == largest);
                shared.for_each(|(i, _)| matches[i] = Match::Object(best[i].0));
            }
        }
        matches
    }
}

fn is_ignored(bbox: &BBox, ignored: &[BBox]) -> bool {
    let area = bbox.area();
    area > 0.0 && ignored.iter().any(|region| region.intersection(bbox) > IGNORED_SHARE * area)
}
