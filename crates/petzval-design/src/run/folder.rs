//! Paths of a run folder, and writing that is never seen half done.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use petzval_base::{WorkLock, sweep_parts, write_whole};
use serde::de::DeserializeOwned;

use super::holder::Holder;
use crate::error::{DesignError, Result};

/// Begins the name of a checkpoint that is not whole yet.
pub(super) const PARTIAL: &str = ".partial-";

/// The file that the process at work holds locked.
pub(super) const LOCK: &str = "run.lock";

/// The folders that every run has.
pub(super) const PARTS: [&str; 5] = ["checkpoints", "lens", "cameras", "pictures", "inputs"];

/// What a run writes before its `config.toml`, beside its empty [`PARTS`]: a process that is killed until then leaves it.
const BEGINNING: [&str; 6] = [LOCK, "inputs", "environment.json", "device.json", "tuning", "run.json"];

/// Endings of files into which shells and schedulers write what a command prints. No file of a run has one of them.
const LOG_ENDINGS: [&str; 3] = [".log", ".out", ".err"];

/// Names that a message lists of those in a folder.
const NAMED: usize = 3;

/// A run folder on disk.
#[derive(Clone, Debug)]
pub struct RunFolder {
    root: PathBuf,
}

impl RunFolder {
    /// Makes a new, empty run folder. Fails as [`check_new`](Self::check_new) does, and with the system's errors.
    pub fn create(root: &Path) -> Result<Self> {
        Self::check_new(root)?;
        for part in PARTS {
            let path = root.join(part);
            fs::create_dir_all(&path).map_err(DesignError::io(&path))?;
        }
        Ok(Self::at(root))
    }

    /// The folder of this path, whatever is there.
    pub(super) fn at(root: &Path) -> Self {
        Self { root: root.to_path_buf() }
    }

    /// Sees that a new run can begin in this folder, which need not exist. Logs, hidden files and what a run left that was killed before its first
    /// step may be in it. Fails if it is a file, or holds a run or anything else, and with the system's errors.
    pub fn check_new(root: &Path) -> Result<()> {
        let folder = Self::at(root);
        let refused = |problem: &str, hint: &str| {
            Err(DesignError::Run { path: root.to_path_buf(), problem: format!("{problem}; hint: {hint}") })
        };
        if root.exists() && !root.is_dir() {
            return refused("this is a file", "--out takes a folder, which is made if need be");
        }
        if folder.config().exists() {
            let hint = format!("resume it with `--resume {}`, or choose another with --out", root.display());
            return refused("this folder already holds a run", &hint);
        }
        // Checkpoints of another run would be taken for those of this one.
        if !is_empty(&folder.checkpoints()) {
            return refused(
                "this folder holds checkpoints, though no config.toml",
                "choose another with --out",
            );
        }
        let others = folder.others()?;
        if others.is_empty() {
            return Ok(());
        }
        let more =
            if others.len() > NAMED { format!(" and {} more", others.len() - NAMED) } else { String::new() };
        let named = others[..others.len().min(NAMED)].join(", ");
        refused(
            &format!("this folder is not empty: {named}{more}"),
            "a run needs a folder of its own: choose another with --out; it is made if need be",
        )
    }

