//! The lists of a folder `ImageSets`: files `train.txt`, `val.txt`, `trainval.txt` and `test.txt` with the name of a picture in each line.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::tree::{ListedParts, ends_with, is_picture, labels_text, split_of};
use crate::coco::defect::{DefectKind, Defects};
use crate::coco::error::CocoError;
use crate::coco::spelling::{composed, composed_path, names_in};

/// The folder of the lists, beside those of pictures and labels.
pub(super) const IMAGE_SETS: &str = "ImageSets";

/// Folders of pictures and of labels. Lists name what is in them.
const FOLDERS: [&str; 4] = ["JPEGImages", "Annotations", "image_2", "label_2"];

/// The parts of the lists, in the order in which they count.
const PARTS: [&str; 3] = ["test", "valid", "train"];

/// The files that lists may name, by their names without ending: pictures, and labels where these have another name.
pub(super) struct Named<'f>(HashMap<Cow<'f, OsStr>, Vec<&'f Path>>);

impl<'f> Named<'f> {
    /// These files of pictures and labels.
    pub fn among(files: impl Iterator<Item = &'f Path>) -> Self {
        let mut by_stem = HashMap::<_, Vec<_>>::new();
        for path in files {
            path.file_stem()
                .into_iter()
                .for_each(|stem| by_stem.entry(composed(stem)).or_default().push(path));
        }
        Self(by_stem)
    }

    /// The files that a name of a list means: with or without folders and ending. Files below `around`, the folder of the data set of the list, come
    /// before others, and a name without folders means the file that lies in none, if there is one.
    fn of(&self, name: &str, around: &Path) -> Vec<&'f Path> {
        let name = composed_path(Path::new(&name.replace('\\', "/")));
        let names: PathBuf = names_in(&name).into_iter().collect();
        let mut meant = names.clone();
        let mut found = self.ending_with(&meant);
        if found.is_empty() && (is_picture(&names) || ends_with(&names, "xml")) {
            // A name with its ending may be a path of another machine.
            let names = names.with_extension("");
            let names: Vec<&OsStr> = names.iter().collect();
            for from in 0..names.len() {
                meant = names[from..].iter().collect();
                found = self.ending_with(&meant);
                if !found.is_empty() {
                    break;
                }
            }
        }
        let found = narrowed(found, |path| path.starts_with(around));
        narrowed(found, |path| below_folder(path).as_ref() == Some(&meant))
    }

    /// The files whose paths without ending have these last names.
    fn ending_with(&self, names: &Path) -> Vec<&'f Path> {
        let of_stem = names.file_name().and_then(|stem| self.0.get(stem)).into_iter().flatten();
        of_stem.copied().filter(|path| composed_path(path).with_extension("").ends_with(names)).collect()
    }
}

/// Those of some files for which this holds; all where it holds for none.
fn narrowed(files: Vec<&Path>, holds: impl Fn(&Path) -> bool) -> Vec<&Path> {
    let kept: Vec<&Path> = files.iter().copied().filter(|path| holds(path)).collect();
    if kept.is_empty() { files } else { kept }
}

/// The path of a file below the last folder that is usual for pictures or labels, without its ending.
fn below_folder(path: &Path) -> Option<PathBuf> {
    let path = composed_path(path);
    let names: Vec<&OsStr> = path.iter().collect();
    let at = names.iter().rposition(|name| FOLDERS.iter().any(|folder| name == folder))?;
    Some(names[at + 1..].iter().collect::<PathBuf>().with_extension(""))
}

/// A list of the pictures of a part.
pub(super) struct PartList<'f> {
    /// The part.
    pub part: &'static str,
    /// Whether the list is of training and validation together. What another list names is of the part of that list.
    is_of_both: bool,
    /// The place of each name, and the files that it means.
    names: Vec<(String, Vec<&'f Path>)>,
}

impl<'f> PartList<'f> {
    /// The files that the list names.
    pub fn files(&self) -> impl Iterator<Item = &'f Path> {
        self.names.iter().flat_map(|(_, files)| files.iter().copied())
    }
}

