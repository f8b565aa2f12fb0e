//! YOLO: a text file for each picture with lines `class centre_x centre_y width height` in shares of the picture, and a file with the names of
//! the classes.
//!
//! <https://docs.ultralytics.com/datasets/>. Labels are found as Ultralytics finds them: in the path of a picture the last folder `images`
//! becomes `labels`, and the ending `.txt`; else beside the picture. That covers `images/train/` with `labels/train/`, the exports of Roboflow
//! (`train/images/` with `train/labels/`) and Darknet (labels beside pictures). As there, labels are of the picture that EXIF has turned.
//!
//! The part of a picture is that whose list or folder `data.yaml` names, else that whose list `obj.data` of Darknet names, else that of a list
//! `train.txt`, `val.txt` or `test.txt`, else the one that its own folders are called by. Of several pictures with one
//! file of labels none is used, unless they are copies.
//!
//! A line has one of these forms:
//!
//! | form | values after the class |
//! |---|---|
//! | box | centre and size |
//! | pose, where `data.yaml` has `kpt_shape: [points, values]` | centre and size, then the keypoints, which are not read |
//! | rotated box | four corners |
//! | outline | three or more points |
//!
//! Without `kpt_shape` the lines of poses may look like outlines. A data set of which nearly all such lines may be both is an error, unless `data.yaml` has
//! `task: segment` or `task: obb`.
//!
//! Rotated boxes and outlines give the upright box around them. They are counted. Corners of a rotated box may reach over the border of the
//! picture by half its side; its box is clipped.

use std::collections::{HashMap, HashSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::{Cancel, FileError};

use super::builder::{Builder, Converted, Label};
use super::tree::{ends_with, files_below, have_same_bytes, labels_text, pictures_among, split_of};
use super::yolo_long::{LongLine, LongLines, ROUNDING};
use super::yolo_names::names_of;
use crate::coco::bounds::Bounds;
use crate::coco::defect::DefectKind;
use crate::coco::error::CocoError;
use crate::coco::spelling::composed_path;

/// How far the corners of a rotated box, which are those of a parallelogram, may reach over the border of the picture, in shares of it: the box is
/// clipped. What is further out is in pixels.
const OVERHANG: f64 = 0.5;

/// Reads a folder.
pub(super) fn convert(root: &Path, turned: Option<bool>, cancel: &Cancel) -> Result<Converted, CocoError> {
    let files = files_below(root, cancel)?;
    let mut builder = Builder::of_turned_pictures(turned);
    let page = names_of(root, &files, &mut builder.defects)?;
    let (names, keypoints) = (&page.classes, page.keypoints);
    let labels = LabelFiles::among(&files);
    let mut pictures_of: HashMap<&Path, Vec<&Path>> = HashMap::new();
    for picture in pictures_among(&files) {
        labels.of(picture).into_iter().for_each(|path| pictures_of.entry(path).or_default().push(picture));
    }
    for (number, name) in names.iter().enumerate() {
        if names[..number].contains(name) {
            builder.defects.add(DefectKind::RepeatedClassName, || format!("class {number}: {name:?}"));
        }
        builder.category(name);
    }
    // Labels that are of no picture, and the names of their pictures: these are no background.
    let lost: Vec<&Path> = labels.all().filter(|path| is_lost(path, &pictures_of)).collect();
    let lost_names: HashSet<&OsStr> = lost.iter().filter_map(|path| path.file_stem()).collect();
    let mut long_lines = LongLines::default();
    for picture in pictures_among(&files) {
        cancel.check()?;
        let below = picture.strip_prefix(root).unwrap_or(picture);
        let split = page.parts.part_of(below).or_else(|| split_of(below));
        let path = labels.of(picture);
        let of_same = path.map_or(&[][..], |path| pictures_of[path].as_slice());
        match one_of_copies(of_same) {
            Some(first) if first != picture => continue,
            None if of_same.len() > 1 => {
                if of_same[0] == picture {
                    let said = || {
                        let names: Vec<String> =
                            of_same.iter().map(|path| path.display().to_string()).collect();
                        format!("{}: {}", path.unwrap_or(picture).display(), names.join(" or "))
                    };
                    builder.defects.add(DefectKind::SeveralPictures, said);
                }
                continue;
            }
            _ => {}
        }
        let Some(image) = builder.picture(root, picture, split) else { continue };
        let id = image.id;
        let (width, height) = builder.labelled_size(id);
        let size = [f64::from(width), f64::from(height)];
        let Some(path) = path else {
            if picture.file_stem().is_some_and(|stem| lost_names.contains(stem)) {
                builder.lose_label(id);
            }
            continue;
        };
        let text = labels_text(path)?;
        for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
            let read = parse_line(number, line, names.len(), keypoints);
            let Some((class, shape)) = builder.understood(path, read) else { continue };
            let place = || format!("{}: line {number}", path.display());
            let pixels = |[x, y]: [f64; 2]| [x * size[0], y * size[1]];
            let bounds = match shape {
                Shape::Box([x, y, width, height], keypoints) => {
                    if keypoints {
                        builder.unread("keypoints");
                    } else {
                        long_lines.add_box();
                    }
                    Some(Bounds::from([x * size[0], y * size[1], width * size[0], height * size[1]]))
                }
                Shape::Points(shares) => {
                    let points: Vec<[f64; 2]> = shares.iter().copied().map(pixels).collect();
                    let is_rectangle = is_rectangle(&points);
                    long_lines.add(&LongLine { path, number, text: line, points: &shares, is_rectangle });
                    let is_rotated = is_rotated_box(&points);
                    let kind = if is_rotated { DefectKind::RotatedBox } else { DefectKind::OutlineBox };
                    builder.defects.add(kind, place);
                    Bounds::around(points)
                }
            };
            match bounds {
                Some(bounds) => builder.object(id, Label::new(&names[class], bounds)),
                None => builder.lose_label(id),
            }
        }
    }
    if let Some((path, error)) = long_lines.doubt().filter(|_| !page.has_outlines) {
        builder.wrong(&path, error);
    }
    if pictures_of.is_empty() {
        let hint = "name the folder that holds `images` and `labels`, or `train/images` and `train/labels`; for a file in COCO format \
                    no conversion is needed: `petzval data check FILE`";
        return Err(CocoError::content(root, "no picture here has a file of labels", hint));
    }
    for path in lost {
        builder.defects.add(DefectKind::MissingPicture, || format!("no picture for {}", path.display()));
    }
    builder.finish("YOLO")
}