    /// The names in the folder that a new run would mix with its own, in order. A folder that is not there has none.
    fn others(&self) -> Result<Vec<String>> {
        let entries = match fs::read_dir(&self.root) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries.map_err(DesignError::io(&self.root))?,
        };
        // The lock is the first file of every run.
        let was_begun = self.root.join(LOCK).is_file();
        let is_left = |name: &str| {
            BEGINNING.contains(&name) || PARTS.contains(&name) && is_empty(&self.root.join(name))
        };
        let mut others = Vec::new();
        for entry in entries {
            let name = entry.map_err(DesignError::io(&self.root))?.file_name().to_string_lossy().into_owned();
            let is_log = name.starts_with('.') || LOG_ENDINGS.iter().any(|ending| name.ends_with(ending));
            if !(is_log || was_begun && is_left(&name)) {
                others.push(name);
            }
        }
        others.sort();
        Ok(others)
    }

    /// Opens a run folder that exists.
    pub fn open(root: &Path) -> Result<Self> {
        let folder = Self::at(root);
        if !folder.config().is_file() {
            let why = match root.metadata() {
                Ok(about) if about.is_dir() => "it has no config.toml",
                Ok(_) => "it is a file",
                Err(_) => "there is no such folder",
            };
            let hint = "give the folder of a run; `petzval runs DIR` lists those below a folder";
            let problem = format!("not a run folder: {why}; hint: {hint}");
            return Err(DesignError::Run { path: root.to_path_buf(), problem });
        }
        Ok(folder)
    }

    /// Keeps other processes from working in this folder until the returned lock is dropped.
    pub fn lock(&self) -> Result<WorkLock> {
        let path = self.root.join(LOCK);
        let holder = DesignError::json("the process at work", Holder::own())?;
        match WorkLock::kept(&path, holder.as_bytes()) {
            Ok(lock) => {
                self.sweep();
                Ok(lock)
            }
            Err(fs::TryLockError::WouldBlock) => {
                let problem = "another process is working on this run; wait for it to end".to_owned();
                Err(DesignError::Run { path: self.root.clone(), problem })
            }
            Err(fs::TryLockError::Error(error)) => Err(DesignError::Io { path, error }),
        }
    }

    /// Whether a process holds the lock.
    pub fn is_at_work(&self) -> bool {
        let file = petzval_base::open_file(self.root.join(LOCK));
        file.is_ok_and(|file| {
            let is_held = matches!(file.try_lock_shared(), Err(fs::TryLockError::WouldBlock));
            let _ends_with_the_file = file.unlock();
            is_held
        })
    }

    /// The process that holds the lock, if there is one and it has written its name.
    pub fn holder(&self) -> Option<Holder> {
        let text = petzval_base::read_text(self.root.join(LOCK)).ok().filter(|_| self.is_at_work())?;
        serde_json::from_str(&text).ok()
    }

    /// Removes what processes that were killed have left unfinished. Nobody else works on the run while it is locked.
    fn sweep(&self) {
        sweep_parts(&self.root);
        for entry in fs::read_dir(self.checkpoints()).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(PARTIAL) {
                // What cannot be removed does no harm.
                let _stays = fs::remove_dir_all(entry.path());
            }
        }
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The resolved experiment.
    pub fn config(&self) -> PathBuf {
        self.root.join("config.toml")
    }

    /// What the run was begun with, and when.
    pub fn record(&self) -> PathBuf {
        self.root.join("run.json")
    }

    /// Machine, version, command.
    pub fn environment(&self) -> PathBuf {
        self.root.join("environment.json")
    }

    /// What the check of the device found on which the run trains, if that is not the CPU.
    pub fn device(&self) -> PathBuf {
        self.root.join("device.json")
    }

    /// Which kernels were found the fastest on that device: with them a run goes on as it began.
    pub fn tuning(&self) -> PathBuf {
        self.root.join("tuning")
    }

    /// Fingerprint of lens, sensor and photographs.
    pub fn fingerprint(&self) -> PathBuf {
        self.root.join("inputs").join("sha256")
    }

    /// The inputs one by one.
    pub fn input_list(&self) -> PathBuf {
        self.root.join("inputs").join("inputs.json")
    }

    /// Digests of pictures from their first read.
    pub fn first_reads(&self) -> PathBuf {
        self.input("first-reads.jsonl")
    }

    /// The lens that the run began with, glasses included.
    pub fn nominal_lens(&self) -> PathBuf {
        self.root.join("inputs").join("lens.toml")
    }

    /// A file that the run was made from.
    pub fn input(&self, file: &str) -> PathBuf {
        self.root.join("inputs").join(file)
    }

    /// The sensor.
    pub fn sensor(&self) -> PathBuf {
        self.root.join("inputs").join("sensor.toml")
    }

    /// One line a step.
    pub fn events(&self) -> PathBuf {
        self.root.join("events.jsonl")
    }

    /// Numbers of every step as comma-separated values, if they are written.
    pub fn scalars_csv(&self) -> PathBuf {
        self.root.join("scalars.csv")
    }

    /// Event files of TensorBoard, a folder for each camera, if they are written.
    pub fn tensorboard(&self) -> PathBuf {
        self.root.join("tensorboard")
    }

    /// Final figures.
    pub fn metrics(&self) -> PathBuf {
        self.root.join("metrics.json")
    }

    /// Final figures of the cameras as comma-separated values.
    pub fn metrics_csv(&self) -> PathBuf {
        self.root.join("metrics.csv")
    }

    /// Scores of every picture as comma-separated values; not there where no picture has scores of its own.
    pub fn pictures_csv(&self) -> PathBuf {
        self.root.join("pictures.csv")
    }

    /// Figures of cameras as they are made.
    pub fn tolerance(&self) -> PathBuf {
        self.root.join("tolerance.json")
    }

    /// The files of figures and events that have a digest in the run folder. That of the record is noted with the end of the run.
    pub fn figures(&self) -> [PathBuf; 5] {
        [self.metrics(), self.metrics_csv(), self.pictures_csv(), self.tolerance(), self.events()]
    }

    /// The report.
    pub fn report(&self) -> PathBuf {
        self.root.join("report.html")
    }

    /// Checkpoints.
    pub fn checkpoints(&self) -> PathBuf {
        self.root.join("checkpoints")
    }

    /// Lens and network of a finished camera.
    pub fn camera(&self, name: &str) -> PathBuf {
        self.root.join("cameras").join(name)
    }

    /// The figures of a camera, written after its lens and its blocks: a camera that has them is finished.
    pub fn camera_metrics(&self, name: &str) -> PathBuf {
        self.camera(name).join("metrics.json")
    }

    /// The weights of a camera's network, in a format that others read.
    pub fn camera_weights(&self, name: &str) -> PathBuf {
        self.camera(name).join("network.safetensors")
    }

    /// Those of some cameras that are finished.
    pub fn finished<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
        names.into_iter().filter(|name| self.camera_metrics(name).is_file()).collect()
    }

    /// The lens after a step of the run.
    pub fn lens_at_step(&self, step: u64) -> PathBuf {
        self.root.join("lens").join(format!("step-{step:06}.toml"))
    }

    /// A held-out picture.
    pub fn picture(&self, file: &str) -> PathBuf {
        self.root.join("pictures").join(file)
    }
}

/// Whether a folder holds nothing, or is not there.
fn is_empty(folder: &Path) -> bool {
    fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none())
}

/// Reads a JSON file of a run.
pub(crate) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = petzval_base::read_text(path).map_err(DesignError::io(path))?;
    serde_json::from_str(&text).map_err(|error| {
        let problem = format!("the file is damaged, {error}; hint: put it back from a copy of the run");
        DesignError::Run { path: path.to_path_buf(), problem }
    })
}

/// Reads a JSON file of a run; none if there is no such file, as in a folder of an earlier version.
pub(crate) fn read_json_if_there<T: DeserializeOwned>(path: &Path) -> Result<Option<T>> {
    if path.is_file() { read_json(path).map(Some) } else { Ok(None) }
}

/// Writes a file of a run whole or not at all.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole(path, bytes).map_err(DesignError::io(path))
}
