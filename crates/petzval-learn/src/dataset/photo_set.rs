//! Pictures, split into training and held-out pictures.

use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_files::PICTURE_ENDINGS;
use serde::{Deserialize, Serialize};

use super::photo::{Photo, Readers};
use super::{DatasetError, FirstReads, List};

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
    training: Vec<Photo>,
    validation: Vec<Photo>,
    held_out: Vec<Photo>,
    readers: Arc<Readers>,
}

impl PhotoSet {
    /// Sorts `photos` into the two lists of `split`; pictures in neither list are dropped.
    ///
    /// Fails on an empty list, an unknown or repeated name, a name in both lists, and a training picture that equals a held-out
    /// picture of another name.
    pub fn new(photos: Vec<Photo>, split: &PhotoSplit) -> Result<Self, DatasetError> {
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
            if let Some(same) = training.iter().find(|t| t.is_same(judge)) {
                return Err(DatasetError::SameContent {
                    training: same.name.clone(),
                    held_out: judge.name.clone(),
                });
            }
        }
        Ok(Self { training, held_out, ..Self::default() })
    }

    /// Lists for training, validation and scores, of photographs of different names and contents, with what reads them. Fails where the first or the
    /// last is empty.
    pub fn of_lists(
        [training, validation, held_out]: [Vec<Photo>; 3],
        readers: Readers,
    ) -> Result<Self, DatasetError> {
        for (list, photos) in [("training", &training), ("held_out", &held_out)] {
            if photos.is_empty() {
                return Err(DatasetError::EmptyList { list });
            }
        }
        Ok(Self { training, validation, held_out, readers: Arc::new(readers) })
    }

    /// Pictures that are all for scores. Fails without a picture, and on a name that is there twice.
    pub fn for_scores(photos: Vec<Photo>, readers: Readers) -> Result<Self, DatasetError> {
        if photos.is_empty() {
            return Err(DatasetError::EmptyList { list: "held_out" });
        }
        let mut names = BTreeSet::new();
        match photos.iter().find(|photo| !names.insert(photo.name.as_str())) {
            Some(twice) => Err(DatasetError::DuplicateName { name: twice.name.clone() }),
            None => Ok(Self { held_out: photos, readers: Arc::new(readers), ..Self::default() }),
        }
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
            Ok(Self { training, validation, held_out: self.held_out, readers: self.readers })
        }
    }

    /// The same with at most so many held-out pictures, spread evenly over all; 0 keeps them all.
    pub fn with_held_out(self, most: usize) -> Self {
        let all = self.held_out.len();
        if most == 0 || most >= all {
            return self;
        }
        let held_out = (0..most).map(|k| self.held_out[k * all / most].clone()).collect();
        Self { held_out, ..self }
    }

    /// Whether the light of all photographs is kept in memory.
    pub fn keeps_all(&self) -> bool {
        let lists = [&self.training, &self.validation, &self.held_out];
        let stored = lists.into_iter().flatten().filter(|photo| photo.file().is_some());
        let bytes = |photo: &Photo| (size_of::<f32>() * CHANNELS * photo.height * photo.width) as u64;
        stored.map(bytes).sum::<u64>() <= self.readers.shelf.most_bytes()
    }

    /// The pictures of a list.
    pub fn list(&self, list: List) -> &[Photo] {
        match list {
            List::Training => &self.training,
            List::Validation => &self.validation,
            List::HeldOut => &self.held_out,
        }
    }

    /// The light of one of its photographs.
    pub fn light(&self, photo: &Photo) -> Result<Arc<LinearImage>, DatasetError> {
        photo.light(&self.readers)
    }

    /// Digests of files from their first read; none where all pictures were read at the start.
    pub fn first_reads(&self) -> Option<&FirstReads> {
        self.readers.reads.as_ref()
    }

    /// The training pictures, in the order of the split.
    pub fn training(&self) -> &[Photo] {
        &self.training
    }

    /// The pictures of validations; none unless [`PhotoSet::with_validation`] kept some.
    pub fn validation(&self) -> &[Photo] {
        &self.validation
    }

    /// The held-out pictures, in the order of the split.
    pub fn held_out(&self) -> &[Photo] {
        &self.held_out
    }
}

fn pick(photos: &[Photo], list: &'static str, names: &[String]) -> Result<Vec<Photo>, DatasetError> {
    if names.is_empty() {
        return Err(DatasetError::EmptyList { list });
    }
    let mut seen = BTreeSet::new();
    let by_name: HashMap<&str, &Photo> = photos.iter().map(|photo| (photo.name.as_str(), photo)).collect();
    names
        .iter()
        .map(|name| {
            if !seen.insert(name) {
                return Err(DatasetError::DuplicateName { name: name.clone() });
            }
            by_name.get(name.as_str()).copied().cloned().ok_or_else(|| {
                let known: Vec<&str> = photos.iter().map(|p| p.name.as_str()).collect();
                DatasetError::UnknownName { list, name: name.clone(), known: known.join(", ") }
            })
        })
        .collect()
}

/// Every picture of a folder by its [ending](PICTURE_ENDINGS), without subfolders, sorted by name. Fails if there is none.
pub(super) fn picture_paths(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let cannot_read = |path: &Path| {
        let path = path.to_path_buf();
        move |source| DatasetError::Io { path, source }
    };
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(cannot_read(folder))? {
        let path = entry.map_err(cannot_read(folder))?.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let picture = extension.is_some_and(|ending| PICTURE_ENDINGS.contains(&ending.as_str()));
        // A broken link is an error when it is read.
        if picture && (path.is_file() || path.is_symlink() && !path.is_dir()) {
            paths.push(path);
        }
    }
    paths.sort();
    if paths.is_empty() {
        return Err(DatasetError::EmptyFolder { path: folder.to_path_buf() });
    }
    Ok(paths)
}
