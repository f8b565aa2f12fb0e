//! The files below a folder.

use std::borrow::{Borrow, Cow};
use std::collections::HashMap;
use std::ffi::{OsStr, OsString};
use std::hash::Hash;
use std::path::{Path, PathBuf};

use petzval_base::{Cancel, FileError, IoError};

use super::builder::PLAIN_FOLDERS;
use crate::coco::bounded::read_bounded;
use crate::coco::defect::{DefectKind, Defects};
use crate::coco::error::CocoError;
use crate::coco::spelling::{composed, composed_path};
use crate::encoding::{decode_strictly, decode_xml};
use crate::picture_file::PICTURE_ENDINGS;

/// Levels of folders that are searched.
const DEEPEST: usize = 8;

/// Files that are listed. The largest data sets have a few million.
const MOST_FILES: usize = 10_000_000;

/// Largest file of the labels of one picture.
const LARGEST_LABELS: u64 = 16 << 20;

/// What to do about a larger one.
const LABELS_HINT: &str = "a file of labels is of one picture";

/// The files below a folder, in the order of their paths. Hidden files are left out.
pub(super) fn files_below(root: &Path, cancel: &Cancel) -> Result<Vec<PathBuf>, CocoError> {
    let (mut found, mut open) = (Vec::new(), vec![(root.to_owned(), 0)]);
    while let Some((folder, depth)) = open.pop() {
        cancel.check()?;
        for entry in std::fs::read_dir(&folder).map_err(IoError::at(&folder))? {
            let entry = entry.map_err(IoError::at(&folder))?;
            let path = entry.path();
            if entry.file_name().as_encoded_bytes().starts_with(b".") {
                continue;
            }
            match path.is_dir() {
                true if depth < DEEPEST => open.push((path, depth + 1)),
                true => {
                    let reason = format!("folders are nested deeper than {DEEPEST} levels");
                    return Err(CocoError::content(&path, reason, "name the folder of the data set itself"));
                }
                false => found.push(path),
            }
        }
        if found.len() > MOST_FILES {
            let reason = format!("there are more than {MOST_FILES} files");
            return Err(CocoError::content(root, reason, "name the folder of the data set itself"));
        }
    }
    found.sort();
    Ok(found)
}

/// Whether a file has this ending.
pub(super) fn ends_with(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// Whether the name is that of a picture.
pub(super) fn is_picture(path: &Path) -> bool {
    PICTURE_ENDINGS.iter().any(|ending| ends_with(path, ending))
}

/// The picture files among some.
pub(super) fn pictures_among(files: &[PathBuf]) -> impl DoubleEndedIterator<Item = &Path> {
    files.iter().map(PathBuf::as_path).filter(|path| is_picture(path))
}

/// The picture files of a data set, by their names and by their names without ending, in one form of letters. Parts of a data set often repeat them.
pub(super) struct Pictures<'f> {
    root: &'f Path,
    by_name: HashMap<Cow<'f, OsStr>, Vec<&'f Path>>,
    by_stem: HashMap<Cow<'f, OsStr>, Vec<&'f Path>>,
}

impl<'f> Pictures<'f> {
    /// The pictures among the files below `root`.
    pub fn among(root: &'f Path, files: &'f [PathBuf]) -> Self {
        let (mut by_name, mut by_stem) = (HashMap::<_, Vec<_>>::new(), HashMap::<_, Vec<_>>::new());
        for path in pictures_among(files) {
            for (name, paths) in [(path.file_name(), &mut by_name), (path.file_stem(), &mut by_stem)] {
                name.into_iter().for_each(|name| paths.entry(composed(name)).or_default().push(path));
            }
        }
        Self { root, by_name, by_stem }
    }

    /// The picture of this name, without its ending, to which a file of labels belongs; `stated` is the name in that file.
    pub fn by_stem(&self, stem: &OsStr, labels: &Path, stated: &Path) -> Chosen<'f> {
        self.choose(self.by_stem.get(&*composed(stem)), labels, stated)
    }

    /// Whether a picture has this path at its end, with or without its own ending.
    pub fn has(&self, stated: &Path) -> bool {
        let Some(name) = stated.file_name().map(composed) else { return false };
        let mut named =
            [&self.by_name, &self.by_stem].into_iter().filter_map(|paths| paths.get(&*name)).flatten();
        let stated = composed_path(stated);
        named.any(|path| is_at_end(&stated, path))
    }

    /// The picture to which a file of labels belongs, by the name that the file states.
    pub fn by_name(&self, labels: &Path, stated: &Path) -> Chosen<'f> {
        self.choose(stated.file_name().and_then(|name| self.by_name.get(&*composed(name))), labels, stated)
    }

    /// Chooses among pictures of one name. In this order count: the folder of the labels, the stated path, a folder that is usual for pictures,
    /// the folders that picture and labels share, such as `train`, and those with which both paths begin.
    fn choose(&self, named: Option<&Vec<&'f Path>>, labels: &Path, stated: &Path) -> Chosen<'f> {
        let named = match named.map(Vec::as_slice).unwrap_or_default() {
            &[] => return Chosen::None,
            &[one] => return Chosen::One(one),
            named => named,
        };
        let folders = |path: &Path| -> Vec<OsString> {
            let folder = path.strip_prefix(self.root).unwrap_or(path).parent().unwrap_or(Path::new(""));
            folder.iter().map(|name| composed(name).into_owned()).collect()
        };
        let (of_labels, stated) = (folders(labels), composed_path(stated));
        let nearness = |path: &Path| {
            let own = folders(path);
            let is_usual = own.iter().any(|folder| PLAIN_FOLDERS.iter().any(|plain| folder == plain));
            let shared = own.iter().filter(|folder| of_labels.contains(folder)).count();
            let first = own.iter().zip(&of_labels).take_while(|(own, other)| own == other).count();
            (own == of_labels, is_at_end(&stated, path), is_usual, shared, first)
        };
        let nearest = named.iter().map(|path| nearness(path)).max();
        let nearest: Vec<&'f Path> =
            named.iter().copied().filter(|path| Some(nearness(path)) == nearest).collect();
        // Copies of one picture are that picture.
        match nearest[..] {
            [] => Chosen::None,
            [first, ref others @ ..] => match others.iter().find(|other| !have_same_bytes(first, other)) {
                None => Chosen::One(first),
                Some(&other) => Chosen::Several(first, other),
            },
        }
    }
}

