//! YOLO: a text file for each picture with lines `class centre_x centre_y width height` in shares of the picture, and a file with the names of
//! the classes.
//!
//! <https://docs.ultralytics.com/datasets/detect/>. Labels are found as Ultralytics finds them: in the path of a picture the last folder `images`
//! becomes `labels`, and the ending `.txt`; else beside the picture. That covers `images/train/` with `labels/train/`, the exports of Roboflow
//! (`train/images/` with `train/labels/`) and Darknet (labels beside pictures). A line with an outline of three or more points gives its bounds.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::FileError;

use super::builder::{Builder, Converted, Label};
use super::tree::{ends_with, files_below, is_picture, labels_text, split_of};
use crate::coco::bounds::Bounds;
use crate::coco::defect::DefectKind;
use crate::coco::error::CocoError;
use crate::yaml::{self, Node, Value};

/// Shares may exceed 0..1 by rounding; what is further out is in pixels.
const ROUNDING: f64 = 0.01;

/// Reads a folder.
pub(super) fn convert_yolo(root: &Path) -> Result<Converted, CocoError> {
    let files = files_below(root)?;
    let names = class_names(root, &files)?;
    let labels: HashSet<&Path> = files.iter().filter(|p| ends_with(p, "txt")).map(PathBuf::as_path).collect();
    let mut builder = Builder::default();
    for name in &names {
        builder.category(name);
    }
    let mut used = HashSet::new();
    for picture in files.iter().filter(|path| is_picture(path)) {
        let split = split_of(picture.strip_prefix(root).unwrap_or(picture));
        let Some(image) = builder.picture(root, picture, split) else { continue };
        let (id, size) = (image.id, [f64::from(image.width), f64::from(image.height)]);
        let Some(path) = label_files(picture).into_iter().find(|path| labels.contains(path.as_path())) else {
            continue;
        };
        let text = labels_text(&path)?;
        for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
            match parse_line(number, line, names.len()) {
                Ok((class, [x, y, width, height])) => {
                    let bounds = [x * size[0], y * size[1], width * size[0], height * size[1]];
                    builder.object(id, Label::new(&names[class], Bounds::from(bounds)));
                }
                Err(error) => builder.wrong(&path, error),
            }
        }
        used.insert(path);
    }
    if used.is_empty() {
        let hint = "name the folder that holds `images` and `labels`, or `train/images` and `train/labels`; for a file in COCO format \
                    no conversion is needed: `petzval data check FILE`";
        return Err(CocoError::content(root, "no picture here has a file of labels", hint));
    }
    for path in labels {
        let is_in_labels = path.parent().is_some_and(|p| p.components().any(|c| c.as_os_str() == "labels"));
        let names_classes = path.file_name() == Some(OsStr::new("classes.txt"));
        if is_in_labels && !names_classes && !used.contains(path) {
            builder.defects.add(DefectKind::MissingPicture, || format!("no picture for {}", path.display()));
        }
    }
    builder.finish("YOLO")
}

/// Where the labels of a picture may be.
fn label_files(picture: &Path) -> Vec<PathBuf> {
    let parts: Vec<&OsStr> = picture.iter().collect();
    let folder = parts.iter().rposition(|part| *part == "images");
    let in_labels = folder.map(|at| {
        let parts =
            parts.iter().enumerate().map(|(i, part)| if i == at { OsStr::new("labels") } else { part });
        parts.collect::<PathBuf>().with_extension("txt")
    });
    in_labels.into_iter().chain([picture.with_extension("txt")]).collect()
}

/// Class and bounds, in shares of the picture.
fn parse_line(number: u32, line: &str, classes: usize) -> Result<(usize, [f64; 4]), FileError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let is_outline = words.len() >= 7 && words.len() % 2 == 1;
    if words.len() != 5 && !is_outline {
        return Err(FileError::at_line(number, line, format!("the line has {} values", words.len()))
            .hint("give `class centre_x centre_y width height`, or a class and the points of an outline"));
    }
    let class = words[0].parse().ok().filter(|v: &f64| *v >= 0.0 && v.fract() == 0.0);
    let class = class.filter(|v| *v < classes as f64).ok_or_else(|| {
        let message = format!("there is no class of this number among {classes}");
        FileError::at_line(number, words[0], message)
            .hint("classes are numbered from 0, in the order of `names`")
    })?;
    let mut shares = Vec::with_capacity(words.len() - 1);
    for word in &words[1..] {
        let share = word.parse().ok().filter(|v: &f64| v.is_finite());
        let Some(share) = share else {
            return Err(FileError::at_line(number, word, "this is no number")
                .hint("write a finite number, with a point"));
        };
        if !(-ROUNDING..=1.0 + ROUNDING).contains(&share) {
            return Err(FileError::at_line(number, word, "this is no share of the picture, 0 to 1")
                .hint("divide pixels by the width or height of the picture"));
        }
        shares.push(share);
    }
    let bounds = match shares[..] {
        [x, y, width, height] => [x - 0.5 * width, y - 0.5 * height, width, height],
        _ => {
            let ends = |first: usize| {
                let along = || shares.iter().skip(first).step_by(2).copied();
                (along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max))
            };
            let ((left, right), (top, bottom)) = (ends(0), ends(1));
            [left, top, right - left, bottom - top]
        }
    };
    Ok((class as usize, bounds))
}

