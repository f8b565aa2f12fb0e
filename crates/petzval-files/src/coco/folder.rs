//! The folder of a data set: which file holds the annotations, and where the pictures are.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::write_whole;

use super::bounded::read_bounded;
use super::check::check_values;
use super::data_set::DataSet;
use super::defect::{DefectKind, Defects};
use super::error::CocoError;
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
    /// The file of annotations.
    pub file: PathBuf,
    /// Folders in which pictures are looked for, in this order.
    pub folders: Vec<PathBuf>,
}

impl Loaded {
    /// The file of a picture; `None` if there is none.
    pub fn picture(&self, file_name: &str) -> Option<PathBuf> {
        self.folders.iter().map(|folder| folder.join(file_name)).find(|path| path.is_file())
    }
}

/// Reads a data set and checks its values; [`check_pictures`](super::check_pictures) then checks the files of its pictures.
///
/// `place` is a file of annotations or a folder. In a folder these are looked for: `annotations.json`, `_annotations.coco.json`, one
/// `annotations/instances_*.json`, one file `.json`. Pictures are beside the annotations, in `images/` there, or, as COCO itself has
/// them, in a folder named like the part: `annotations/instances_val2017.json` and `val2017/`.
pub fn load_coco(place: &Path) -> Result<Loaded, CocoError> {
    let file = annotation_file(place)?;
    let hint = "outlines (`segmentation`) are not used and may be left out; or split the data set";
    let bytes = read_bounded(&file, LARGEST_ANNOTATIONS, hint)?;
    let mut defects = Defects::default();
    let mut data = parse_coco(bytes, &mut defects).map_err(|error| CocoError::file(&file, error))?;
    check_values(&mut data, &mut defects);
    if data.images.is_empty() {
        defects.add(DefectKind::NoPicture, || "`images` has no entry that can be used".to_owned());
    }
    let folders = picture_folders(&file);
    Ok(Loaded { data, defects, file, folders })
}

/// Writes the annotations of a data set, completely or not at all.
pub fn save_coco(data: &DataSet, path: &Path) -> Result<(), CocoError> {
    write_whole(path, &coco_bytes(data)).map_err(CocoError::io(path))
}

/// The file of annotations of a folder, or the file itself.
fn annotation_file(place: &Path) -> Result<PathBuf, CocoError> {
    if !place.is_dir() {
        return Ok(place.to_owned());
    }
    for name in [ANNOTATIONS, ROBOFLOW] {
        if place.join(name).is_file() {
            return Ok(place.join(name));
        }
    }
    let instances = |name: &str| name.starts_with("instances_");
    let mut found = match place.join("annotations") {
        folder if folder.is_dir() => json_files(&folder, instances)?,
        _ => Vec::new(),
    };
    if found.is_empty() {
        found = json_files(place, |_| true)?;
    }
    match found.as_slice() {
        [one] => Ok(one.clone()),
        [] => {
            let parts = ["train", "valid", "test"].map(|part| place.join(part));
            let part = parts.iter().find(|part| part.join(ROBOFLOW).is_file());
            let hint = match part {
                Some(part) => format!("name one of its parts: {}", part.display()),
                None => "give a folder with `annotations.json`, or convert it with `petzval data convert`"
                    .to_owned(),
            };
            Err(CocoError::content(place, "no annotations in COCO format in this folder", hint))
        }
        several => {
            let names: Vec<String> = several.iter().take(4).map(|path| path.display().to_string()).collect();
            let reason = format!("{} files could be the annotations", several.len());
            Err(CocoError::content(place, reason, format!("name one of them: {}", names.join(", "))))
        }
    }
}

/// The `.json` files of a folder whose names are accepted, in order.
fn json_files(folder: &Path, is_accepted: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>, CocoError> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(CocoError::io(folder))? {
        let path = entry.map_err(CocoError::io(folder))?.path();
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
    let mut folders = vec![beside.clone(), beside.join("images")];
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
