//! The folder of a search: its state, its history, and the best settings.

use std::path::{Path, PathBuf};

use petzval_base::WorkLock;
use petzval_base::simd::level;
use petzval_design::evolution::Evolution;
use serde::{Deserialize, Serialize};

use super::plan::Plan;
use crate::error::{JobError, Result, json, write_file};
use crate::state_file::{make_new_folder, read_state, with_digest};

/// File of the state from which a search continues.
const STATE: &str = "search.json";

/// All that a search needs to continue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Checkpoint {
    /// What is tuned for what.
    pub plan: Plan,
    /// Settings to try in all; none where an earlier version did not keep them.
    #[serde(default)]
    pub evaluations: Option<usize>,
    /// Instruction set that it began with; empty where an earlier version did not keep it.
    #[serde(default)]
    pub simd: String,
    /// Hash of frames, references and ISP.
    pub inputs: String,
    /// Names of the parameters that vary.
    pub varied: Vec<String>,
    /// Score of the settings at the start, once it is known.
    pub start: Option<f64>,
    /// The search.
    pub search: Evolution,
    /// Its generations so far.
    pub history: Vec<Generation>,
    /// Time so far, s.
    pub seconds: f64,
}

/// A generation of a search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Generation {
    /// Its number, from 1.
    pub generation: u64,
    /// Settings tried so far.
    pub evaluations: usize,
    /// Its best score.
    pub best_of_generation: f64,
    /// Settings of it at which the ISP failed: they count as the worst.
    #[serde(default)]
    pub failed: usize,
    /// The best score so far.
    pub best: f64,
    /// Widest standard deviation of the search, as a share of the ranges.
    pub deviation: f64,
    /// How many times the search had begun again.
    pub restarts: usize,
    /// Time so far, s.
    pub seconds: f64,
}

impl Checkpoint {
    /// A search that has tried nothing yet.
    pub fn new(plan: Plan, inputs: String, varied: Vec<String>, search: Evolution) -> Self {
        Self {
            plan,
            evaluations: None,
            simd: level().to_owned(),
            inputs,
            varied,
            start: None,
            search,
            history: Vec::new(),
            seconds: 0.0,
        }
    }
}

/// The folder of a search, locked while it is open.
pub(super) struct TuneFolder {
    root: PathBuf,
    _lock: WorkLock,
}

impl TuneFolder {
    /// Makes the folder; refuses one that already holds a search, or in which another process searches.
    pub fn create(root: &Path) -> Result<Self> {
        let lock = make_new_folder(root, &root.join(STATE), "search")?;
        Ok(Self { root: root.to_owned(), _lock: lock })
    }

    /// Whether a folder holds a search.
    pub fn is_in(root: &Path) -> bool {
        root.join(STATE).is_file()
    }

    /// Reads the search in a folder.
    pub fn open(root: &Path) -> Result<(Self, Checkpoint)> {
        let hint = "--resume takes the --out folder of an earlier `isp tune`";
        let (kept, lock) = read_state(root, &root.join(STATE), "search", hint)?;
        Ok((Self { root: root.to_owned(), _lock: lock }, kept))
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The best settings.
    pub fn tuned(&self) -> PathBuf {
        self.root.join("tuned.toml")
    }

    /// All generations.
    pub fn history(&self) -> PathBuf {
        self.root.join("history.json")
    }

    fn state(&self) -> PathBuf {
        self.root.join(STATE)
    }

    /// Writes best settings, history and state. The state comes last: after a failure the folder continues from the generation
    /// before, which gives the same files again.
    pub fn save(&self, kept: &Checkpoint, tuned: &str) -> Result<()> {
        let state = with_digest(&serde_json::to_string(kept).map_err(|e| JobError::failed(e.to_string()))?);
        for (path, text) in
            [(self.tuned(), tuned), (self.history(), &json(&kept.history)?), (self.state(), &state)]
        {
            write_file(&path, text)?;
        }
        Ok(())
    }
}
