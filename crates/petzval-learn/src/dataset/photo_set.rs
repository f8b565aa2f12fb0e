//! Pictures, split into training and held-out pictures.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use petzval_base::Cancel;
use petzval_camera::image::LinearImage;
use petzval_files::{Picture, load_image};
use serde::{Deserialize, Serialize};

use super::DatasetError;

/// A picture, and its name in lists, logs and errors.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedPhoto {
    /// File name without folder, such as `coffee.png`.
    pub name: String,
    /// The picture in linear light.
    pub image: LinearImage,
}

impl NamedPhoto {
    /// Refuses a picture that cannot hold a square window of `needed` pixels a side.
    pub fn check_holds(&self, needed: usize) -> Result<(), DatasetError> {
        let LinearImage { height, width, .. } = self.image;
        if height >= needed && width >= needed {
            return Ok(());
        }
        Err(DatasetError::PhotoTooSmall { name: self.name.clone(), height, width, needed })
    }
}

/// Names of the training pictures and of the held-out pictures.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhotoSplit {
    /// Pictures on which the network and the lens are trained.
    pub training: Vec<String>,
    /// Pictures on which every published number is computed.
    pub held_out: Vec<String>,
}

/// Training, validation and held-out pictures, with no picture in two of the lists.
#[derive(Clone, Debug, Default)]
pub struct PhotoSet {
    training: Vec<NamedPhoto>,
    validation: Vec<NamedPhoto>,
    held_out: Vec<NamedPhoto>,
}

impl PhotoSet {
    /// Sorts `photos` into the two lists of `split`; pictures in neither list are dropped.
    ///
    /// Fails on an empty list, an unknown or repeated name, a name in both lists, and a training picture that equals a held-out
    /// picture of another name.
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

        // Compare contents too: a renamed copy in both lists would falsify the scores.
        for judge in &held_out {
            if let Some(same) = training.iter().find(|t| t.image == judge.image) {
                return Err(DatasetError::SameContent {
                    training: same.name.clone(),
                    held_out: judge.name.clone(),
                });
            }
        }
        Ok(Self { training, validation: Vec::new(), held_out })
    }

    /// Pictures that are all for scores. Fails without a picture, and on a name that is there twice.
    pub fn for_scores(photos: Vec<NamedPhoto>) -> Result<Self, DatasetError> {
        let names: Vec<String> = photos.iter().map(|photo| photo.name.clone()).collect();
        let held_out = pick(&photos, "held_out", &names)?;
        Ok(Self { held_out, ..Self::default() })
    }

    /// The same with every `every`-th training picture, or the last of fewer, kept for validation in place of training. Fails if none would be
    /// left for training.
    pub fn with_validation(self, every: usize) -> Result<Self, DatasetError> {
        let every = every.min(self.training.len());
        let (mut training, mut validation) = (Vec::new(), self.validation);
        for (i, photo) in self.training.into_iter().enumerate() {
            let list = if (i + 1).is_multiple_of(every) { &mut validation } else { &mut training };
            list.push(photo);
        }
        if training.is_empty() {
            Err(DatasetError::EmptyList { list: "training" })
        } else {
            Ok(Self { training, validation, held_out: self.held_out })
        }
    }

    /// The training pictures, in the order of the split.
    pub fn training(&self) -> &[NamedPhoto] {
        &self.training
    }

    /// The pictures of validations; none unless [`PhotoSet::with_validation`] kept some.
    pub fn validation(&self) -> &[NamedPhoto] {
        &self.validation
    }

    /// The held-out pictures, in the order of the split.
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

/// The pictures of a folder.
#[derive(Debug, Default)]
pub struct Folder {
    /// Those that can be used.
    pub photos: Vec<NamedPhoto>,
    /// Names of the others, each with the reason.
    pub skipped: Vec<(String, DatasetError)>,
    /// What files say that was not obeyed ([`Picture::notes`](petzval_files::Picture::notes)), with the name of the picture.
    pub notes: Vec<(String, String)>,
}

impl Folder {
    /// Takes out the pictures in which `check` finds something wrong.
    pub fn skip(&mut self, mut check: impl FnMut(&NamedPhoto) -> Result<(), DatasetError>) {
        let skipped = &mut self.skipped;
        self.photos.retain(|photo| match check(photo) {
            Ok(()) => true,
            Err(reason) => {
                skipped.push((photo.name.clone(), reason));
                false
            }
        });
    }

    /// Takes out every picture that is the same as an earlier one.
    pub fn skip_copies(&mut self) {
        let photos = std::mem::take(&mut self.photos);
        for photo in photos {
            match self.photos.iter().find(|earlier| earlier.image == photo.image) {
                Some(first) => {
                    let reason = DatasetError::Copy { name: photo.name.clone(), first: first.name.clone() };
                    self.skipped.push((photo.name, reason));
                }
                None => self.photos.push(photo),
            }
        }
    }
}

/// Reads every `.png`, `.jpg`, `.jpeg`, `.tif` and `.tiff` file of a folder, without subfolders, sorted by name.
///
/// The name of a picture is its file name. Files that cannot be decoded are skipped. Fails on a folder without pictures.
pub fn load_folder(folder: impl AsRef<Path>, cancel: &Cancel) -> Result<Folder, DatasetError> {
    let mut found = Folder::default();
    for path in picture_paths(folder.as_ref())? {
        cancel.check()?;
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        match load_image(&path) {
            Ok(Picture { light, notes, .. }) => {
                found.notes.extend(notes.into_iter().map(|note| (name.clone(), note)));
                found.photos.push(NamedPhoto { name, image: light });
            }
            Err(error) => found.skipped.push((name, error.into())),
        }
    }
    Ok(found)
}

/// Every `.png`, `.jpg`, `.jpeg`, `.tif` and `.tiff` file of a folder, without subfolders, sorted by name. Fails if there is none.
pub(super) fn picture_paths(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
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
    Ok(paths)
}
