//! Long lines of YOLO labels whose file of class names says neither that they are outlines nor that they are poses.
//!
//! The numbers of an outline may by chance be those of a pose: a box in the picture that holds the points behind it. For one small object in the
//! upper left of its picture that is frequent. The lines of a data set together show which they are. All poses have the same number of
//! keypoints; outlines have different numbers of points, reach out of such a box, or are all rectangles. Single wrong lines of poses do not make them outlines:
//! where nine lines of ten may be poses of one shape, nothing is guessed. Nor is it where nine of ten begin with the box around their other points, which some
//! programs write before an outline. Among nine times as many plain boxes, longer lines are no poses:
//! those have keypoints in all lines.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use petzval_base::FileError;

use crate::coco::bounds::Bounds;

/// Shares may exceed 0..1 by rounding; what is further out is in pixels.
pub(super) const ROUNDING: f64 = 0.01;

/// With so many lines of ten of another form, no line is taken for an outline.
const DOUBTFUL_OF_TEN: usize = 9;

/// With so many lines of ten that are plain boxes, the longer ones are no poses.
const BOXES_OF_TEN: usize = 9;

/// Share of the box that three keypoints or more span at least in one direction, if the box itself lies among them like points of an outline.
const LEAST_SPAN: f64 = 0.25;

/// A line that is read as an outline.
pub(super) struct LongLine<'a> {
    /// Its file.
    pub path: &'a Path,
    /// Its number, from 1.
    pub number: u32,
    pub text: &'a str,
    /// Its points in shares of the picture.
    pub points: &'a [[f64; 2]],
    /// Whether the points are the corners of a rectangle in pixels.
    pub is_rectangle: bool,
}

/// What a line may be if it is no outline.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Form {
    /// A box with so many keypoints, of so many values each.
    Pose([usize; 2]),
    /// A box with its outline.
    BoxAndOutline,
}

/// Lines of one form.
struct Lines {
    count: usize,
    /// File, number and text of the first line.
    first: (PathBuf, u32, String),
}

/// The lines of a data set that are read as outlines.
#[derive(Default)]
pub(super) struct LongLines {
    lines: usize,
    boxes: usize,
    others: BTreeMap<Form, Lines>,
}

impl LongLines {
    /// Counts a line that is a plain box.
    pub fn add_box(&mut self) {
        self.boxes += 1;
    }

    /// Counts a line.
    pub fn add(&mut self, line: &LongLine) {
        self.lines += 1;
        // A pose whose numbers are a rectangle is rarer than one in a million.
        if line.is_rectangle {
            return;
        }
        let shares = line.points.as_flattened();
        let values = [2, 3].into_iter().filter(|values| may_be_pose(shares, *values));
        let poses = values.map(|values| Form::Pose([(shares.len() - 4) / values, values]));
        let boxed = begins_with_box(line.points).then_some(Form::BoxAndOutline);
        for form in poses.chain(boxed) {
            let lines = self.others.entry(form).or_insert_with(|| Lines {
                count: 0,
                first: (line.path.to_owned(), line.number, line.text.to_owned()),
            });
            lines.count += 1;
        }
    }

    /// The first line that may be no outline, and its file, if nearly all lines may be of its form.
    pub fn doubt(self) -> Option<(PathBuf, FileError)> {
        let may_have_poses = 10 * self.boxes < BOXES_OF_TEN * (self.lines + self.boxes);
        let is_doubtful = |(form, lines): &(Form, Lines)| {
            (may_have_poses || *form == Form::BoxAndOutline)
                && 10 * lines.count >= DOUBTFUL_OF_TEN * self.lines
        };
        let (form, Lines { count, first }) = self.others.into_iter().find(is_doubtful)?;
        let (path, number, text) = first;
        let (other, otherwise) = match form {
            Form::Pose([points, values]) => (
                "a box with keypoints",
                format!("`kpt_shape: [{points}, {values}]` if the values behind the fifth are keypoints"),
            ),
            Form::BoxAndOutline => {
                ("a box with its outline", "or keep five values, if the others are an outline".to_owned())
            }
        };
        let message = format!(
            "this may be an outline or {other}, as {count} of {} lines with more values than a box",
            self.lines
        );
        let hint = format!(
            "write into data.yaml, beside `names`: `task: segment` if all values are an outline; `task: obb` if they are \
             corners of a rotated box; {otherwise}"
        );
        Some((path, FileError::at_line(number, &text, message).hint(hint)))
    }
}