/// The names of the classes, from `data.yaml`, `classes.txt` or a file `.names`.
fn class_names(root: &Path, files: &[PathBuf]) -> Result<Vec<String>, CocoError> {
    let at_top = |path: &&PathBuf| path.parent() == Some(root);
    let is_yaml = |path: &&PathBuf| ends_with(path, "yaml") || ends_with(path, "yml");
    let mut candidates: Vec<&PathBuf> = files.iter().filter(at_top).filter(is_yaml).collect();
    candidates.sort_by_key(|path| path.file_stem() != Some(OsStr::new("data")));
    for path in &candidates {
        let text = labels_text(path)?;
        let page = yaml::parse(&text).map_err(|error| CocoError::file(path, with_hint(error)))?;
        if let Some(names) = page.get("names") {
            return yaml_names(&page, names).map_err(|error| CocoError::file(path, error));
        }
    }
    let is_list =
        |path: &&PathBuf| path.file_name() == Some(OsStr::new("classes.txt")) || ends_with(path, "names");
    if let Some(path) = files.iter().find(is_list) {
        let text = labels_text(path)?;
        let names: Vec<String> =
            text.lines().map(str::trim).filter(|l| !l.is_empty()).map(str::to_owned).collect();
        return match names.is_empty() {
            false => Ok(names),
            true => Err(CocoError::content(path, "the file names no class", "write one name in a line")),
        };
    }
    let reason = match candidates.first() {
        Some(path) => format!("{} has no `names`", path.display()),
        None => "no file names the classes".to_owned(),
    };
    Err(CocoError::content(
        root,
        reason,
        "add `data.yaml` with a list `names:`, or `classes.txt` with one name in a line",
    ))
}

/// An error of the YAML reader, which has no hint for some mistakes.
fn with_hint(error: FileError) -> FileError {
    match error.hint {
        Some(_) => error,
        None => {
            error.hint("write `names: [first, second]`, with names in quotes where they hold punctuation")
        }
    }
}

/// `names` as a list, or as a table of numbers and names; `nc`, if there, must be their number.
fn yaml_names(page: &Node, names: &Node) -> Result<Vec<String>, FileError> {
    let name = |node: &Node| match node.text().filter(|text| !text.is_empty()) {
        Some(text) => Ok(text.to_owned()),
        None => Err(node.error("names", "this is no name").hint("write one name for each class")),
    };
    let list: Vec<String> = match &names.value {
        Value::Map(entries) => {
            let mut list = vec![String::new(); entries.len()];
            for (key, node) in entries {
                let free = key.trim().parse().ok().filter(|i: &usize| *i < list.len() && list[*i].is_empty());
                let Some(i) = free else {
                    let message = format!("`{key}` is not one of the numbers 0 to {}", list.len() - 1);
                    return Err(node.error("names", message).hint("number the classes from 0, without gaps"));
                };
                list[i] = name(node)?;
            }
            list
        }
        _ => names.list().iter().map(name).collect::<Result<_, _>>()?,
    };
    if list.is_empty() {
        return Err(names.error("names", "there is no class").hint("write one name for each class"));
    }
    if let Some(count) = page.get("nc")
        && count.text() != Some(list.len().to_string().as_str())
    {
        let message = format!("`names` lists {}", list.len());
        return Err(count.error("nc", message).hint("write the number of names, or leave `nc` out"));
    }
    Ok(list)
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
    fn a_line_gives_bounds_in_shares() {
        assert_eq!(parse_line(1, "1 0.5 0.25 0.5 0.25", 2).unwrap(), (1, [0.25, 0.125, 0.5, 0.25]));
        assert_eq!(parse_line(1, "1.0 0.25 0.5 0.75 0.5 0.5 0.75", 2).unwrap(), (1, [0.25, 0.5, 0.5, 0.25]));
        for (line, value, needle) in [
            ("1 0.5 0.25 0.5", "1 0.5 0.25 0.5", "has 4 values"),
            ("1 0.5 0.25 0.5 0.1 0.9", "1 0.5 0.25 0.5 0.1 0.9", "has 6 values"),
            ("2 0.5 0.25 0.5 0.1", "2", "no class of this number among 2"),
            ("car 0.5 0.25 0.5 0.1", "car", "no class"),
            ("1 0.5 0.25 inf 0.1", "inf", "no number"),
            ("1 208 0.25 0.5 0.1", "208", "no share"),
        ] {
            let error = parse_line(4, line, 2).unwrap_err();
            assert_eq!((error.line, error.value.as_str()), (Some(4), value));
            assert!(error.message.contains(needle) && error.hint.is_some(), "{error}");
        }
    }

    #[test]
    fn names_are_a_list_or_a_table() {
        let of = |text: &str| {
            let page = yaml::parse(text).unwrap();
            yaml_names(&page, page.get("names").unwrap())
        };
        let wanted = ["green".to_owned(), "red".to_owned()];
        for text in [
            "names:\n- green\n- red\nnc: 2\n",
            "names: ['green', \"red\"]\n",
            "names:\n  1: red\n  0: green\n",
        ] {
            assert_eq!(of(text).unwrap(), wanted);
        }
        for (text, line) in
            [("names: [a, b]\nnc: 3\n", 2), ("names:\n  0: a\n  2: b\n", 3), ("names: [[a]]\n", 1)]
        {
            assert_eq!(of(text).unwrap_err().line, Some(line), "{text}");
        }
    }
}