/// Whether a path in one form of letters is the end of that of a file, with or without its ending.
fn is_at_end(stated: &Path, file: &Path) -> bool {
    let file = composed_path(file);
    file.ends_with(stated) || file.with_extension("").ends_with(stated)
}

/// Whether two files can be read and hold the same.
pub(super) fn have_same_bytes(one: &Path, other: &Path) -> bool {
    let length = |path: &Path| std::fs::metadata(path).map(|about| about.len()).ok();
    let bytes = |path: &Path| petzval_base::read_whole(path).ok();
    length(one).is_some() && length(one) == length(other) && bytes(one) == bytes(other)
}

/// Which picture a file of labels has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Chosen<'f> {
    None,
    One(&'f Path),
    /// Nothing says which of several it is; the first two.
    Several(&'f Path, &'f Path),
}

impl<'f> Chosen<'f> {
    /// This choice, or another where there is none.
    pub fn or(self, other: impl FnOnce() -> Self) -> Self {
        if self == Self::None { other() } else { self }
    }

    /// The picture; `None`, which is noted for the labels of `place`, where there is none or more than one.
    pub fn noted(self, place: &dyn Fn() -> String, defects: &mut Defects) -> Option<&'f Path> {
        match self {
            Self::One(path) => Some(path),
            Self::None => {
                defects.add(DefectKind::MissingPicture, place);
                None
            }
            Self::Several(first, second) => {
                let said = || format!("{}: {} or {}", place(), first.display(), second.display());
                defects.add(DefectKind::SeveralPictures, said);
                None
            }
        }
    }
}

/// The parts of pictures that lists name.
#[derive(Debug)]
pub(super) struct ListedParts<P> {
    parts: HashMap<P, &'static str>,
}

impl<P> Default for ListedParts<P> {
    fn default() -> Self {
        Self { parts: HashMap::new() }
    }
}

impl<P: Eq + Hash> ListedParts<P> {
    /// Whether no list names a picture.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// The part of a picture that a list names.
    pub fn get<Q: Eq + Hash + ?Sized>(&self, picture: &Q) -> Option<&'static str>
    where
        P: Borrow<Q>,
    {
        self.parts.get(picture).copied()
    }

    /// Adds a picture of a list of a part. Of two parts the one counts that is added first: add parts for tests before those for training.
    /// Returns the other part, if there is one.
    pub fn add(&mut self, picture: P, part: &'static str) -> Option<&'static str> {
        Some(*self.parts.entry(picture).or_insert(part)).filter(|first| *first != part)
    }
}

/// The part of a data set that a path names, such as `train`.
pub(super) fn split_of(path: &Path) -> Option<String> {
    let name = |part: std::path::Component| -> Option<String> {
        let part = part.as_os_str().to_str()?.to_ascii_lowercase();
        let stem = part.trim_end_matches(|c: char| c.is_ascii_digit());
        matches!(stem, "train" | "training" | "val" | "valid" | "validation" | "test" | "testing").then(
            || match stem {
                "training" => "train".to_owned(),
                "val" | "validation" => "valid".to_owned(),
                "testing" => "test".to_owned(),
                stem => stem.to_owned(),
            },
        )
    };
    path.components().rev().find_map(name)
}

/// The text of a file of labels. Fails where it is not text in UTF-8 or UTF-16.
pub(super) fn labels_text(path: &Path) -> Result<String, CocoError> {
    let bytes = read_bounded(path, LARGEST_LABELS, LABELS_HINT)?;
    decode_strictly(&bytes).map(|text| text.into_owned()).map_err(|error| CocoError::file(path, error))
}

/// The text of a file of labels in XML, in the encoding that it declares; as an inner error, why it is not such text.
pub(super) fn xml_text(path: &Path) -> Result<Result<String, FileError>, CocoError> {
    let bytes = read_bounded(path, LARGEST_LABELS, LABELS_HINT)?;
    Ok(decode_xml(&bytes).map(|text| text.into_owned()))
}