/// Whether shares of the picture may be a pose: middle and size of a box in the picture, then keypoints of 2 or 3 `values`, of which the box holds more
/// than half. Three or more of them are no small outline that begins with middle and size. The third value says how well a keypoint is seen. Those at
/// 0, 0 are not labelled.
fn may_be_pose(shares: &[f64], values: usize) -> bool {
    let [x, y, width, height, keypoints @ ..] = shares else { return false };
    if keypoints.is_empty() || !keypoints.len().is_multiple_of(values) {
        return false;
    }
    let [across, down] = [(x, width), (y, height)].map(|(middle, side)| {
        let half = 0.5 * side;
        middle - half - ROUNDING..=middle + half + ROUNDING
    });
    let is_in_picture = [&across, &down]
        .iter()
        .all(|side| *side.start() >= -2.0 * ROUNDING && *side.end() <= 1.0 + 2.0 * ROUNDING);
    if !is_in_picture || *width <= 0.0 || *height <= 0.0 {
        return false;
    }
    let keypoints = keypoints.chunks_exact(values);
    // A larger value is no share: such a line is not read as an outline.
    let are_seen =
        keypoints.clone().all(|point| point.get(2).is_none_or(|seen| *seen == 0.0 || *seen == 1.0));
    let labelled: Vec<&[f64]> = keypoints.filter(|point| point[0] > 0.0 || point[1] > 0.0).collect();
    if labelled.len() > 2 && is_small_outline([[*x, *y], [*width, *height]], &labelled) {
        return false;
    }
    let inside =
        labelled.iter().filter(|point| across.contains(&point[0]) && down.contains(&point[1])).count();
    are_seen && (labelled.is_empty() || 2 * inside > labelled.len())
}

/// Whether points span little of a box of this middle and size, and both of these lie among them, no further away than the points from each other.
fn is_small_outline([middle, size]: [[f64; 2]; 2], points: &[&[f64]]) -> bool {
    let ends = [0, 1].map(|axis| {
        let all = points.iter().map(|point| point[axis]);
        [all.clone().fold(f64::INFINITY, f64::min), all.fold(f64::NEG_INFINITY, f64::max)]
    });
    let spans = ends.map(|[low, high]| high - low);
    let around = spans[0].max(spans[1]);
    (0..2).all(|axis| {
        let [low, high] = ends[axis];
        let is_near = |point: [f64; 2]| (low - around..=high + around).contains(&point[axis]);
        spans[axis] < LEAST_SPAN * size[axis] && is_near(middle) && is_near(size)
    })
}

