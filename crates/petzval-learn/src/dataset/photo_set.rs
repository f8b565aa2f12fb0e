//! Pictures split into those to train on and those to judge by.

use std::{collections::BTreeSet, fs, path::Path};

use petzval_camera::image::LinearImage;
use petzval_files::load_image;
use serde::{Deserialize, Serialize};

use super::DatasetError;

/// A picture and the name it goes by in lists, logs and errors.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedPhoto {
    /// File name without folder, such as `coffee.png`.
    pub name: String,
    /// The picture in linear light.
    pub image: LinearImage,
}

/// Which pictures are for training and which are held out, by name.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhotoSplit {
    /// Names of the pictures the network and the lens are trained on.
    pub training: Vec<String>,
    /// Names of the pictures every published number is computed on.
    pub held_out: Vec<String>,
}

/// Training and held-out pictures, with no picture in both.
#[derive(Clone, Debug, Default)]
pub struct PhotoSet {
    training: Vec<NamedPhoto>,
    held_out: Vec<NamedPhoto>,
}

impl PhotoSet {
    /// Sorts `photos` into the two lists of `split`; pictures in neither list are dropped.
    ///
    /// Refuses an empty list, an unknown or repeated name, a name in both lists, and equal pictures under different
    /// names on the two sides.
    pub fn new(photos: Vec<NamedPhoto>, split: &PhotoSplit) -> Result<Self, DatasetError> {
        let mut names = BTreeSet::new();
        if let Some(twice) = photos.iter().find(|p| !names.insert(p.name.as_str())) {
            return Err(DatasetError::DuplicateName { name: twice.name.clone() });
        }
        if let Some(both) = split.training.iter().find(|n| split.held_out.contains(n)) {
            return Err(DatasetError::InBothLists { name: both.clone() });
        }
        let training = pick(&photos, "training", &split.training)?;
        let held_out = pick(&photos, "held_out", &split.held_out)?;

        // Compare contents too: a renamed copy would leak just as well.
        for judge in &held_out {
            if let Some(same) = training.iter().find(|t| t.image == judge.image) {
                return Err(DatasetError::SameContent {
                    training: same.name.clone(),
                    held_out: judge.name.clone(),
                });
            }
        }
        Ok(Self { training, held_out })
    }

    /// The pictures to train on, in the order of the split.
    pub fn training(&self) -> &[NamedPhoto] {
        &self.training
    }

    /// The pictures to judge by, in the order of the split.
    pub fn held_out(&self) -> &[NamedPhoto] {
        &self.held_out
    }
}

fn pick(
    photos: &[NamedPhoto],
    list: &'static str,
    names: &[String],
) -> Result<Vec<NamedPhoto>, DatasetError> {
    if names.is_empty() {
        return Err(DatasetError::EmptyList { list });
    }
    let mut seen = BTreeSet::new();
    names
        .iter()
        .map(|name| {
            if !seen.insert(name) {
                return Err(DatasetError::DuplicateName { name: name.clone() });
            }
            photos.iter().find(|p| &p.name == name).cloned().ok_or_else(|| {
                let known: Vec<&str> = photos.iter().map(|p| p.name.as_str()).collect();
                DatasetError::UnknownName { list, name: name.clone(), known: known.join(", ") }
            })
        })
        .collect()
}

/// Reads every `.png`, `.jpg`, `.jpeg`, `.tif` and `.tiff` of a folder, sorted by name, subfolders left out.
///
/// Each picture is named by its file name. The first file that cannot be decoded is an error that names it.
pub fn load_folder(folder: impl AsRef<Path>) -> Result<Vec<NamedPhoto>, DatasetError> {
    let folder = folder.as_ref();
    let cannot_read = |path: &Path| {
        let path = path.to_path_buf();
        move |source| DatasetError::Io { path, source }
    };
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(cannot_read(folder))? {
        let path = entry.map_err(cannot_read(folder))?.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let picture = matches!(extension.as_deref(), Some("png" | "jpg" | "jpeg" | "tif" | "tiff"));
        if picture && path.is_file() {
            paths.push(path);
        }
    }
    paths.sort();
    if paths.is_empty() {
        return Err(DatasetError::EmptyFolder { path: folder.to_path_buf() });
    }
    paths
        .iter()
        .map(|path| {
            let image = load_image(path)?;
            let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            Ok(NamedPhoto { name, image })
        })
        .collect()
}
