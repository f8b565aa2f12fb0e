//! The folder of a proxy: its state while it is trained, its weights and its description.

use std::path::{Path, PathBuf};

use petzval_base::write_whole;
use petzval_design::error::DesignError;
use petzval_files::isp_file::IspProxyFile;
use serde::{Deserialize, Serialize};

use super::plan::{Plan, Record};
use crate::error::{JobError, json, make_folder};

/// File of the weights.
pub(super) const WEIGHTS: &str = "weights.bin";

/// All that a training needs to continue, beside weights and optimiser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Kept {
    /// What is imitated, and how.
    pub plan: Plan,
    /// Steps that were taken.
    pub step: usize,
    /// Time that they took, s.
    pub seconds: f64,
    /// Losses on the way.
    pub history: Vec<Record>,
}

impl Kept {
    /// A training that has not begun.
    pub fn new(plan: Plan) -> Self {
        Self { plan, step: 0, seconds: 0.0, history: Vec::new() }
    }
}

/// The folder of a training.
pub(super) struct ProxyFolder(PathBuf);

impl ProxyFolder {
    /// Makes the folder; refuses one that already holds a training.
    pub fn create(root: &Path) -> Result<Self, JobError> {
        let folder = Self(root.to_owned());
        if folder.training().exists() {
            let hint = "continue it with --resume, or choose another folder";
            return Err(JobError::setting(
                "out",
                root.display(),
                "this folder already holds a training",
                hint,
            ));
        }
        make_folder(root)?;
        Ok(folder)
    }

    /// Reads the training in a folder.
    pub fn open(root: &Path) -> Result<(Self, Kept), JobError> {
        let folder = Self(root.to_owned());
        let path = folder.training();
        let wrong = |message: String| {
            let hint = "--resume takes the --out folder of an earlier `train isp-proxy`";
            JobError::input(format!("{}: {message}", path.display()), hint)
        };
        let text = std::fs::read_to_string(&path).map_err(|e| wrong(e.to_string()))?;
        let kept = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
        Ok((folder, kept))
    }

    /// Description of the finished proxy.
    pub fn description(&self) -> PathBuf {
        self.0.join("proxy.toml")
    }

    /// Page of its pictures.
    pub fn page(&self) -> PathBuf {
        self.0.join("proxy.html")
    }

    fn training(&self) -> PathBuf {
        self.0.join("training.json")
    }

    /// Files of weights and optimiser after a step.
    fn parts(&self, step: usize) -> [PathBuf; 2] {
        ["weights", "optimizer"].map(|part| self.0.join(format!("{part}-{step:07}.bin")))
    }

    /// Weights and optimiser of a training.
    pub fn state(&self, kept: &Kept) -> Result<[Vec<u8>; 2], JobError> {
        let [weights, optimizer] = self.parts(kept.step);
        let read = |path: PathBuf| std::fs::read(&path).map_err(DesignError::io(&path));
        Ok([read(weights)?, read(optimizer)?])
    }

    /// Keeps a state. The record comes last and names the files by its step, so that a folder always holds one whole state.
    pub fn keep(&self, kept: &Kept, state: &[Vec<u8>; 2]) -> Result<(), JobError> {
        for (path, bytes) in self.parts(kept.step).iter().zip(state) {
            write_whole(path, bytes).map_err(DesignError::io(path))?;
        }
        write_whole(&self.training(), json(kept)?.as_bytes()).map_err(DesignError::io(&self.training()))?;
        self.remove_states_but(kept.step)
    }

    fn remove_states_but(&self, step: usize) -> Result<(), JobError> {
        let kept = self.parts(step);
        for entry in std::fs::read_dir(&self.0).map_err(DesignError::io(&self.0))? {
            let path = entry.map_err(DesignError::io(&self.0))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let is_state = ["weights-", "optimizer-"].iter().any(|start| name.starts_with(start));
            if is_state && name.ends_with(".bin") && !kept.contains(&path) {
                std::fs::remove_file(&path).map_err(DesignError::io(&path))?;
            }
        }
        Ok(())
    }

    /// Writes the finished proxy; the description comes last.
    pub fn finish(&self, weights: &[u8], description: &IspProxyFile, page: &str) -> Result<(), JobError> {
        let text = toml::to_string(description).map_err(|e| JobError::failed(e.to_string()))?;
        for (path, bytes) in [
            (self.0.join(WEIGHTS), weights),
            (self.page(), page.as_bytes()),
            (self.description(), text.as_bytes()),
        ] {
            write_whole(&path, bytes).map_err(DesignError::io(&path))?;
        }
        Ok(())
    }
}
