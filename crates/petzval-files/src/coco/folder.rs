//! The folder of a data set: which file holds the annotations, and where the pictures are.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::{Cancel, IoError, write_whole};

use super::bounded::read_bounded;
use super::check::check_entries;
use super::data_set::DataSet;
use super::defect::{DefectKind, Defects};
use super::error::CocoError;
use super::parts::joined;
use super::picture_names::{picture_in, take_first_names, take_other_spellings};
use super::read::parse_coco;
use super::write::coco_bytes;

/// Largest file of annotations that is read. The training set of COCO has 470 MB.
pub const LARGEST_ANNOTATIONS: u64 = 2 << 30;

/// Name of the file of annotations that this program writes.
pub const ANNOTATIONS: &str = "annotations.json";

/// Name of the file of annotations in the exports of Roboflow.
const ROBOFLOW: &str = "_annotations.coco.json";

/// A data set as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// Everything of it that can be used.
    pub data: DataSet,
    /// What was found wrong.
    pub defects: Defects,
    /// The file of annotations, or the folder of several.
    pub file: PathBuf,
    /// Folders in which pictures are looked for, in this order.
    pub folders: Vec<PathBuf>,
}

impl Loaded {
    /// The file of a picture; `None` if there is none.
    pub fn picture(&self, file_name: &str) -> Option<PathBuf> {
        picture_in(&self.folders, file_name)
    }

    /// Refuses boxes of another form than COCO's: what is learned from them or scored by them would be wrong. Corners in pictures whose size the
    /// file does not state show when [`check_pictures`](super::check_pictures) has read it.
    pub fn check_form(&self) -> Result<(), CocoError> {
        let is_form = |kind| matches!(kind, DefectKind::CornerBoxes | DefectKind::ShareBoxes);
        let Some(defect) = self.defects.iter().find(|defect| is_form(defect.kind)) else { return Ok(()) };
        let sentence = defect.kind.sentence().trim_end_matches('.');
        let first = defect.first.first().map(|first| format!(" (the first: {first})")).unwrap_or_default();
        Err(CocoError::content(&self.file, format!("{sentence}{first}"), defect.kind.hint()))
    }
}

/// Reads a data set and checks its values; [`check_pictures`](super::check_pictures) then checks the files of its pictures.
///
/// `place` is a file of annotations or a folder. In a folder these are looked for: `annotations.json`, `_annotations.coco.json`,
/// `annotations/instances_*.json`, `_annotations.coco.json` in the folders `train`, `valid` and `test`, one file `.json`. Where there are several, each
/// is a part of the data set. Pictures are beside the annotations, in `images/` or `data/` there, or, as COCO itself has
/// them, in a folder named like the part: `annotations/instances_val2017.json` and `val2017/`. A picture that is not where its name says has the name
/// of the only file that can be meant. Entries that spell the name of one file otherwise have the name of the first one.
///
/// Fails with [`CocoError::Stopped`] before the next step, such as a file or the check of its entries, once `cancel` is set.
pub fn load_coco(place: &Path, cancel: &Cancel) -> Result<Loaded, CocoError> {
    let mut defects = Defects::default();
    let mut loaded = match annotation_files(place)?.as_slice() {
        [file] => {
            let (mut data, folders) = (entries(file, &mut defects, cancel)?, picture_folders(file));
            let pictures = take_other_spellings(&mut data.images, &folders, &mut defects, cancel)?;
            take_first_names(&mut data.images, &pictures, &mut defects, cancel)?;
            Loaded { data, defects, file: file.clone(), folders }
        }
        several => {
            let folders = vec![place.to_owned()];
            let (mut parts, mut pictures) = (Vec::new(), Vec::new());
            for file in several {
                let (mut data, part) =
                    (entries(file, &mut defects, cancel)?, part_of(file).unwrap_or_default());
                // Two parts may have pictures of one name, each in its own folder.
                let of_part = picture_folders(file);
                let found = take_other_spellings(&mut data.images, &of_part, &mut defects, cancel)?;
                for (image, path) in data.images.iter_mut().zip(found) {
                    cancel.check()?;
                    match path.as_deref().and_then(|path| path.strip_prefix(place).ok()?.to_str()) {
                        Some(below) => {
                            image.file_name = below.to_owned();
                            pictures.push(path);
                        }
                        None => {
                            image.file_name = format!("{part}/{}", image.file_name);
                            pictures.push(picture_in(&folders, &image.file_name));
                        }
                    }
                }
                parts.push((part, data));
            }
            // The whole has the pictures of its parts in their order.
            let mut data = joined(parts, &mut defects);
            take_first_names(&mut data.images, &pictures, &mut defects, cancel)?;
            Loaded { data, defects, file: place.to_owned(), folders }
        }
    };
    if loaded.data.images.is_empty() {
        loaded.defects.add(DefectKind::NoPicture, || "`images` has no entry that can be used".to_owned());
    }
    Ok(loaded)
}

/// What a file of annotations holds, each entry checked.
fn entries(file: &Path, defects: &mut Defects, cancel: &Cancel) -> Result<DataSet, CocoError> {
    cancel.check()?;
    let hint = "outlines (`segmentation`) are not used and may be left out; or split the data set";
    let bytes = read_bounded(file, LARGEST_ANNOTATIONS, hint)?;
    cancel.check()?;
    let mut data = parse_coco(bytes, defects).map_err(|error| CocoError::file(file, error))?;
    cancel.check()?;
    check_entries(&mut data, defects);
    Ok(data)
}

