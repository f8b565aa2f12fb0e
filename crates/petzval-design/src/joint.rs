//! The gradient that the whole project is about: from the task's loss to the free coordinates of the lens.

use std::collections::BTreeMap;

use petzval_camera::sensor::Noise;
use petzval_learn::task::{Task, TaskLoss};

use crate::error::DesignError;
use crate::light_path::{LightPath, PsfLeaves, Shot};
use crate::scoring::to_host;
use crate::setup::Setup;

/// A loss at a point of the lens's design space.
#[derive(Clone, Debug)]
pub struct JointGradient {
    /// Losses by name; `total` is the task's, `penalty_mm2` the unweighted penalty of the requirements.
    pub losses: BTreeMap<String, f64>,
    /// Derivatives of the task's loss plus the weighted penalty by the free coordinates.
    pub by_x: Vec<f64>,
}

/// Loss and gradient of the lens at `x`, with the network held.
///
/// Light goes from the lens through PSFs, rendering, sensor, development and network to the loss; the gradient
/// comes back on the tape as far as the PSFs, and from there by the adjoint of ray tracing.
pub fn joint_gradient(
    setup: &Setup,
    path: &LightPath,
    task: &dyn Task,
    x: &[f64],
    shots: &[Shot],
    noise: &Noise,
) -> Result<JointGradient, DesignError> {
    let lens = setup.space.lens_at(x)?;
    let traced = setup.moving_plan.trace(&lens)?;
    let leaves = PsfLeaves::new(&traced.bank, &setup.device, true);
    let developed = path.take(&leaves, shots, noise)?;
    let truth = path.truth(shots, &setup.device)?;
    let loss = task.held_loss(developed, truth)?;
    let mut losses = named(&loss);

    // The tape ends at the PSFs; ray tracing takes over.
    let gradients = loss.total.backward();
    let missing = || DesignError::Device("the PSFs have no gradient".to_owned());
    let by_values = to_host(leaves.values.grad(&gradients).ok_or_else(missing)?)?;
    let by_illumination = to_host(leaves.illumination.grad(&gradients).ok_or_else(missing)?)?;
    let mut gradient = setup.moving_plan.gradient(&traced, &by_values, &by_illumination);

    let (penalty_mm2, by_penalty) = setup.requirements.penalty(&lens)?;
    gradient += &by_penalty.scaled(setup.experiment.constraints.weight);
    losses.insert("penalty_mm2".to_owned(), penalty_mm2);
    Ok(JointGradient { losses, by_x: setup.space.pull_back(x, &lens, &gradient) })
}

/// The parts of a loss by name.
pub(crate) fn named(loss: &TaskLoss) -> BTreeMap<String, f64> {
    loss.parts.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
}