/// Whether a file in a folder `labels` is of no picture. Elsewhere texts may be anything.
fn is_lost(path: &Path, pictures_of: &HashMap<&Path, Vec<&Path>>) -> bool {
    let is_in_labels = path.parent().is_some_and(|p| p.iter().any(|name| name.eq_ignore_ascii_case(LABELS)));
    let names_classes = path.file_name() == Some(OsStr::new("classes.txt"));
    is_in_labels && !names_classes && !pictures_of.contains_key(path)
}

/// The first of some pictures, if the others are copies of it.
fn one_of_copies<'f>(pictures: &[&'f Path]) -> Option<&'f Path> {
    let (first, others) = pictures.split_first()?;
    others.iter().all(|other| have_same_bytes(first, other)).then_some(first)
}

/// The folder of labels, and that of pictures in its place.
const LABELS: &str = "labels";
const IMAGES: &str = "images";

/// The files of labels of a data set. Some programs write `Labels` or `.TXT`, and archives of macOS have other forms of letters.
struct LabelFiles<'f>(HashMap<PathBuf, &'f Path>);

impl<'f> LabelFiles<'f> {
    fn among(files: &'f [PathBuf]) -> Self {
        let mut by_place: HashMap<PathBuf, &Path> = HashMap::new();
        for path in files.iter().filter(|path| ends_with(path, "txt")) {
            // The usual spelling comes before another one of the same name.
            let place = in_usual_letters(path);
            let is_usual = place == *path;
            let first = by_place.entry(place).or_insert(path);
            if is_usual {
                *first = path;
            }
        }
        Self(by_place)
    }

    /// The labels of a picture.
    fn of(&self, picture: &Path) -> Option<&'f Path> {
        label_files(picture).iter().find_map(|path| self.0.get(&in_usual_letters(path)).copied())
    }

    fn all(&self) -> impl Iterator<Item = &'f Path> {
        let mut all: Vec<&Path> = self.0.values().copied().collect();
        all.sort();
        all.into_iter()
    }
}

/// The path of a file of labels with `labels` and `.txt` in small letters, and all letters in one form.
fn in_usual_letters(path: &Path) -> PathBuf {
    let path = composed_path(path);
    let parts: PathBuf = (path.iter())
        .map(|name| if name.eq_ignore_ascii_case(LABELS) { OsStr::new(LABELS) } else { name })
        .collect();
    if ends_with(&parts, "txt") { parts.with_extension("txt") } else { parts }
}

/// Where the labels of a picture may be.
fn label_files(picture: &Path) -> Vec<PathBuf> {
    let parts: Vec<&OsStr> = picture.iter().collect();
    let folder = parts.iter().rposition(|part| part.eq_ignore_ascii_case(IMAGES));
    let in_labels = folder.map(|at| {
        let parts = parts.iter().enumerate().map(|(i, part)| if i == at { OsStr::new(LABELS) } else { part });
        parts.collect::<PathBuf>().with_extension("txt")
    });
    in_labels.into_iter().chain([picture.with_extension("txt")]).collect()
}

