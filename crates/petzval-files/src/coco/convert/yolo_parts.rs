//! The parts of a YOLO data set: the folders and lists that `data.yaml` names, the lists that `obj.data` of Darknet names, or lists that are called
//! by their parts, such as `train.txt`.

use std::collections::{HashMap, HashSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::builder::PLAIN_FOLDERS;
use super::tree::{ListedParts, ends_with, is_picture, labels_text, split_of};
use crate::coco::defect::{DefectKind, Defects};
use crate::coco::error::CocoError;
use crate::coco::spelling::{composed_path, names_in};
use crate::yaml::Node;

/// Keys of `data.yaml` and the parts that they name. Of one folder or list with two parts the last one counts, of a picture in two lists the first.
const PARTS: [(&str, &str); 3] = [("test", "test"), ("val", "valid"), ("train", "train")];

/// The files of a data set.
pub(super) struct Files<'a> {
    root: &'a Path,
    all: &'a [PathBuf],
    /// The paths of pictures below the root, in one form of letters.
    pictures: HashSet<PathBuf>,
    /// All other files, by such paths.
    others: HashMap<PathBuf, &'a Path>,
}

impl<'a> Files<'a> {
    pub fn below(root: &'a Path, all: &'a [PathBuf]) -> Self {
        let below = |path: &Path| composed_path(path.strip_prefix(root).unwrap_or(path));
        let (pictures, others): (Vec<&Path>, Vec<&Path>) =
            all.iter().map(PathBuf::as_path).partition(|path| is_picture(path));
        Self {
            root,
            all,
            pictures: pictures.into_iter().map(below).collect(),
            others: others.into_iter().map(|path| (below(path), path)).collect(),
        }
    }
}

/// A folder or list of a part.
struct Entry {
    /// Where it is named.
    place: String,
    part: &'static str,
    path: String,
}

/// From where the paths of lists count.
#[derive(Clone, Copy)]
enum Start<'a> {
    /// From the folder of the data set or this one of it, as Ultralytics has them.
    Folder(&'a [&'a OsStr]),
    /// From where Darknet was started, which may be any folder of another machine.
    Anywhere,
}

/// The parts of the pictures of a data set.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// Folders of the parts, below that of the data set, each with its part.
    folders: Vec<(PathBuf, &'static str)>,
    /// The parts of pictures that lists name, by their paths below the folder of the data set.
    listed: ListedParts<PathBuf>,
}

impl Parts {
    /// The part of a picture, by its path below the folder of the data set, where a file names it.
    pub fn part_of(&self, below: &Path) -> Option<String> {
        let below = composed_path(below);
        let named = self.folders.iter().filter(|(folder, _)| below.starts_with(folder));
        let of_folder = || named.max_by_key(|(folder, _)| folder.components().count()).map(|(_, part)| *part);
        self.listed.get(below.as_path()).or_else(of_folder).map(str::to_owned)
    }

    /// Whether no picture has a part.
    pub fn is_empty(&self) -> bool {
        self.folders.is_empty() && self.listed.is_empty()
    }

    /// The folders and lists of `train`, `val` and `test` of `data.yaml`. Parts without a picture are noted.
    pub fn of_page(
        (file, page): (&Path, &Node),
        files: &Files,
        defects: &mut Defects,
    ) -> Result<Self, CocoError> {
        let above = page.get("path").and_then(Node::text).map(|text| names_in(Path::new(text)));
        let entries = PARTS.into_iter().flat_map(|(key, part)| {
            let texts = page.get(key).into_iter().flat_map(Node::list).filter_map(Node::text);
            let texts = texts.filter(|text| !matches!(*text, "" | "~" | "null"));
            texts.map(move |path| Entry {
                place: format!("{}: {key}", file.display()),
                part,
                path: path.to_owned(),
            })
        });
        Self::of_entries(entries, Start::Folder(&above.unwrap_or_default()), files, defects)
    }

    /// The lists that `obj.data` of Darknet names; else lists that are called `train.txt`, `val.txt` and `test.txt`.
    pub fn of_lists(files: &Files, defects: &mut Defects) -> Result<Self, CocoError> {
        let mut entries = files.all.iter().filter(|path| ends_with(path, "data")).map(|path| darknet(path));
        let entries = entries.find(|entries| !entries.is_empty()).unwrap_or_else(|| lists_by_name(files));
        Self::of_entries(entries.into_iter(), Start::Anywhere, files, defects)
    }

