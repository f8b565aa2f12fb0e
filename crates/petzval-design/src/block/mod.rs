//! The blocks of a camera that a stage may move: each has free numbers, a step rule, a proximal term, and a state that a
//! checkpoint keeps.
//!
//! A block is held or it moves. While one moves, the others are held: the loss goes back on the tape to the moving block
//! alone, which takes one step down its gradient.

pub mod adam;
mod average;
mod blocks;
mod by_optics;
mod by_window;
mod exposure;
mod generations;
mod guest;
mod imitation;
mod isp;
mod learner;
mod lifted;
mod network;
mod optics;

use std::collections::BTreeMap;

use burn::tensor::Gradients;
use petzval_base::Cancel;
use petzval_camera::sensor::Noise;
use petzval_learn::loss::NamedLoss;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::block::adam::Adam;
use crate::camera::{Camera, Shot};
use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, StepRule};
use crate::objective::Objective;

pub use blocks::Blocks;
pub use by_window::losses_of;
pub use exposure::ExposureBlock;
pub use imitation::ImitationPlan;
pub use isp::IspBlock;
pub use learner::Sight;
pub use lifted::{Lift, Lifted, free_slopes};
pub use network::{CameraNetwork, NetworkBlock};
pub use optics::{OpticsBlock, loss_by_numbers};

/// What a checkpoint keeps of a block: bytes by the name of their part.
pub type BlockState = BTreeMap<String, Vec<u8>>;

/// Training windows by number.
pub type Further<'a> = dyn Fn(u64) -> Result<Vec<Shot>> + 'a;

/// The windows of a batch as a lens like that of its camera sees them, whose image is so many times as large.
pub type Magnified<'a> = dyn Fn(f64) -> Result<Vec<Shot>> + 'a;

/// What a step of a block is taken on.
pub struct Batch<'a> {
    /// The camera with every block held.
    pub camera: &'a Camera,
    /// What it takes.
    pub shots: &'a [Shot],
    /// How noise is drawn.
    pub noise: Noise,
    /// The loss of the frames.
    pub loss: &'a dyn Objective,
    /// Further training windows by number, for what a block learns besides.
    pub further: &'a Further<'a>,
    /// The same windows magnified, if the lens may change how large it images them.
    pub magnified: Option<&'a Magnified<'a>>,
    /// Whether all windows are taken together, also where the CPU would take them one by one.
    pub is_whole: bool,
    /// Gives the step up between its windows; a block is then as it was before the step.
    pub cancel: Cancel,
}

impl<'a> Batch<'a> {
    /// A batch without further windows, behind a lens that keeps its magnification; nothing cancels its step.
    pub fn new(camera: &'a Camera, shots: &'a [Shot], noise: Noise, loss: &'a dyn Objective) -> Self {
        let (magnified, is_whole, cancel) = (None, false, Cancel::default());
        Self { camera, shots, noise, loss, further: &|_| Ok(Vec::new()), magnified, is_whole, cancel }
    }

    /// The number of the batch, which no other has: that of its first frame.
    fn number(&self) -> u64 {
        self.shots.first().map_or(0, |shot| shot.frame)
    }
}

/// A part of the camera that a stage may move.
pub trait Block {
    /// Its name.
    fn name(&self) -> BlockName;

    /// Number of free numbers.
    fn free_numbers(&self) -> usize;

    /// Starts a stage, in which the block moves or is held: forgets the moments of earlier gradients, and takes the present numbers
    /// as centre of the proximal term.
    fn begin_stage(&mut self, is_moving: bool);

    /// Takes one step down the gradient of the batch's loss. Returns the losses before the step, by name. A step that the batch's flag cancels
    /// fails, and a checkpoint of the block is then one of the state before the step.
    fn step(&mut self, batch: &Batch, rule: StepRule) -> Result<BTreeMap<String, f64>>;

    /// By how much each free number lowered the batch's loss in the last step, to first order: `-dL/dx dx`. Empty for blocks that do not keep it.
    fn lowered(&self) -> &[f64] {
        &[]
    }

    /// Whether the free numbers are finite, as far as the losses of a step do not show it.
    fn is_finite(&self) -> bool {
        true
    }