/// What a line says of an object, in shares of the picture.
#[derive(Debug, PartialEq)]
enum Shape {
    /// Left edge, upper edge, width and height, and whether keypoints follow.
    Box([f64; 4], bool),
    /// Corners of a rotated box, or an outline.
    Points(Vec<[f64; 2]>),
}

/// Class and shape. With `keypoints`, the points of a pose and the values of each, a line is a box with or without them.
fn parse_line(
    number: u32,
    line: &str,
    classes: usize,
    keypoints: Option<[usize; 2]>,
) -> Result<(usize, Shape), FileError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let of_pose = keypoints.map(|[points, values]| 5 + points * values);
    let is_outline = of_pose.is_none() && words.len() >= 7 && words.len() % 2 == 1;
    let is_pose = of_pose == Some(words.len());
    if words.len() != 5 && !is_outline && !is_pose {
        let hint = match (of_pose, words.len()) {
            (Some(wanted), _) => {
                format!("give 5 values, a box, or the {wanted} of a box with the keypoints of `kpt_shape`")
            }
            (None, 6) => "give `class centre_x centre_y width height`; a score or the number of a track is no part of a label".to_owned(),
            (None, _) => "give `class centre_x centre_y width height`, or a class and the points of an outline; keypoints need \
                          `kpt_shape: [points, values]` in data.yaml"
                .to_owned(),
        };
        return Err(
            FileError::at_line(number, line, format!("the line has {} values", words.len())).hint(hint)
        );
    }
    let class = words[0].parse().ok().filter(|v: &f64| *v >= 0.0 && v.fract() == 0.0);
    let class = class.filter(|v| *v < classes as f64).ok_or_else(|| {
        FileError::at_line(number, words[0], format!("there is no class of this number among {classes}"))
            .hint("classes are numbered from 0, in the order of `names`")
    })?;
    let mut shares = Vec::with_capacity(words.len() - 1);
    for word in &words[1..] {
        let share = word.parse().ok().filter(|v: &f64| v.is_finite());
        let Some(share) = share else {
            return Err(FileError::at_line(number, word, "this is no number")
                .hint("write a finite number, with a point"));
        };
        shares.push(share);
    }
    let over = if is_outline && is_parallelogram(&shares) { OVERHANG } else { ROUNDING };
    // Keypoints are not read: some programs write points that are not seen as -1, and how well one is seen as 2.
    let read = if is_pose { 4 } else { shares.len() };
    let is_out = |share: &f64| !(-over..=1.0 + over).contains(share);
    if let Some(at) = shares[..read].iter().position(is_out) {
        let reason = "this is no share of the picture, 0 to 1";
        return Err(FileError::at_line(number, words[1 + at], reason)
            .hint("divide pixels by the width or height of the picture"));
    }
    let shape = match shares[..] {
        [x, y, width, height, ..] if !is_outline => {
            Shape::Box([x - 0.5 * width, y - 0.5 * height, width, height], is_pose)
        }
        _ => Shape::Points(shares.chunks_exact(2).map(|point| [point[0], point[1]]).collect()),
    };
    Ok((class as usize, shape))
}

/// Whether values are the x and y of the corners of a parallelogram, in shares of the picture and up to rounding: a rotated rectangle is one.
fn is_parallelogram(shares: &[f64]) -> bool {
    let [ax, ay, bx, by, cx, cy, dx, dy] = *shares else { return false };
    [ax + cx - bx - dx, ay + cy - by - dy].iter().all(|off| off.abs() <= 2.0 * ROUNDING)
}

