//! The folder of a run that begins, which becomes what it was before if the run is refused.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use petzval_base::WorkLock;

use super::folder::{LOCK, PARTS, RunFolder};
use crate::error::{DesignError, Result};

/// The folder of a run that begins: locked, with the list of what was made for it.
#[derive(Debug)]
pub struct BegunRun {
    folder: RunFolder,
    lock: WorkLock,
    /// The folder itself and its parents, as far as they were not there: the outermost first.
    above: Vec<PathBuf>,
    /// Folders in it that were not there.
    inside: Vec<PathBuf>,
    had_lock: bool,
}

impl BegunRun {
    /// Makes the folder of a new run and locks it. Fails as [`RunFolder::check_new`] and [`RunFolder::lock`] do, and with the system's errors; then
    /// nothing is left behind.
    pub fn new(root: &Path) -> Result<Self> {
        RunFolder::check_new(root)?;
        let mut above = Vec::new();
        make_with_parents(root, &mut above)?;
        let folder = RunFolder::at(root);
        let had_lock = root.join(LOCK).exists();
        let lock = match folder.lock() {
            Ok(lock) => lock,
            Err(error) => {
                // A folder in which another process works is not empty, and stays.
                let _stays = above.iter().rev().try_for_each(|path| remove_if_empty(path));
                return Err(error);
            }
        };
        let mut begun = Self { folder, lock, above, inside: Vec::new(), had_lock };
        match begun.make_parts() {
            Ok(()) => Ok(begun),
            Err(error) => {
                let _stays = begun.take_back();
                Err(error)
            }
        }
    }

    /// Another process may have begun a run here and ended since the first look.
    fn make_parts(&mut self) -> Result<()> {
        RunFolder::check_new(self.folder.root())?;
        PARTS.iter().try_for_each(|part| make_with_parents(&self.folder.root().join(part), &mut self.inside))
    }

    /// The folder.
    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

    /// The folder, and the lock that keeps other processes away until it is dropped.
    pub fn keep(self) -> (RunFolder, WorkLock) {
        (self.folder, self.lock)
    }

    /// Removes the empty folders that were made for a run that is refused. What was there before stays, and what came into them.
    pub fn take_back(self) -> Result<()> {
        self.inside.iter().rev().try_for_each(|path| remove_if_empty(path))?;
        // Only now may another process begin here.
        if !self.had_lock {
            let path = self.folder.root().join(LOCK);
            fs::remove_file(&path).map_err(DesignError::io(&path))?;
        }
        self.above.iter().rev().try_for_each(|path| remove_if_empty(path))
    }
}

/// Makes a folder with its parents, and lists those that were not there, the outermost first.
fn make_with_parents(path: &Path, made: &mut Vec<PathBuf>) -> Result<()> {
    let missing: Vec<&Path> =
        path.ancestors().take_while(|folder| !folder.as_os_str().is_empty() && !folder.exists()).collect();
    for folder in missing.into_iter().rev() {
        match fs::create_dir(folder) {
            Ok(()) => made.push(folder.to_owned()),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(DesignError::io(folder)(error)),
        }
    }
    Ok(())
}

