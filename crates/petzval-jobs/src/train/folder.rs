//! The folder of a network in training: its state, then its weights and its description. And the loop that goes on with it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use petzval_base::WorkLock;
use petzval_design::error::DesignError;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::{JobError, Result, json, write_file};
use crate::event::Event;
use crate::state_file::{make_new_folder, read_state, with_digest};

/// Steps between two records of the losses, and between two states from which training can continue.
const RECORD_EVERY: usize = 50;
const KEEP_EVERY: usize = 250;

/// A state is kept after so long at the latest, however long steps take.
const KEEP_WITHIN: Duration = Duration::from_secs(60);

/// File of the state from which a training continues.
const STATE: &str = "training.json";

/// File of the weights.
pub(super) const WEIGHTS: &str = "weights.bin";

/// File of the weights for other programs.
const SAFETENSORS: &str = "weights.safetensors";

/// All that a training needs to continue, beside weights and optimiser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Kept<P, I, L> {
    /// What is imitated, and how.
    pub plan: P,
    /// What the names in the plan stood for when the training began.
    pub inputs: I,
    /// Steps that were taken.
    pub step: usize,
    /// Time that they took, s.
    pub seconds: f64,
    /// Losses on the way.
    pub history: Vec<Record<L>>,
    /// Losses of the steps since the last record; none where an earlier version did not keep them.
    #[serde(default = "Vec::new")]
    pub recent: Vec<L>,
}

/// The mean losses of some steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record<L> {
    /// Steps taken at its end.
    pub step: usize,
    /// Their mean losses.
    pub losses: L,
}

impl<P, I, L> Kept<P, I, L> {
    /// A training that has not begun.
    pub fn new(plan: P, inputs: I) -> Self {
        Self { plan, inputs, step: 0, seconds: 0.0, history: Vec::new(), recent: Vec::new() }
    }
}

/// A network in training.
pub(super) trait Training {
    /// The losses of a step.
    type Losses: Copy + Serialize;

    /// Takes a step.
    fn step(&mut self, step: usize) -> Result<Self::Losses>;

    /// The mean of the losses of steps, of which there is at least one.
    fn mean(losses: &[Self::Losses]) -> Self::Losses;

    /// Losses in words.
    fn words(losses: &Self::Losses) -> String;

    /// The same losses by name.
    fn by_name(losses: &Self::Losses) -> BTreeMap<String, f64>;

    /// Weights and optimiser.
    fn state(&self) -> Result<[Vec<u8>; 2]>;
}

/// Goes on until the last step or until the job is cancelled.
pub(super) fn train<T: Training, P: Serialize, I: Serialize>(
    training: &mut T,
    steps: usize,
    folder: &TrainingFolder,
    kept: &mut Kept<P, I, T::Losses>,
    context: &Context,
) -> Result<()> {
    let mut clock = Instant::now();
    while kept.step < steps {
        match training.step(kept.step) {
            Ok(losses) => {
                kept.recent.push(losses);
                kept.step += 1;
            }
            // The network is as it was before the step, which is made again when the training goes on.
            Err(JobError::Stopped(_)) => {}
            Err(error) => return Err(error),
        }
        if !kept.recent.is_empty() && (kept.step.is_multiple_of(RECORD_EVERY) || kept.step == steps) {
            let losses = T::mean(&std::mem::take(&mut kept.recent));
            kept.history.push(Record { step: kept.step, losses });
            context.event(&Event::Progress {
                done: kept.step as u64,
                total: steps as u64,
                text: T::words(&losses),
                figures: T::by_name(&losses),
            });
        }
        let is_cancelled = context.is_cancelled();
        let is_due = kept.step.is_multiple_of(KEEP_EVERY) || clock.elapsed() >= KEEP_WITHIN;
        if is_due || kept.step == steps || is_cancelled {
            kept.seconds += clock.elapsed().as_secs_f64();
            clock = Instant::now();
            folder.keep(kept, kept.step, &training.state()?)?;
            context.wrote(folder.training(), "state");
        }
        if is_cancelled {
            break;
        }
    }
    Ok(())
}

/// The folder of a training, locked while it is open.
pub(super) struct TrainingFolder {
    root: PathBuf,
    _lock: WorkLock,
}

impl TrainingFolder {
    /// Makes the folder; refuses one that already holds a training, or in which another process trains.
    pub fn create(root: &Path) -> Result<Self> {
        let lock = make_new_folder(root, &root.join(STATE), "training")?;
        Ok(Self { root: root.to_owned(), _lock: lock })
    }

    /// Whether a folder holds a training.
    pub fn is_in(root: &Path) -> bool {
        root.join(STATE).is_file()
    }

