//! The pictures on which a run has trained, by their content. Scores on them say little about other pictures.

use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

use petzval_learn::dataset::{List, PictureFile};
use sha2::{Digest, Sha256};

use crate::assets::Assets;
use crate::error::Result;
use crate::experiment::{BUILT_IN_PHOTOS, Experiment, PicturesKey};
use crate::run::input_list::{InputList, Pictures};
use crate::run::{RunFolder, first_reads, hex, sha256_of_file};
use crate::setup::Setup;
use crate::task::Content;
use crate::task::pictures::built_in_photos;

/// The pictures on which a run has trained or validated, as far as their content is known.
#[derive(Debug, Default)]
pub struct TrainedPictures {
    /// Sizes of their files, bytes: a file of another size need not be read.
    sizes: HashSet<u64>,
    /// SHA-256 of their files, hexadecimal.
    digests: HashSet<String>,
}

impl TrainedPictures {
    /// Those of a run. `experiment` and `key` name its own pictures. Empty where a run sees streets.
    pub fn of_run(
        run: &RunFolder,
        experiment: &Experiment,
        key: PicturesKey,
        assets: &Assets,
    ) -> Result<Self> {
        match InputList::read(run)?.and_then(|list| list.pictures) {
            Some(listed) => Self::listed(&listed, run),
            None if experiment.pictures(key) == BUILT_IN_PHOTOS => Self::built_in(assets),
            None => Ok(Self::default()),
        }
    }

    /// Those of the list of a run.
    pub fn listed(listed: &Pictures, run: &RunFolder) -> Result<Self> {
        Ok(Self::read(listed, &first_reads::read(run)?))
    }

    /// Those of a list. `read` has the digests of a large set, by name.
    fn read(listed: &Pictures, read: &BTreeMap<String, String>) -> Self {
        let mut trained = Self::default();
        for file in listed.files.iter().filter(|file| file.list != List::HeldOut) {
            if let Some(sha256) = file.sha256.as_ref().or_else(|| read.get(&file.name)) {
                trained.sizes.insert(file.bytes);
                trained.digests.insert(sha256.clone());
            }
        }
        trained
    }

    /// The built-in photographs for training.
    fn built_in(assets: &Assets) -> Result<Self> {
        let mut trained = Self::default();
        for name in built_in_photos(assets)?.training {
            let bytes = assets.bytes(&format!("photos/{name}"))?;
            trained.sizes.insert(bytes.len() as u64);
            trained.digests.insert(hex(Sha256::new_with_prefix(bytes)));
        }
        Ok(trained)
    }

    /// Whether a file has the content of one of them, whatever its name. False for a file that cannot be read.
    pub fn holds(&self, path: &Path) -> bool {
        let has_size = path.metadata().is_ok_and(|file| self.sizes.contains(&file.len()));
        has_size && sha256_of_file(path).is_ok_and(|sha256| self.digests.contains(&sha256))
    }

    /// How many pictures of a setup are among them, and how many the setup has.
    pub fn count_in(&self, setup: &Setup) -> Result<[usize; 2]> {
        let files = |content| -> Result<Vec<PictureFile>> {
            let inputs = setup.windows()?.inputs(&setup.experiment, content, &mut Sha256::new())?;
            Ok(inputs.pictures.map_or_else(Vec::new, |pictures| pictures.files))
        };
        let is_unknown = |file: &&PictureFile| file.sha256.is_none() && self.sizes.contains(&file.bytes);
        let listed = files(Content::AtStart)?;
        let unknown: Vec<&PictureFile> = listed.iter().filter(is_unknown).collect();
        // Of a large set only the files are read that have the size of a picture of the run.
        let paths: Option<Vec<PathBuf>> = unknown.iter().map(|file| path_of(file, setup)).collect();
        let Some(paths) = paths else {
            let listed = files(Content::All)?;
            return Ok([self.count(&listed), listed.len()]);
        };
        let copies = paths.iter().filter(|path| self.holds(path)).count();
        Ok([self.count(&listed) + copies, listed.len()])
    }

    /// How many of these files are among them.
    fn count(&self, files: &[PictureFile]) -> usize {
        let is_trained = |file: &&PictureFile| file.sha256.as_ref().is_some_and(|s| self.digests.contains(s));
        files.iter().filter(is_trained).count()
    }
}

/// Where a picture of a setup is; none if it is in an archive, or if a list names it.
fn path_of(file: &PictureFile, setup: &Setup) -> Option<PathBuf> {
    let places = [&setup.experiment.photos, &setup.experiment.data].map(Path::new);
    let folders = places.into_iter().flat_map(|place| [Some(place), place.parent()]).flatten();
    let mut paths = folders.map(|folder| folder.join(&file.name));
    paths.find(|path| path.metadata().is_ok_and(|found| found.is_file() && found.len() == file.bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_under_other_names_are_known_by_their_content() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, content: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            path
        };
        let picture = |name: &str, content: &str, list: List| {
            PictureFile::of(&file(name, content), name, list, true).unwrap()
        };
        let training = picture("a.png", "trained", List::Training);
        let held_out = picture("b.png", "held out", List::HeldOut);
        // A picture of a large set has its digest from its first read.
        let validation = picture("c.png", "validated", List::Validation);
        let read = BTreeMap::from([("c.png".to_owned(), validation.sha256.clone().unwrap())]);
        let files =
            vec![training.clone(), held_out.clone(), PictureFile { sha256: None, ..validation.clone() }];
        let trained = TrainedPictures::read(&Pictures { files, ..Pictures::default() }, &read);

        assert_eq!(trained.count(&[training.clone(), held_out, validation]), 2);
        assert_eq!(trained.count(&[PictureFile { name: "other.png".into(), ..training }]), 1);
        assert!(trained.holds(&file("copy.png", "trained")) && trained.holds(&file("d.png", "validated")));
        assert!(!trained.holds(&file("e.png", "held out")) && !trained.holds(&file("f.png", "trainee")));
        assert!(!trained.holds(&folder.path().join("missing.png")));
    }
}