/// Writes the annotations of a data set, completely or not at all.
pub fn save_coco(data: &DataSet, path: &Path) -> Result<(), CocoError> {
    Ok(write_whole(path, &coco_bytes(data)).map_err(IoError::at(path))?)
}

/// Whether a place has annotations in COCO format, or several files that could be those: a file `.json`, or a folder with some.
pub fn has_annotations(place: &Path) -> bool {
    if place.is_dir() {
        return found_files(place).is_ok_and(|found| !found.is_empty());
    }
    place.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"))
}

/// Files of a folder that could be annotations.
fn found_files(place: &Path) -> Result<Vec<PathBuf>, CocoError> {
    if let Some(file) = [ANNOTATIONS, ROBOFLOW].map(|name| place.join(name)).into_iter().find(|f| f.is_file())
    {
        return Ok(vec![file]);
    }
    let instances = |name: &str| name.starts_with("instances_");
    let of_coco = match place.join("annotations") {
        folder if folder.is_dir() => json_files(&folder, instances)?,
        _ => Vec::new(),
    };
    let of_roboflow = ["train", "valid", "test"].map(|part| place.join(part).join(ROBOFLOW));
    let of_roboflow: Vec<PathBuf> = of_roboflow.into_iter().filter(|file| file.is_file()).collect();
    let found = [of_coco, of_roboflow].into_iter().find(|files| !files.is_empty());
    found.map_or_else(|| json_files(place, |_| true), Ok)
}

/// What to do with labels of pixels.
const LABEL_IMAGES: &str =
    "labels of pixels are checked by an experiment with their classes: `petzval design EXPERIMENT --check`";

/// The folders of pictures and of label images that experiments read.
const PAIRS: [&str; 2] = ["pictures", "labels"];

/// Those of other data sets with label images: Cityscapes, its coarse labels, and ACDC.
const OTHER_PAIRS: [[&str; 2]; 3] =
    [["leftImg8bit", "gtFine"], ["leftImg8bit", "gtCoarse"], ["rgb_anon", "gt"]];

fn has_folders(place: &Path, names: [&str; 2]) -> bool {
    names.iter().all(|name| place.join(name).is_dir())
}

/// The files of annotations of a folder, each of a part of another name, or the file itself; at least one.
fn annotation_files(place: &Path) -> Result<Vec<PathBuf>, CocoError> {
    if !place.is_dir() {
        return Ok(vec![place.to_owned()]);
    }
    let found = found_files(place)?;
    let parts: BTreeSet<String> = found.iter().filter_map(|file| part_of(file)).collect();
    match found.len() {
        0 if has_folders(place, PAIRS) => {
            Err(CocoError::content(place, "no annotations in COCO format in this folder", LABEL_IMAGES))
        }
        0 if OTHER_PAIRS.iter().any(|folders| has_folders(place, *folders)) => {
            let hint =
                format!("{LABEL_IMAGES}; lay them in pairs of one name: pictures/NAME.png, labels/NAME.png");
            Err(CocoError::content(place, "no annotations in COCO format in this folder", hint))
        }
        0 => {
            let hint = "give a folder with `annotations.json`, or convert it with `petzval data convert`";
            Err(CocoError::content(place, "no annotations in COCO format in this folder", hint))
        }
        several @ 2.. if parts.len() < several => {
            let names: Vec<String> = found.iter().take(4).map(|path| path.display().to_string()).collect();
            let reason = format!("{several} files could be the annotations");
            Err(CocoError::content(place, reason, format!("name one of them: {}", names.join(", "))))
        }
        _ => Ok(found),
    }
}

/// The part that a file of annotations is of: `train` for `instances_train2017.json` and for `train/_annotations.coco.json`.
fn part_of(file: &Path) -> Option<String> {
    let stem = file.file_stem().and_then(OsStr::to_str)?;
    match stem.strip_prefix("instances_") {
        Some(part) => Some(part.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned()),
        None if file.ends_with(ROBOFLOW) => Some(file.parent()?.file_name()?.to_str()?.to_owned()),
        None => None,
    }
}

/// The `.json` files of a folder whose names are accepted, in order.
fn json_files(folder: &Path, is_accepted: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>, CocoError> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(IoError::at(folder))? {
        let path = entry.map_err(IoError::at(folder))?.path();
        let name = path.file_name().and_then(OsStr::to_str).unwrap_or("");
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"))
            && is_accepted(name)
            && path.is_file()
        {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// Folders in which the pictures of a file of annotations may be.
fn picture_folders(file: &Path) -> Vec<PathBuf> {
    let beside = file.parent().unwrap_or(Path::new("")).to_owned();
    // FiftyOne has its pictures in `data`.
    let mut folders = vec![beside.clone(), beside.join("images"), beside.join("data")];
    if beside.file_name() == Some(OsStr::new("annotations")) {
        let root = beside.parent().unwrap_or(Path::new("")).to_owned();
        let stem = file.file_stem().and_then(OsStr::to_str).unwrap_or("");
        if let Some((_, part)) = stem.rsplit_once('_') {
            folders.extend([root.join(part), root.join("images").join(part)]);
        }
        folders.extend([root.join("images"), root]);
    }
    folders
}
