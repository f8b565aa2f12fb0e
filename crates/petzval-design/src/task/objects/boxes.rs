//! Boxes of objects drawn into pictures, for people to look at.

use petzval_camera::image::LinearImage;
use petzval_learn::detection::{BBox, Detection, Truth};

use super::seen_windows::{LEAST_SCORE, OVERLAP, is_unjudged};

/// Colours of boxes, sRGB-encoded: objects, right detections, detections of the wrong class, false alarms, regions that are not judged.
const OBJECT: [f32; 3] = [0.1, 0.9, 1.0];
const RIGHT: [f32; 3] = [0.2, 0.95, 0.2];
const OTHER_CLASS: [f32; 3] = [1.0, 0.75, 0.1];
const FALSE_ALARM: [f32; 3] = [1.0, 0.2, 0.2];
const UNJUDGED: [f32; 3] = [0.6, 0.6, 0.6];

/// A picture with the boxes of its objects, and of regions that are not judged in gray.
pub fn with_truth(picture: &LinearImage, truth: &Truth) -> LinearImage {
    let mut drawn = picture.clone();
    truth.ignored.iter().for_each(|region| outline(&mut drawn, &region.bbox, UNJUDGED));
    truth.objects.iter().for_each(|object| outline(&mut drawn, &object.bbox, OBJECT));
    drawn
}

/// A picture with the sure detections: green where an object of the class is, yellow where one of another class is, gray in regions that are not
/// judged, red where nothing is.
pub fn with_detections(picture: &LinearImage, truth: &Truth, found: &[Detection]) -> LinearImage {
    let mut drawn = picture.clone();
    for detection in found.iter().filter(|d| d.score >= LEAST_SCORE).rev() {
        let near = || truth.objects.iter().filter(|o| o.bbox.iou(&detection.bbox) >= OVERLAP);
        let colour = match near().next() {
            None if is_unjudged(truth, detection) => UNJUDGED,
            None => FALSE_ALARM,
            Some(_) if near().any(|object| object.class == detection.class) => RIGHT,
            Some(_) => OTHER_CLASS,
        };
        outline(&mut drawn, &detection.bbox, colour);
    }
    drawn
}

/// The picture with the boxes of the detections that are sure.
pub fn with_sure(picture: &LinearImage, found: &[Detection], classes: &[&str]) -> LinearImage {
    let sure = found.iter().filter(|d| d.score >= LEAST_SCORE).map(|d| (d.bbox, d.class));
    with_boxes(picture, &sure.collect::<Vec<_>>(), classes)
}

/// A picture with boxes, each in the colour of its class: the one that the class is named after, as states of lights are, or one of a series.
pub fn with_boxes(
    picture: &LinearImage,
    boxes: &[(BBox, usize)],
    classes: &[impl AsRef<str>],
) -> LinearImage {
    const SERIES: [[f32; 3]; 4] = [RIGHT, OBJECT, OTHER_CLASS, [1.0, 0.3, 0.9]];
    const NAMED: [(&str, [f32; 3]); 4] =
        [("red", FALSE_ALARM), ("yellow", [1.0, 0.9, 0.1]), ("green", RIGHT), ("off", UNJUDGED)];
    let mut drawn = picture.clone();
    for (bbox, class) in boxes.iter().rev() {
        let named = NAMED.iter().find(|(name, _)| classes.get(*class).is_some_and(|c| c.as_ref() == *name));
        let colour = named.map_or(SERIES[class % SERIES.len()], |(_, colour)| *colour);
        outline(&mut drawn, bbox, colour);
    }
    drawn
}

/// Draws the outline of a box, one pixel wide.
fn outline(picture: &mut LinearImage, bbox: &BBox, colour: [f32; 3]) {
    let (height, width) = (picture.height, picture.width);
    let within = |v: f32, size: usize| (v.round().max(0.0) as usize).min(size.saturating_sub(1));
    let (left, right) = (within(bbox.x1, width), within(bbox.x2 - 1.0, width));
    let (top, bottom) = (within(bbox.y1, height), within(bbox.y2 - 1.0, height));
    let mut paint = |row: usize, column: usize| {
        for (channel, value) in colour.iter().enumerate() {
            picture.data[(channel * height + row) * width + column] = *value;
        }
    };
    for column in left..=right {
        paint(top, column);
        paint(bottom, column);
    }
    for row in top..=bottom {
        paint(row, left);
        paint(row, right);
    }
}

#[cfg(test)]
mod tests {
    use petzval_learn::detection::{Ignored, Object};

    use super::*;

    #[test]
    fn detections_have_the_colour_of_what_they_are() {
        let picture = LinearImage::zeros(3, 20, 40);
        let at = |x1: f32| BBox::new(x1, 5.0, x1 + 6.0, 15.0);
        let truth = Truth {
            objects: vec![Object { bbox: at(1.0), class: 0 }, Object { bbox: at(10.0), class: 1 }],
            ignored: vec![Ignored::of_all(at(32.0))],
            ..Truth::default()
        };
        let found = |x1: f32, class, score| Detection { bbox: at(x1), class, score };
        let found = [(1.0, 0, 0.9), (10.0, 0, 0.9), (20.0, 1, 0.9), (32.0, 1, 0.9), (24.0, 1, 0.1)]
            .map(|(x1, class, score)| found(x1, class, score));
        let drawn = with_detections(&picture, &truth, &found);
        let colour = |column: usize| [0, 1, 2].map(|c| drawn.data[(c * 20 + 10) * 40 + column]);
        assert_eq!([1, 10, 20, 32].map(colour), [RIGHT, OTHER_CLASS, FALSE_ALARM, UNJUDGED]);
        assert_eq!([colour(3), colour(29)], [[0.0; 3]; 2]);
        // A state of a light has the colour of its name.
        let boxes = [(at(1.0), 0), (at(10.0), 1)];
        let drawn = |classes: [&str; 2]| with_boxes(&picture, &boxes, &classes);
        let colour =
            |drawn: LinearImage, column: usize| [0, 1, 2].map(|c| drawn.data[(c * 20 + 10) * 40 + column]);
        assert_eq!([1, 10].map(|column| colour(drawn(["red", "green"]), column)), [FALSE_ALARM, RIGHT]);
        assert_eq!(colour(drawn(["person", "car"]), 10), OBJECT);
        // Boxes beyond the picture are drawn as far as they go.
        with_truth(
            &picture,
            &Truth { ignored: vec![Ignored::of_all(BBox::new(-50.0, -9.0, 90.0, 99.0))], ..Truth::default() },
        );
    }
}
