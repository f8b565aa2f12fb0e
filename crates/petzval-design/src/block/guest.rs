//! A network of a user in training: it owns its weights, its optimiser and its random numbers.

use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

use burn::tensor::Gradients;
use petzval_learn::network::GuestNetwork;

use super::learner::{Learner, Sight, WEIGHTS};
use super::{BlockState, part};
use crate::camera::Camera;
use crate::error::DesignError;
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

    fn check(&self) -> Result<(), DesignError> {
        Ok(self.0.check()?)
    }

    /// Its optimiser is its own, and stages do not reset it.
    fn begin_stage(&mut self) {}

    fn attached(&self, camera: &Camera, _: Sight, is_held: bool) -> Camera {
        camera.with_network(self.0.attached(is_held, &camera.body().device))
    }

    /// The network has taken up its gradients on the tape.
    fn descend(&mut self, _: Gradients, rule: StepRule) -> Result<(), DesignError> {
        self.0.check()?;
        Ok(self.0.step(rule.rate)?)
    }

    fn to_safetensors(&self) -> Result<Option<Vec<u8>>, DesignError> {
        Ok(None)
    }

    fn save_numbers(&self) -> Result<BlockState, DesignError> {
        Ok(BTreeMap::from([(WEIGHTS.to_owned(), self.0.save()?)]))
    }

    fn load_numbers(&mut self, state: &BlockState) -> Result<(), String> {
        self.0.load(part(state, WEIGHTS)?).map_err(|e| format!("{WEIGHTS}: {e}"))
    }

    fn save_progress(&self) -> Result<BlockState, DesignError> {
        Ok(BlockState::new())
    }

    fn load_progress(&mut self, _: &BlockState) -> Result<(), String> {
        Ok(())
    }
}