    fn of_entries(
        entries: impl Iterator<Item = Entry>,
        start: Start,
        files: &Files,
        defects: &mut Defects,
    ) -> Result<Self, CocoError> {
        let mut parts = Self::default();
        let mut lists: Vec<(PathBuf, &'static str)> = Vec::new();
        for Entry { place, part, path } in entries {
            let mut places = places(&path, start).into_iter();
            let is_list = ends_with(Path::new(&path), "txt") || matches!(start, Start::Anywhere);
            let found = if is_list {
                places.find(|place| files.others.contains_key(place))
            } else {
                places.find(|place| files.pictures.iter().any(|picture| picture.starts_with(place)))
            };
            match found {
                Some(list) if is_list => {
                    lists.retain(|(known, _)| *known != list);
                    lists.push((list, part));
                }
                Some(folder) => parts.folders.push((folder, part)),
                None => defects.add(DefectKind::PartWithoutPictures, || format!("{place}: {path}")),
            }
        }
        for (list, part) in lists {
            parts.take_list(&list, part, start, files, defects)?;
        }
        Ok(parts)
    }

    /// Takes the pictures of a list, one path a line, from the folder of the list or from that of the data set.
    fn take_list(
        &mut self,
        list: &Path,
        part: &'static str,
        start: Start,
        files: &Files,
        defects: &mut Defects,
    ) -> Result<(), CocoError> {
        let Some(path) = files.others.get(list) else { return Ok(()) };
        let text = labels_text(path)?;
        let beside = list.parent().map(names_in).unwrap_or_default();
        for (number, line) in (1..).zip(text.lines().map(str::trim)).filter(|(_, line)| !line.is_empty()) {
            let place = || format!("{}: line {number}: {line}", path.display());
            let of_darknet = if matches!(start, Start::Anywhere) { places(line, start) } else { Vec::new() };
            let mut places = places(line, Start::Folder(&beside)).into_iter().chain(of_darknet);
            let Some(picture) = places.find(|place| files.pictures.contains(place)) else {
                defects.add(DefectKind::ListedWithoutPicture, place);
                continue;
            };
            if let Some(other) = self.listed.add(picture, part) {
                defects.add(DefectKind::PictureInTwoParts, || format!("{}, and in {other}", place()));
            }
        }
        Ok(())
    }
}

/// The lists of a file of Darknet, with lines such as `train = data/train.txt`; none if it is no such file.
fn darknet(file: &Path) -> Vec<Entry> {
    let text = labels_text(file).unwrap_or_default();
    let pairs =
        text.lines().filter_map(|line| line.split_once('=')).map(|(key, path)| (key.trim(), path.trim()));
    let entries = pairs.filter(|(_, path)| !path.is_empty()).filter_map(|(key, path)| {
        let place = format!("{}: {key}", file.display());
        Some(Entry { place, part: known_part(key)?, path: path.to_owned() })
    });
    in_order(entries.collect())
}

/// The lists that are called by their parts, in the outermost folder that has some. A list names a picture in its first line; labels do not.
fn lists_by_name(files: &Files) -> Vec<Entry> {
    let is_list = |path: &&PathBuf| {
        let text = labels_text(path).unwrap_or_default();
        text.lines()
            .find(|line| !line.trim().is_empty())
            .is_some_and(|line| is_picture(Path::new(line.trim())))
    };
    let part = |path: &Path| known_part(path.file_stem()?.to_str()?);
    let named = files.all.iter().filter(|path| ends_with(path, "txt") && part(path).is_some());
    let mut lists: Vec<&PathBuf> = named.filter(is_list).collect();
    lists.sort_by_key(|path| path.components().count());
    let folder = lists.first().and_then(|path| path.parent());
    let entries = lists.iter().filter(|path| path.parent() == folder).filter_map(|path| {
        let below = path.strip_prefix(files.root).unwrap_or(path).to_str()?.to_owned();
        Some(Entry { place: path.display().to_string(), part: part(path)?, path: below })
    });
    in_order(entries.collect())
}

/// The part that a word means.
fn known_part(word: &str) -> Option<&'static str> {
    let part = split_of(Path::new(word))?;
    PARTS.iter().map(|(_, known)| *known).find(|known| *known == part)
}

/// Entries in the order in which their parts count.
fn in_order(mut entries: Vec<Entry>) -> Vec<Entry> {
    entries.sort_by_key(|entry| PARTS.iter().position(|(_, part)| *part == entry.part));
    entries
}

/// Places below the folder of a data set that a path may mean, the longest first. A relative one counts from its folder or from one of the inner
/// folders of that, because `path` is often that of another machine. So does an absolute one, as long as it names more than `images`.
fn places(path: &str, start: Start) -> Vec<PathBuf> {
    // Lists of Windows have its separators, and its disks.
    let path = composed_path(Path::new(&path.replace('\\', "/")));
    let is_absolute = path.is_absolute() || path.as_os_str().as_encoded_bytes().get(1) == Some(&b':');
    let own = names_in(&path);
    if own.is_empty() {
        return Vec::new();
    }
    if let (Start::Folder(above), false) = (start, is_absolute) {
        let place = |from: usize| above[from..].iter().chain(&own).collect();
        return (0..=above.len()).map(place).collect();
    }
    let says_more =
        |names: &&[&OsStr]| names.iter().any(|name| !PLAIN_FOLDERS.iter().any(|plain| name == plain));
    (0..own.len()).map(|from| &own[from..]).filter(says_more).map(|names| names.iter().collect()).collect()
}
