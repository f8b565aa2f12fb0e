//! What every network in training can do.

use std::any::Any;
use std::collections::BTreeMap;

use super::{Batch, BlockState};
use crate::camera::Camera;
use crate::error::Result;
use crate::experiment::{DetectorInput, StepRule};

/// Name of the part of a state with the weights.
pub(super) const WEIGHTS: &str = "weights.bin";

/// What a network that looks at finished pictures gets to see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// The pictures, or the truth.
    pub sees: DetectorInput,
    /// By how much they are enlarged.
    pub zoom: f64,
}

impl Default for Sight {
    /// Finished pictures as they are.
    fn default() -> Self {
        Self { sees: DetectorInput::Picture, zoom: 1.0 }
    }
}

/// A network in training, whatever its type.
pub(super) trait Learner: Send {
    fn as_any(&self) -> &dyn Any;
    /// Number of its weights; 1 where only the network itself knows.
    fn weights(&self) -> usize;
    /// Fails if it could not do its work on the tape.
    fn check(&self) -> Result<()> {
        Ok(())
    }
    fn begin_stage(&mut self);
    fn attached(&self, camera: &Camera, sight: Sight, is_held: bool) -> Camera;
    /// Takes a step down the gradient of the batch's loss, and towards the weights at the start of the stage. Returns the losses before the
    /// step. Where one of them is no number, the weights stay.
    fn step(&mut self, batch: &Batch, sight: Sight, rule: StepRule) -> Result<BTreeMap<String, f64>>;
    fn to_safetensors(&self) -> Result<Option<Vec<u8>>>;
    fn save_numbers(&self) -> Result<BlockState>;
    fn load_numbers(&mut self, state: &BlockState) -> Result<(), String>;
    fn save_progress(&self) -> Result<BlockState>;
    fn load_progress(&mut self, state: &BlockState) -> Result<(), String>;
}