/// Whether points, in pixels, are the corners of a rectangle. Corners may be a pixel off.
fn is_rectangle(points: &[[f64; 2]]) -> bool {
    let [a, b, c, d] = points else { return false };
    let middle_is_one = (0..2).all(|k| (a[k] + c[k] - b[k] - d[k]).abs() <= 2.0);
    let diagonal = |p: &[f64; 2], q: &[f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
    middle_is_one && (diagonal(a, c) - diagonal(b, d)).abs() <= 2.0
}

/// Whether points, in pixels, are the corners of a rectangle whose edges are not those of the picture. Corners may be a pixel off.
fn is_rotated_box(points: &[[f64; 2]]) -> bool {
    let [a, b, c, _] = points else { return false };
    let is_upright = (0..2).any(|k| (a[k] - b[k]).abs() <= 1.0) && (0..2).any(|k| (b[k] - c[k]).abs() <= 1.0);
    is_rectangle(points) && !is_upright
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_where_the_layouts_have_them() {
        let of = |path: &str| label_files(Path::new(path));
        assert_eq!(of("a/train/images/b.jpg")[0], Path::new("a/train/labels/b.txt"));
        assert_eq!(of("images/images/val/b.c.png")[0], Path::new("images/labels/val/b.c.txt"));
        assert_eq!(of("a/b.jpg"), [Path::new("a/b.txt")]);
    }

    #[test]
    fn a_line_gives_its_shape_in_shares() {
        let box_of = |keypoints| (1, Shape::Box([0.25, 0.125, 0.5, 0.25], keypoints));
        assert_eq!(parse_line(1, "1 0.5 0.25 0.5 0.25", 2, None).unwrap(), box_of(false));
        let outline = vec![[0.25, 0.5], [0.75, 0.5], [0.5, 0.75]];
        let read = parse_line(1, "1.0 0.25 0.5 0.75 0.5 0.5 0.75", 2, None).unwrap();
        assert_eq!(read, (1, Shape::Points(outline)));
        // Corners of a rotated box reach over the border, in shares; points of outlines do not, nor corners in pixels.
        let corners = "1 0.9 0.4 1.02 0.5 0.9 0.6 0.78 0.5";
        let over = vec![[0.9, 0.4], [1.02, 0.5], [0.9, 0.6], [0.78, 0.5]];
        assert_eq!(parse_line(1, corners, 2, None).unwrap(), (1, Shape::Points(over)));
        for wrong in [
            "1 0.9 0.4 1.02 0.5 0.9 0.6 -0.2 0.5",
            "1 0.9 0.4 1.6 0.5 0.9 0.6 0.2 0.5",
            "1 0.9 0.4 1.02 0.5 0.9 0.6",
        ] {
            let error = parse_line(1, wrong, 2, None).unwrap_err().to_string();
            assert!(error.contains("no share of the picture"), "{error}");
        }
        // The same line is a box with one keypoint where the file of the names says so, and keypoints may lie outside.
        let pose = "1 0.5 0.25 0.5 0.25 0.3 0.2 2";
        assert_eq!(parse_line(1, pose, 2, Some([1, 3])).unwrap(), box_of(true));
        assert_eq!(parse_line(1, "1 0.5 0.25 0.5 0.25 -1 9", 2, Some([1, 2])).unwrap(), box_of(true));
        assert_eq!(parse_line(1, "1 0.5 0.25 0.5 0.25", 2, Some([1, 3])).unwrap(), box_of(false));
        let error = parse_line(4, "1 0.25 0.5 0.75 0.5 0.5 0.75", 2, Some([4, 2])).unwrap_err();
        assert!(error.to_string().contains("has 7 values") && error.to_string().contains("the 13 of a box"));
        for (line, value, needle) in [
            ("1 0.5 0.25 0.5", "1 0.5 0.25 0.5", "has 4 values"),
            ("1 0.5 0.25 0.5 0.1 0.9", "1 0.5 0.25 0.5 0.1 0.9", "has 6 values"),
            ("1 0.5 0.25 0.5 0.1 0.9 0.8 2", "1 0.5 0.25 0.5 0.1 0.9 0.8 2", "has 8 values"),
            ("2 0.5 0.25 0.5 0.1", "2", "no class of this number among 2"),
            ("car 0.5 0.25 0.5 0.1", "car", "no class"),
            ("1 0.5 0.25 inf 0.1", "inf", "no number"),
            ("1 208 0.25 0.5 0.1", "208", "no share"),
        ] {
            let error = parse_line(4, line, 2, None).unwrap_err();
            assert_eq!((error.line, error.value.as_str()), (Some(4), value));
            assert!(error.message.contains(needle) && error.hint.is_some(), "{error}");
        }
    }

    #[test]
    fn rotated_boxes_are_known_by_their_corners() {
        assert!(is_rotated_box(&[[10.0, 0.0], [20.0, 10.0], [10.0, 20.0], [0.0, 10.0]]));
        for points in [
            &[[0.0, 0.0], [20.0, 0.0], [20.0, 10.0], [0.0, 10.0]][..],
            &[[0.0, 0.0], [0.0, 10.0], [20.0, 10.0], [20.0, 0.0]],
            &[[10.0, 0.0], [20.0, 10.0], [10.0, 30.0], [0.0, 10.0]],
            &[[10.0, 0.0], [20.0, 10.0], [10.0, 20.0]],
        ] {
            assert!(!is_rotated_box(points), "{points:?}");
        }
    }
}
