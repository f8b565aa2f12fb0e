//! What the labels of KITTI's benchmarks have in common: where their files lie, what a line says, and regions without labels.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use petzval_base::{Cancel, FileError};

use super::builder::{Builder, Label};
use super::tree::{ends_with, files_below, split_of};
use crate::coco::bounds::Bounds;
use crate::coco::data_set::Attribute;
use crate::coco::defect::DefectKind;
use crate::coco::error::CocoError;

/// Values of a line; detections have one more, the score.
const VALUES: [usize; 2] = [15, 16];

/// The values of a line behind the class.
const NAMES: [&str; 15] = [
    "truncated",
    "occluded",
    "alpha",
    "left",
    "top",
    "right",
    "bottom",
    "height",
    "width",
    "length",
    "x",
    "y",
    "z",
    "rotation_y",
    "score",
];

/// The value of `truncated` and `occluded` that is not known, as in regions and results.
const UNKNOWN: f64 = -1.0;

/// Largest value of `truncated`: shares end at 1, the numbers of tracks at 2.
const MOST_TRUNCATED: f64 = 2.0;

/// The class of regions without labels.
const REGION: &str = "DontCare";

/// A line of a file of labels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Line {
    class: String,
    truncated: f64,
    occluded: f64,
    pub bounds: Bounds,
    /// How sure a detector was; labels have none.
    score: Option<f64>,
    /// The number of the object in its film, where the labels are of tracks.
    pub track: Option<i32>,
}

/// The files of a folder of KITTI.
pub(super) struct Files {
    /// Files of labels.
    pub labels: Vec<PathBuf>,
    /// Files in the folder of pictures.
    pub pictures: Vec<PathBuf>,
    /// The part that the name of the folder says.
    pub split: Option<String>,
}

impl Files {
    /// Those in these folders of labels and of pictures. Fails where there are none for pictures.
    pub fn of(base: &Path, [labels, pictures]: [&str; 2], cancel: &Cancel) -> Result<Self, CocoError> {
        let labels = files_below(&base.join(labels), cancel)?.into_iter().filter(|p| ends_with(p, "txt"));
        let folder = base.join(pictures);
        if !folder.is_dir() {
            return Err(CocoError::content(&folder, "there is no such folder", "put the pictures there"));
        }
        let pictures = files_below(&folder, cancel)?;
        let split = base.file_name().and_then(|name| split_of(Path::new(name)));
        Ok(Self { labels: labels.collect(), pictures, split })
    }
}

/// Regions whose objects have no labels, with the number of their picture.
#[derive(Default)]
pub(super) struct Regions(Vec<(u64, Bounds)>);

impl Regions {
    /// Adds the object of a line, or keeps the region. `place` names the line.
    pub fn add_line(&mut self, builder: &mut Builder, image_id: u64, line: Line, place: &dyn Fn() -> String) {
        if line.class == REGION {
            self.0.push((image_id, line.bounds));
            return;
        }
        if line.score.is_some() {
            builder.defects.add(DefectKind::ScoredLabel, place);
        }
        let attributes = [
            ("truncated", Some(line.truncated)),
            ("occluded", Some(line.occluded)),
            ("score", line.score),
            ("track", line.track.map(f64::from)),
        ];
        let known = attributes.into_iter().filter_map(|(name, value)| Some((name, value?)));
        let attributes = known.map(|(name, value)| (name.to_owned(), Attribute::Number(value))).collect();
        builder.object(image_id, Label { attributes, ..Label::new(&line.class, line.bounds) });
    }

    /// Makes each region a crowd of every class.
    pub fn become_crowds(&self, builder: &mut Builder) {
        let attributes = BTreeMap::from([("region".to_owned(), Attribute::Text(REGION.to_owned()))]);
        for class in builder.class_names() {
            for (id, bounds) in &self.0 {
                let attributes = attributes.clone();
                let crowd = Label { crowd: true, ignore: true, attributes, ..Label::new(&class, *bounds) };
                builder.object(*id, crowd);
            }
        }
    }
}

/// A line of a file of labels of [detection](super::kitti).
pub(super) fn parse_line(number: u32, line: &str) -> Result<Line, FileError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    line_of(number, line, &words)
}

