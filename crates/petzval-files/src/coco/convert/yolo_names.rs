//! The file of class names of a YOLO data set: `data.yaml`, `classes.txt` or a file `.names`.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::FileError;

use super::tree::{ends_with, labels_text};
use super::yolo_parts::{Files, Parts};
use crate::coco::defect::Defects;
use crate::coco::error::CocoError;
use crate::yaml::{self, Node, Value};

/// What the file of class names says.
#[derive(Debug)]
pub(super) struct Names {
    /// The classes, in the order of their numbers.
    pub classes: Vec<String>,
    /// Keypoints of each object and the values of each, 2 or 3; `None` where labels are no poses.
    pub keypoints: Option<[usize; 2]>,
    /// Whether the file says that lines longer than a box are outlines or rotated boxes.
    pub has_outlines: bool,
    /// The parts of the pictures.
    pub parts: Parts,
}

impl Names {
    fn of_classes(classes: Vec<String>) -> Self {
        Self { classes, keypoints: None, has_outlines: false, parts: Parts::default() }
    }
}

/// The names of the classes, from `data.yaml`, `classes.txt` or a file `.names`. Fails where two of these files give a number to different classes.
pub(super) fn names_of(root: &Path, files: &[PathBuf], defects: &mut Defects) -> Result<Names, CocoError> {
    let is_yaml = |path: &&PathBuf| ends_with(path, "yaml") || ends_with(path, "yml");
    let is_data = |path: &&PathBuf| path.file_stem() == Some(OsStr::new("data"));
    let at_top = |path: &&PathBuf| path.parent() == Some(root);
    let mut pages: Vec<&PathBuf> = files.iter().filter(is_yaml).filter(|p| at_top(p) || is_data(p)).collect();
    pages.sort_by_key(|path| (!at_top(path), !is_data(path)));
    let is_list =
        |path: &&PathBuf| path.file_name() == Some(OsStr::new("classes.txt")) || ends_with(path, "names");
    let set = Files::below(root, files);
    let mut found: Option<(&Path, Names)> = None;
    for path in &pages {
        let read = names_of_page(path);
        let (page, read) = match read {
            Ok(Some(read)) => read,
            // The first file with names counts. Others are compared where they can be read.
            Ok(None) => continue,
            Err(error) if found.is_none() && at_top(path) => return Err(error),
            Err(_) => continue,
        };
        match &found {
            Some((first, names)) => check_agree((first, &names.classes), (path, &read.classes))?,
            None if at_top(path) => {
                let parts = Parts::of_page((path, &page), &set, defects)?;
                found = Some((path.as_path(), Names { parts, ..read }));
            }
            None => {}
        }
    }
    let is_of_page = found.is_some();
    for path in files.iter().filter(is_list) {
        let text = labels_text(path)?;
        let classes: Vec<String> =
            text.lines().map(str::trim).filter(|l| !l.is_empty()).map(str::to_owned).collect();
        match &found {
            Some((first, names)) => {
                check_agree((first, &names.classes), (path, &classes))?;
                // Programs write the classes that they have met so far.
                if !is_of_page && classes.len() > names.classes.len() {
                    found = Some((path.as_path(), Names::of_classes(classes)));
                }
            }
            None if classes.is_empty() => {
                return Err(CocoError::content(path, "the file names no class", "write one name in a line"));
            }
            None => found = Some((path.as_path(), Names::of_classes(classes))),
        }
    }
    if let Some((_, mut names)) = found {
        if names.parts.is_empty() {
            names.parts = Parts::of_lists(&set, defects)?;
        }
        return Ok(names);
    }
    let reason = match pages.iter().find(|path| at_top(path)) {
        Some(path) => format!("{} has no `names`", path.display()),
        None => "no file names the classes".to_owned(),
    };
    let hint = "add `data.yaml` with a list `names:`, or `classes.txt` with one name in a line";
    Err(CocoError::content(root, reason, hint))
}