/// Reads the lists among some files, in the order in which they count. Lists of single classes, such as `car_train.txt`, are left out. The list
/// `trainval` is for training, or for validation where only `train` has a list.
pub(super) fn read_lists<'f, 'l>(
    paths: impl Iterator<Item = &'l Path>,
    named: &Named<'f>,
) -> Result<Vec<PartList<'f>>, CocoError> {
    let mut lists: Vec<(&'static str, &Path)> = Vec::new();
    let mut of_both: Vec<&Path> = Vec::new();
    for path in paths {
        let stem = path.file_stem().unwrap_or(OsStr::new(""));
        if stem.eq_ignore_ascii_case("trainval") {
            of_both.push(path);
        }
        let part = split_of(Path::new(stem));
        lists.extend(PARTS.iter().find(|known| part.as_deref() == Some(**known)).map(|part| (*part, path)));
    }
    let has = |part: &str| lists.iter().any(|(known, _)| *known == part);
    let rest = if has("train") && !has("valid") { "valid" } else { "train" };
    lists.sort_by_key(|(part, _)| PARTS.iter().position(|known| known == part));
    let lists = lists.into_iter().map(|(part, path)| (part, path, false));
    let read = |(part, path, is_of_both)| {
        names_of_list(path, named).map(|names| PartList { part, is_of_both, names })
    };
    lists.chain(of_both.into_iter().map(|path| (rest, path, true))).map(read).collect()
}

/// The place of each name of a list, and the files that it means.
fn names_of_list<'f>(path: &Path, named: &Named<'f>) -> Result<Vec<(String, Vec<&'f Path>)>, CocoError> {
    let folder = path.ancestors().find(|folder| folder.file_name() == Some(OsStr::new(IMAGE_SETS)));
    let around = folder.and_then(Path::parent).unwrap_or(Path::new(""));
    let mut found = Vec::new();
    for (number, line) in (1..).zip(labels_text(path)?.lines()) {
        let names = names_in_line(line);
        let Some(first) = names.last() else { continue };
        let place = format!("{}: line {number}: {first}", path.display());
        let files = names.iter().map(|name| named.of(name, around)).find(|files| !files.is_empty());
        found.push((place, files.unwrap_or_default()));
    }
    Ok(found)
}

/// What a line may name: the text in quotes, as CVAT writes names with spaces; else the whole line or its first word, behind which a mark may follow.
fn names_in_line(line: &str) -> Vec<String> {
    let line = line.trim();
    let quoted = line.strip_prefix('"').and_then(|rest| Some(&rest[..rest.rfind('"')?]));
    if let Some(name) = quoted {
        return vec![name.replace("\\\"", "\"")];
    }
    let first = line.split_whitespace().next();
    first.into_iter().flat_map(|first| [line.to_owned(), first.to_owned()]).collect()
}

/// The parts that lists give files of pictures and labels. Names that mean no file here, and those of two parts, are noted.
pub(super) fn parts_of<'f>(lists: Vec<PartList<'f>>, defects: &mut Defects) -> ListedParts<&'f Path> {
    let mut parts = ListedParts::default();
    for PartList { part, is_of_both, names } in lists {
        for (place, files) in names {
            if files.is_empty() {
                defects.add(DefectKind::ListedWithoutPicture, || place);
                continue;
            }
            let others: Vec<&str> = files.into_iter().filter_map(|file| parts.add(file, part)).collect();
            if let Some(other) = others.into_iter().find(|other| !is_of_both || *other == "test") {
                defects.add(DefectKind::PictureInTwoParts, || format!("{place}, and in {other}"));
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_lists_mean_files_with_their_folders() {
        let files = [
            "s/JPEGImages/f.jpg",
            "s/JPEGImages/cam1/f.jpg",
            "s/Annotations/cam1/f.xml",
            "t/JPEGImages/g.h.jpg",
        ];
        let named = Named::among(files.iter().map(Path::new));
        let of = |name: &str| named.of(name, Path::new("s"));
        assert_eq!(of("f"), [Path::new(files[0])]);
        for name in ["cam1/f", "cam1\\f", "cam1/f.jpg", "cam1/x/../f", "/home/x/s/JPEGImages/cam1/f.jpg"] {
            assert_eq!(of(name)[0], Path::new(files[1]), "{name}");
        }
        assert_eq!(of("cam1/f").len(), 2);
        assert_eq!(of("g.h"), [Path::new(files[3])]);
        assert!(of("cam2/f").is_empty() && of("h").is_empty());
    }

    #[test]
    fn lines_name_a_picture_in_quotes_whole_or_by_their_first_word() {
        assert_eq!(names_in_line(" \"cam 2/f\" 1\r"), ["cam 2/f"]);
        assert_eq!(names_in_line("my pic"), ["my pic", "my"]);
        assert_eq!(names_in_line("f  -1"), ["f  -1", "f"]);
        assert!(names_in_line(" ").is_empty());
    }
}
