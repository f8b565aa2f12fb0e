//! A network of a user in training: it owns its weights, its optimiser and its random numbers.

use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

use petzval_learn::network::GuestNetwork;

use super::learner::{Learner, Sight, WEIGHTS};
use super::{Batch, BlockState, backward, named, part};
use crate::camera::Camera;
use crate::error::Result;
use crate::experiment::StepRule;

/// A network of a user in training. The part of its state that finished cameras keep is everything that it needs to go on.
pub(super) struct GuestInTraining(pub Arc<GuestNetwork>);

impl Learner for GuestInTraining {
    fn as_any(&self) -> &dyn Any {
        self
    }

    fn weights(&self) -> usize {
        1
    }

    fn check(&self) -> Result<()> {
        Ok(self.0.check()?)
    }

    /// Its optimiser is its own, and stages do not reset it.
    fn begin_stage(&mut self) {}

    fn attached(&self, camera: &Camera, _: Sight, is_held: bool) -> Camera {
        camera.with_network(self.0.attached(is_held, &camera.body().device))
    }

    /// The network sees the whole batch in one call, and takes up its gradients on the tape.
    fn step(&mut self, batch: &Batch, sight: Sight, rule: StepRule) -> Result<BTreeMap<String, f64>> {
        let camera = self.attached(batch.camera, sight, false);
        let frames = camera.take(batch.shots, &batch.noise)?;
        let loss = batch.loss.loss(&camera, &frames, batch.shots)?;
        let losses = named(&loss);
        if losses.values().all(|v| v.is_finite()) {
            backward(loss);
            self.0.check()?;
            self.0.step(rule.rate)?;
        }
        Ok(losses)
    }

    fn to_safetensors(&self) -> Result<Option<Vec<u8>>> {
        Ok(None)
    }

    fn save_numbers(&self) -> Result<BlockState> {
        Ok(BTreeMap::from([(WEIGHTS.to_owned(), self.0.save()?)]))
    }

    fn load_numbers(&mut self, state: &BlockState) -> Result<(), String> {
        self.0.load(part(state, WEIGHTS)?).map_err(|e| format!("{WEIGHTS}: {e}"))
    }

    fn save_progress(&self) -> Result<BlockState> {
        Ok(BlockState::new())
    }

    fn load_progress(&mut self, _: &BlockState) -> Result<(), String> {
        Ok(())
    }
}