/// The page of a YAML file, and its classes; `None` without `names`.
fn names_of_page(path: &Path) -> Result<Option<(Node, Names)>, CocoError> {
    let text = labels_text(path)?;
    let page = yaml::parse(&text).map_err(|error| CocoError::file(path, with_hint(error)))?;
    let Some(names) = page.get("names") else { return Ok(None) };
    let read = || {
        let keypoints = keypoints(&page)?;
        let has_outlines = has_outlines(&page, keypoints.is_some())?;
        Ok(Names { keypoints, has_outlines, ..Names::of_classes(yaml_names(&page, names)?) })
    };
    let read = read().map_err(|error| CocoError::file(path, error))?;
    Ok(Some((page, read)))
}

/// Fails where two files give one number to different classes. One of them may list fewer.
fn check_agree(
    (first, of_first): (&Path, &[String]),
    (other, of_other): (&Path, &[String]),
) -> Result<(), CocoError> {
    let differ = |(_, (a, b)): &(usize, (&String, &String))| a.to_lowercase() != b.to_lowercase();
    let Some((number, (a, b))) = of_first.iter().zip(of_other).enumerate().find(differ) else {
        return Ok(());
    };
    let reason = format!("class {number} is `{b}`, and `{a}` in {}", first.display());
    let hint = "labels have numbers alone: keep the file that belongs to them, or convert folders of other numbers one by one";
    Err(CocoError::content(other, reason, hint))
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

/// `kpt_shape: [points, values]`, by which Ultralytics knows a data set of poses.
fn keypoints(page: &Node) -> Result<Option<[usize; 2]>, FileError> {
    let Some(shape) = page.get("kpt_shape") else { return Ok(None) };
    let numbers: Vec<Option<usize>> =
        shape.list().iter().map(|node| node.text().and_then(|text| text.trim().parse().ok())).collect();
    match numbers[..] {
        [Some(points @ 1..=10_000), Some(values @ 2..=3)] => Ok(Some([points, values])),
        _ => Err(shape
            .error("kpt_shape", "these are not a number of points and 2 or 3 values of each")
            .hint("write `kpt_shape: [17, 3]` for 17 points of x, y and how well each is seen")),
    }
}

/// Whether `task` says that lines longer than a box are outlines (`segment`) or rotated boxes (`obb`), in the words of Ultralytics.
fn has_outlines(page: &Node, has_keypoints: bool) -> Result<bool, FileError> {
    let Some(task) = page.get("task") else { return Ok(false) };
    match (task.text(), has_keypoints) {
        (Some("segment" | "obb"), true) => Err(task
            .error("task", "there is `kpt_shape`, which is of poses")
            .hint("keep the one that is meant")),
        (Some("pose"), false) => Err(task
            .error("task", "poses need `kpt_shape`")
            .hint("write `kpt_shape: [17, 3]` for 17 points of x, y and how well each is seen")),
        (word, _) => Ok(matches!(word, Some("segment" | "obb"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn keypoints_are_a_shape() {
        let of = |text: &str| keypoints(&yaml::parse(text).unwrap());
        assert_eq!(of("names: [a]\n").unwrap(), None);
        assert_eq!(of("kpt_shape: [4, 2]\n").unwrap(), Some([4, 2]));
        assert_eq!(of("kpt_shape:\n- 17\n- 3\n").unwrap(), Some([17, 3]));
        for text in ["kpt_shape: [4]\n", "kpt_shape: 4\n", "kpt_shape: [4, 5]\n", "kpt_shape: [a, 2]\n"] {
            assert!(of(text).unwrap_err().hint.is_some(), "{text}");
        }
    }

    #[test]
    fn a_task_says_what_long_lines_are() {
        let of = |text: &str, has_keypoints| has_outlines(&yaml::parse(text).unwrap(), has_keypoints);
        for text in ["task: segment\n", "task: 'obb'\n"] {
            assert!(of(text, false).unwrap(), "{text}");
            assert!(of(text, true).unwrap_err().hint.is_some(), "{text}");
        }
        for text in ["names: [a]\n", "task: detect\n"] {
            assert!(!of(text, false).unwrap(), "{text}");
        }
        assert!(!of("task: pose\n", true).unwrap());
        assert!(of("task: pose\n", false).unwrap_err().to_string().contains("poses need `kpt_shape`"));
    }
}