    /// Reads the training in a folder.
    pub fn open<K: DeserializeOwned>(root: &Path) -> Result<(Self, K)> {
        let hint = "--resume takes the --out folder of an earlier training of the same kind";
        let (kept, lock) = read_state(root, &root.join(STATE), "training", hint)?;
        Ok((Self { root: root.to_owned(), _lock: lock }, kept))
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Description of the finished network.
    pub fn description(&self) -> PathBuf {
        self.root.join("proxy.toml")
    }

    /// Page of its pictures.
    pub fn page(&self) -> PathBuf {
        self.root.join("proxy.html")
    }

    fn training(&self) -> PathBuf {
        self.root.join(STATE)
    }

    /// Files of weights and optimiser after a step.
    fn parts(&self, step: usize) -> [PathBuf; 2] {
        ["weights", "optimizer"].map(|part| self.root.join(format!("{part}-{step:07}.bin")))
    }

    /// Weights and optimiser after a step.
    pub fn state(&self, step: usize) -> Result<[Vec<u8>; 2]> {
        let [weights, optimizer] = self.parts(step);
        let read = |path: PathBuf| petzval_base::read_whole(&path).map_err(DesignError::io(&path));
        Ok([read(weights)?, read(optimizer)?])
    }

    /// Keeps a state. The record comes last and names the files by its step, so that a folder always holds one whole state.
    fn keep(&self, kept: &impl Serialize, step: usize, state: &[Vec<u8>; 2]) -> Result<()> {
        for (path, bytes) in self.parts(step).iter().zip(state) {
            write_file(path, bytes)?;
        }
        write_file(&self.training(), with_digest(&json(kept)?))?;
        self.remove_states_but(step)
    }

    fn remove_states_but(&self, step: usize) -> Result<()> {
        let kept = self.parts(step);
        for entry in std::fs::read_dir(&self.root).map_err(DesignError::io(&self.root))? {
            let path = entry.map_err(DesignError::io(&self.root))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let is_state = ["weights-", "optimizer-"].iter().any(|start| name.starts_with(start));
            if is_state && name.ends_with(".bin") && !kept.contains(&path) {
                std::fs::remove_file(&path).map_err(DesignError::io(&path))?;
            }
        }
        Ok(())
    }

    /// Writes the finished network, in Burn's format and as safetensors, its page and other files by name; the description comes last.
    pub fn finish(
        &self,
        [weights, safetensors]: [&[u8]; 2],
        page: &str,
        others: &[(&str, &str)],
        description: &impl Serialize,
        context: &Context,
    ) -> Result<()> {
        let text = toml::to_string(description).map_err(|e| JobError::failed(e.to_string()))?;
        let others = others.iter().map(|(name, text)| (self.root.join(name), text.as_bytes()));
        let weights = [(self.root.join(WEIGHTS), weights), (self.root.join(SAFETENSORS), safetensors)];
        let first = weights.into_iter().chain([(self.page(), page.as_bytes())]);
        let last = (self.description(), text.as_bytes());
        for (path, bytes) in first.chain(others).chain([last]) {
            write_file(&path, bytes)?;
            context.wrote(&path, if path == self.page() { "page" } else { "network" });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::event::{Watcher, figures};

    /// A training whose loss is the number of the step.
    struct Counted;

    impl Training for Counted {
        type Losses = f64;

        fn step(&mut self, step: usize) -> Result<f64> {
            Ok(step as f64)
        }

        fn mean(losses: &[f64]) -> f64 {
            losses.iter().sum::<f64>() / losses.len() as f64
        }

        fn words(loss: &f64) -> String {
            format!("loss {loss:.1}")
        }

        fn by_name(loss: &f64) -> BTreeMap<String, f64> {
            figures([("loss", *loss)])
        }

        fn state(&self) -> Result<[Vec<u8>; 2]> {
            Ok([Vec::new(), Vec::new()])
        }
    }

    /// Keeps progress.
    #[derive(Default)]
    struct Progress(Mutex<Vec<Event>>);

    impl Watcher for Progress {
        fn event(&self, event: &Event) {
            if matches!(event, Event::Progress { .. }) {
                self.0.lock().unwrap().push(event.clone());
            }
        }
    }

    #[test]
    fn progress_has_the_losses_as_numbers() {
        let root = tempfile::tempdir().unwrap();
        let watcher = Arc::new(Progress::default());
        let context = Context::new(crate::built_in_assets(), watcher.clone());
        let folder = TrainingFolder::create(&root.path().join("training")).unwrap();
        let mut kept = Kept::new((), ());
        train(&mut Counted, RECORD_EVERY + 1, &folder, &mut kept, &context).unwrap();
        let progress = |done: usize, text: &str, loss: f64| Event::Progress {
            done: done as u64,
            total: RECORD_EVERY as u64 + 1,
            text: text.to_owned(),
            figures: figures([("loss", loss)]),
        };
        let said = [progress(RECORD_EVERY, "loss 24.5", 24.5), progress(RECORD_EVERY + 1, "loss 50.0", 50.0)];
        assert_eq!(*watcher.0.lock().unwrap(), said);
    }
}