    /// The free numbers alone: what a finished camera keeps.
    fn save_numbers(&self) -> Result<BlockState>;

    /// Takes over what [`Block::save_numbers`] returned. The error names the part that is missing or does not fit, and the reason.
    fn load_numbers(&mut self, state: &BlockState) -> Result<(), String>;

    /// Beside the free numbers, what [`Block::load_progress`] needs to go on within a stage with the same bits: moments of earlier
    /// gradients, and the centre of the proximal term.
    fn save_progress(&self) -> Result<BlockState>;

    /// Takes over what [`Block::save_progress`] returned. The error names the part that is missing or does not fit, and the reason.
    fn load_progress(&mut self, state: &BlockState) -> Result<(), String>;
}

/// Optimiser state of a block: Adam moments and the proximal centre.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Descent {
    /// Moments of the gradient.
    adam: Adam,
    /// The numbers at the start of the stage: the centre of the proximal term.
    anchor: Vec<f64>,
}

impl Descent {
    fn from(numbers: &[f64]) -> Self {
        Self { adam: Adam::default(), anchor: numbers.to_vec() }
    }

    /// A step of Adam and of the proximal term. A gradient that is not finite must not reach the moments: it makes the first number so instead.
    fn step(&mut self, numbers: &mut [f64], gradient: &[f64], rule: StepRule) {
        if !gradient.iter().all(|g| g.is_finite()) {
            numbers[0] = f64::NAN;
            return;
        }
        self.adam.step(numbers, gradient, rule.rate);
        self.pull_to_anchor(numbers, rule);
    }

    /// The same for places in ranges, 0..1, which it does not leave.
    fn step_within_ranges(&mut self, places: &mut [f64], gradient: &[f64], rule: StepRule) {
        self.step(places, gradient, rule);
        places.iter_mut().for_each(|place| *place = place.clamp(0.0, 1.0));
    }

    /// The proximal map.
    fn pull_to_anchor(&self, numbers: &mut [f64], rule: StepRule) {
        let strength = rule.rate * rule.proximal;
        if strength > 0.0 {
            let pairs = numbers.iter_mut().zip(&self.anchor);
            pairs.for_each(|(x, anchor)| *x = (*x + strength * anchor) / (1.0 + strength));
        }
    }

    /// The proximal term of numbers.
    fn proximal_term(&self, numbers: &[f64], rule: StepRule) -> f64 {
        let away: f64 = numbers.iter().zip(&self.anchor).map(|(x, anchor)| (x - anchor).powi(2)).sum();
        0.5 * rule.proximal * away
    }

    /// Whether it is that of so many numbers.
    fn fits(&self, numbers: usize) -> bool {
        self.anchor.len() == numbers && self.adam.fits(numbers)
    }
}

/// The parts of a loss by name.
fn named(loss: &NamedLoss) -> BTreeMap<String, f64> {
    loss.parts.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
}

/// A state of one part, as JSON; `what` names it if it cannot be written.
fn as_json(name: &str, what: &'static str, value: &impl Serialize) -> Result<BlockState> {
    Ok(BTreeMap::from([(name.to_owned(), DesignError::json(what, value)?.into_bytes())]))
}

/// The places of `count` settings that a state holds; `others` says of which they are if their number is another.
fn read_places(state: &BlockState, name: &str, count: usize, others: &str) -> Result<Vec<f64>, String> {
    let places: Vec<f64> = parsed(state, name)?;
    if places.len() != count {
        return Err(format!("{name}: {others}"));
    }
    if !places.iter().all(|place| place.is_finite()) {
        return Err(format!("{name}: not finite everywhere"));
    }
    Ok(places)
}

/// A part of a state.
fn part<'a>(state: &'a BlockState, name: &str) -> Result<&'a [u8], String> {
    state.get(name).map(Vec::as_slice).ok_or_else(|| format!("`{name}` is missing"))
}

/// A part of a state that is JSON.
fn parsed<T: DeserializeOwned>(state: &BlockState, name: &str) -> Result<T, String> {
    serde_json::from_slice(part(state, name)?).map_err(|e| format!("{name}: {e}"))
}

/// The gradients of a loss.
fn backward(loss: NamedLoss) -> Gradients {
    loss.total.backward()
}

#[cfg(test)]
mod by_window_tests;