/// Whether the first two points are the middle and the size of the box around the others, in shares of the picture.
fn begins_with_box(points: &[[f64; 2]]) -> bool {
    let [[x, y], [width, height], others @ ..] = points else { return false };
    let stated = [x - 0.5 * width, y - 0.5 * height, *width, *height];
    // Of a tiny outline, all points are near each other.
    let rounding = ROUNDING.min(0.25 * width.min(*height));
    Bounds::around(others.iter().copied()).is_some_and(|around| {
        stated.iter().zip(<[f64; 4]>::from(around)).all(|(stated, found)| (stated - found).abs() <= rounding)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Adds lines of these shares, as many times as stated.
    fn lines(all: &[(usize, &[f64])]) -> LongLines {
        let mut long = LongLines::default();
        for (times, shares) in all {
            let points: Vec<[f64; 2]> = shares.chunks_exact(2).map(|point| [point[0], point[1]]).collect();
            for _ in 0..*times {
                let path = Path::new("a.txt");
                long.add(&LongLine { path, number: 3, text: "0 0.5", points: &points, is_rectangle: false });
            }
        }
        long
    }

    /// A box and a point in it.
    const POSE: &[f64] = &[0.5, 0.5, 0.2, 0.4, 0.45, 0.35];

    #[test]
    fn a_pose_is_a_box_in_the_picture_with_most_of_its_points() {
        for (shares, values, wanted) in [
            (POSE, 2, true),
            (POSE, 3, false),
            (&[0.5, 0.5, 0.2, 0.4], 2, false),
            // One point outside of one and of three, and a point that is not labelled.
            (&[0.5, 0.5, 0.2, 0.4, 0.45, 0.25], 2, false),
            (&[0.5, 0.5, 0.2, 0.4, 0.45, 0.25, 0.5, 0.6, 0.5, 0.6], 2, true),
            (&[0.5, 0.5, 0.2, 0.4, 0.45, 0.35, 0.0, 0.0], 2, true),
            // Three values, of which the third is 0 or 1.
            (&[0.5, 0.5, 0.2, 0.4, 0.45, 0.35, 1.0, 0.55, 0.35, 0.0], 3, true),
            (&[0.5, 0.5, 0.2, 0.4, 0.45, 0.35, 0.9, 0.55, 0.35, 0.0], 3, false),
            // A small outline, and the corners of a plate in the box of a car.
            (&[0.3, 0.3, 0.34, 0.3, 0.35, 0.33, 0.32, 0.35, 0.29, 0.33], 2, false),
            (&[0.5, 0.5, 0.4, 0.5, 0.46, 0.68, 0.54, 0.68, 0.54, 0.7, 0.46, 0.7], 2, true),
            // A box that reaches out of the picture, and one without height.
            (&[0.8, 0.5, 0.6, 0.4, 0.7, 0.5], 2, false),
            (&[0.5, 0.5, 0.2, 0.0, 0.5, 0.5], 2, false),
        ] {
            assert_eq!(may_be_pose(shares, values), wanted, "{shares:?}, {values}");
        }
    }

    #[test]
    fn lines_together_show_what_they_are() {
        let is_doubtful = |all: &[(usize, &[f64])]| lines(all).doubt().is_some();
        // Outlines in the upper left may be poses each, but with different numbers of points.
        let small = [0.3, 0.3, 0.32, 0.3, 0.4, 0.32, 0.31, 0.4, 0.2, 0.33];
        assert!(is_doubtful(&[(1, &small)]));
        assert!(!is_doubtful(&[(5, &small), (5, &small[..8]), (5, &small[..6])]));
        // One wrong line of ten does not make poses outlines.
        let outside = &[0.8, 0.5, 0.6, 0.4, 0.7, 0.5];
        assert!(is_doubtful(&[(9, POSE), (1, outside)]));
        assert!(!is_doubtful(&[(8, POSE), (1, outside)]));
        // A stray outline in a set of boxes.
        for (boxes, wanted) in [(8, true), (9, false)] {
            let mut long = lines(&[(1, POSE)]);
            (0..boxes).for_each(|_| long.add_box());
            assert_eq!(long.doubt().is_some(), wanted, "{boxes}");
        }
        // Outlines behind their boxes, which a program writes where it has them.
        let mut long = lines(&[(1, &[0.5, 0.5, 0.2, 0.4, 0.4, 0.3, 0.6, 0.3, 0.5, 0.7])]);
        (0..9).for_each(|_| long.add_box());
        assert!(long.doubt().unwrap().1.to_string().contains("keep five values"));
        assert!(lines(&[]).doubt().is_none());
        let (path, error) = lines(&[(10, POSE)]).doubt().unwrap();
        let text = error.to_string();
        assert_eq!((path.as_path(), error.line), (Path::new("a.txt"), Some(3)));
        assert!(text.contains("10 of 10 lines") && text.contains("`kpt_shape: [1, 2]`"), "{text}");
    }

    #[test]
    fn outlines_behind_their_boxes_are_no_outlines() {
        // Three and four points, and the box around them.
        let three = &[0.5, 0.5, 0.2, 0.4, 0.4, 0.3, 0.6, 0.3, 0.5, 0.7];
        let four = &[0.7, 0.7, 0.2, 0.2, 0.6, 0.7, 0.7, 0.6, 0.8, 0.7, 0.7, 0.8];
        let (_, error) = lines(&[(1, three), (1, four)]).doubt().unwrap();
        let text = error.to_string();
        assert!(text.contains("2 of 2 lines") && text.contains("keep five values"), "{text}");
        let tiny = &[0.004, 0.004, 0.008, 0.004, 0.008, 0.01];
        assert!(!begins_with_box(&[[tiny[0], tiny[1]], [tiny[2], tiny[3]], [tiny[4], tiny[5]]]));
        let without_box = &[0.4, 0.3, 0.6, 0.3, 0.5, 0.7];
        assert!(lines(&[(1, three), (1, four), (1, without_box)]).doubt().is_none());
    }

    #[test]
    fn rectangles_are_outlines() {
        let mut long = LongLines::default();
        let points = &[[0.3, 0.3], [0.35, 0.3], [0.35, 0.36], [0.3, 0.36]];
        assert!(may_be_pose(points.as_flattened(), 2));
        long.add(&LongLine { path: Path::new(""), number: 1, text: "", points, is_rectangle: true });
        assert!(long.doubt().is_none());
    }
}