/// Removes a folder unless something is in it.
fn remove_if_empty(path: &Path) -> Result<()> {
    let stays =
        |error: &io::Error| matches!(error.kind(), ErrorKind::DirectoryNotEmpty | ErrorKind::NotFound);
    match fs::remove_dir(path) {
        Err(error) if !stays(&error) => Err(DesignError::io(path)(error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Everything below a folder, by path, in order.
    fn tree(root: &Path) -> Vec<PathBuf> {
        let mut all: Vec<PathBuf> = Vec::new();
        let mut left = vec![root.to_owned()];
        while let Some(folder) = left.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                left.extend(path.is_dir().then(|| path.clone()));
                all.push(path);
            }
        }
        all.sort();
        all
    }

    #[test]
    fn a_refused_run_leaves_what_a_user_had_before() {
        let place = tempfile::tempdir().unwrap();
        let root = place.path().join("run");
        fs::create_dir(&root).unwrap();
        // What the shell and the scheduler that start the run make there.
        for file in [".nfs1", "train.log", "slurm-1.out"] {
            fs::write(root.join(file), "mine").unwrap();
        }
        let before = tree(place.path());
        let begun = BegunRun::new(&root).unwrap();
        assert!(PARTS.iter().all(|part| root.join(part).is_dir()) && root.join(LOCK).is_file());
        begun.take_back().unwrap();
        assert_eq!(tree(place.path()), before);

        // What came into a folder meanwhile stays as well, and so does a lock that was there.
        fs::write(root.join(LOCK), "").unwrap();
        let begun = BegunRun::new(&root).unwrap();
        fs::write(root.join("cameras/mine"), "mine").unwrap();
        begun.take_back().unwrap();
        let more = ["cameras", "cameras/mine", LOCK].map(|name| root.join(name));
        let mut expected: Vec<PathBuf> = before.into_iter().chain(more).collect();
        expected.sort();
        assert_eq!(tree(place.path()), expected);
    }

    #[test]
    fn a_run_does_not_begin_among_files_of_others() {
        let place = tempfile::tempdir().unwrap();
        for (number, file) in [
            "report.html",
            "metrics.csv",
            "metrics.json",
            "run.json",
            "inputs/lens.toml",
            "pictures/a.png",
            "d/e",
        ]
        .into_iter()
        .enumerate()
        {
            let root = place.path().join(number.to_string());
            fs::create_dir_all(root.join(file).parent().unwrap()).unwrap();
            fs::write(root.join(file), "mine").unwrap();
            let before = tree(&root);
            let error = BegunRun::new(&root).unwrap_err().to_string();
            let first = file.split('/').next().unwrap();
            assert!(error.contains(&format!("is not empty: {first}; hint: ")), "{error}");
            assert_eq!(tree(&root), before);
        }
    }

    #[test]
    fn a_run_that_was_killed_before_its_first_step_can_begin_again() {
        let place = tempfile::tempdir().unwrap();
        let root = place.path().join("run");
        let (folder, lock) = BegunRun::new(&root).unwrap().keep();
        for path in [folder.environment(), folder.device(), folder.nominal_lens(), folder.record()] {
            fs::write(path, "{}").unwrap();
        }
        // The lock ends with the process, and its file stays.
        drop(lock);
        drop(BegunRun::new(&root).unwrap());
        // What comes later is not of a beginning.
        for path in [folder.metrics(), folder.picture("a.png")] {
            fs::write(&path, "{}").unwrap();
            let error = BegunRun::new(&root).unwrap_err().to_string();
            assert!(error.contains("is not empty"), "{error}");
            fs::remove_file(&path).unwrap();
        }
        // Without the lock no run was begun here.
        fs::remove_file(root.join(LOCK)).unwrap();
        let error = BegunRun::new(&root).unwrap_err().to_string();
        assert!(error.contains("is not empty: cameras, checkpoints, device.json and 5 more"), "{error}");
    }

    #[test]
    fn a_refused_run_takes_its_own_folders_with_it() {
        let place = tempfile::tempdir().unwrap();
        BegunRun::new(&place.path().join("runs/first")).unwrap().take_back().unwrap();
        assert_eq!(tree(place.path()), [] as [PathBuf; 0]);
    }

    #[test]
    fn two_that_begin_in_one_folder_do_not_undo_each_other() {
        let place = tempfile::tempdir().unwrap();
        let root = place.path().join("run");
        let first = BegunRun::new(&root).unwrap();
        let before = tree(&root);
        let error = BegunRun::new(&root).unwrap_err().to_string();
        assert!(error.contains("another process is working on this run"), "{error}");
        assert_eq!(tree(&root), before);
        // The first ends; the next finds a folder of its own.
        first.take_back().unwrap();
        assert!(!root.exists());
        let (folder, lock) = BegunRun::new(&root).unwrap().keep();
        fs::write(folder.config(), "").unwrap();
        drop(lock);
        let error = BegunRun::new(&root).unwrap_err().to_string();
        assert!(error.contains("already holds a run") && folder.checkpoints().is_dir(), "{error}");
    }
}