/// A line whose values for detection are `words`. Fails where the count of values is another, where one is no finite number, and where `truncated`
/// or `occluded` has a value that KITTI does not have.
pub(super) fn line_of(number: u32, line: &str, words: &[&str]) -> Result<Line, FileError> {
    if !VALUES.contains(&words.len()) {
        return Err(FileError::at_line(number, line, format!("the line has {} values", words.len()))
            .hint("give 15: type truncated occluded alpha left top right bottom height width length x y z rotation_y"));
    }
    let value = |i: usize, name: &str| -> Result<f64, FileError> {
        words[i].parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| {
            let message = format!("`{name}` is no number");
            FileError::at_line(number, words[i], message).hint("write a finite number, with a point")
        })
    };
    let mut numbers = Vec::with_capacity(NAMES.len());
    for (i, name) in (1..words.len()).zip(NAMES) {
        numbers.push(value(i, name)?);
    }
    let bounds = Bounds::between(numbers[3], numbers[4], numbers[5], numbers[6]);
    let [truncated, occluded] = [numbers[0], numbers[1]];
    let unknown = |i: usize, hint: &str| {
        FileError::at_line(number, words[i], format!("`{}` has no such value", NAMES[i - 1])).hint(hint)
    };
    if truncated != UNKNOWN && !(0.0..=MOST_TRUNCATED).contains(&truncated) {
        return Err(unknown(
            1,
            "write a share from 0 to 1, for tracks 0, 1 or 2, or -1 where it is not known",
        ));
    }
    if ![UNKNOWN, 0.0, 1.0, 2.0, 3.0].contains(&occluded) {
        return Err(unknown(2, "write 0, 1, 2 or 3, or -1 where it is not known"));
    }
    let (class, score) = (words[0].to_owned(), numbers.get(14).copied());
    Ok(Line { class, truncated, occluded, bounds, score, track: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_gives_class_and_corners() {
        let line = "Car 0.25 1 -1.57 10.5 20 110.5 70 1.5 1.6 3.9 1 2 30 -1.5";
        let found = parse_line(3, line).unwrap();
        assert_eq!(found.bounds, Bounds::from([10.5, 20.0, 100.0, 50.0]));
        assert_eq!((found.class.as_str(), found.truncated, found.occluded), ("Car", 0.25, 1.0));
        assert_eq!(found.score, None);
        assert_eq!(parse_line(3, &format!("{line} 0.875")).unwrap().score, Some(0.875));
        for (line, value, needle) in [
            ("Car 0.25 1 -1.57 10.5 20", "Car 0.25 1 -1.57 10.5 20", "has 6 values"),
            ("Car 0.25 1 -1.57 10,5 20 110.5 70 1.5 1.6 3.9 1 2 30 -1.5", "10,5", "`left` is no number"),
            ("Car 0.25 1 -1.57 10.5 20 nan 70 1.5 1.6 3.9 1 2 30 -1.5", "nan", "`right` is no number"),
            ("Car 0.25 1 -1.57 10.5 20 110.5 70 1.5 1.6 3.9 car 2 30 -1.5", "car", "`x` is no number"),
            // `rotation_y` is missing.
            (
                "Car 0 1 -1.57 10.5 20 110.5 70 1.5 1.6 3.9 1 2 30",
                "Car 0 1 -1.57 10.5 20 110.5 70 1.5 1.6 3.9 1 2 30",
                "has 14 values",
            ),
            ("Car 0 7 -1.57 10.5 20 110.5 70 1.5 1.6 3.9 1 2 30 -1.5", "7", "`occluded` has no such value"),
            (
                "Car 0 0.5 -1.57 10.5 20 110.5 70 1.5 1.6 3.9 1 2 30 -1.5",
                "0.5",
                "`occluded` has no such value",
            ),
            ("Car 3 1 -1.57 10.5 20 110.5 70 1.5 1.6 3.9 1 2 30 -1.5", "3", "`truncated` has no such value"),
        ] {
            let error = parse_line(3, line).unwrap_err();
            assert_eq!((error.line, error.value.as_str()), (Some(3), value));
            assert!(error.message.contains(needle) && error.hint.is_some(), "{error}");
        }
    }
}
