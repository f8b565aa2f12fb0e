//! A network that imitates the hardware ISP while its parameters move: trained on the camera's own raw frames, about the parameters as they
//! stand, so that it needs to be right only there.

use std::sync::Arc;

use burn::prelude::*;
use petzval_camera::isp::Isp;
use petzval_learn::score::Score;
use serde::{Deserialize, Serialize};

use super::{Batch, BlockState, part};
use crate::camera::ChipValues;
use crate::camera::isp_proxy::{Frame, Judge, ProxyTrainer, ProxyTraining, take};
use crate::error::{DesignError, Result};

const WEIGHTS: &str = "imitation-weights.bin";
const OPTIMIZER: &str = "imitation-optimizer.bin";
const STATE: &str = "imitation.json";

/// Size of the network: that of `petzval train isp-proxy`.
const BASE_CHANNELS: usize = 16;
const LEVELS: usize = 3;

/// Steps of the ISP between two comparisons with the ISP itself.
const JUDGED_EVERY: usize = 25;

/// Batches of windows on which it is compared.
const JUDGED_BATCHES: u64 = 4;

/// The numbers of the windows that it is trained on lie from here on, and of those that it is judged on from the second: beyond those of all
/// steps of blocks.
const FIRST_WINDOW: u64 = 1 << 40;
const FIRST_JUDGED: u64 = 1 << 41;

/// What is imitated, and how the network is kept near it.
#[derive(Clone)]
pub struct ImitationPlan {
    /// The ISP.
    pub isp: Arc<dyn Isp>,
    /// The values with which it develops truths.
    pub values: Vec<f64>,
    /// Scores of pictures whose gap between ISP and network is reported.
    pub scores: Arc<Vec<Box<dyn Score>>>,
    /// Where the network lives, with automatic differentiation.
    pub device: Device,
    /// Training steps of the network before each step of the ISP.
    pub per_step: usize,
    /// Steps of the ISP, from the first, in which the network is trained and the parameters rest.
    pub warm_up: usize,
    /// Training steps over which its learning rate falls; it learns on at the last rate. They depend on the experiment's budget alone, so that a
    /// variant is the same with others beside it, and after an extension.
    pub in_all: usize,
    /// Seed of its weights and of the parameters that it learns from.
    pub seed: u64,
}

/// The network at work. A copy shares the memory of its weights until one of the two learns.
#[derive(Clone)]
pub struct Imitation {
    plan: ImitationPlan,
    trainer: ProxyTrainer,
    age: Age,
}

/// How long it has learnt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Age {
    /// Steps of the ISP since it began.
    isp_steps: usize,
    /// Training steps.
    steps: usize,
}

/// What its training reports: errors of the last step, and now and then what the imitation costs.
pub type ImitationFigures = Vec<(String, f64)>;

impl Imitation {
    /// A network that has learnt nothing yet, for an ISP at `values`, whose parameters at the places `varied` move.
    pub fn new(plan: ImitationPlan, varied: &[usize], values: Vec<f64>) -> Result<Self> {
        let ImitationPlan { in_all: steps, seed, .. } = plan;
        let training = ProxyTraining { steps, seed, base_channels: BASE_CHANNELS, levels: LEVELS };
        let trainer = ProxyTrainer::new(plan.isp.as_ref(), varied.to_vec(), values, training, &plan.device)?;
        Ok(Self { plan, trainer, age: Age::default() })
    }

    /// Whether it is still too young to lead the ISP.
    pub fn is_warming_up(&self) -> bool {
        self.age.isp_steps <= self.plan.warm_up
    }

    /// The ISP at some values, in the form of the network.
    pub fn chip(&self, values: Tensor<1>) -> ChipValues {
        ChipValues::Imitated { values: Box::new(values), proxy: Box::new(self.trainer.proxy().clone()) }
    }

    /// Trains it before a step of the ISP, on fresh windows by the batch's camera, about the values as they stand. If that fails, or is cancelled,
    /// it may have learnt from some of the windows.
    pub fn train(&mut self, batch: &Batch, values: &[f64]) -> Result<ImitationFigures> {
        self.trainer.recentre(values);
        let mut figures = ImitationFigures::new();
        for _ in 0..self.plan.per_step {
            batch.cancel.check()?;
            let frames = self.frames(batch, FIRST_WINDOW + self.age.steps as u64)?;
            let losses = self.trainer.step(self.plan.isp.as_ref(), self.age.steps, &frames)?;
            figures = vec![("imitation_error".to_owned(), losses.picture)];
            self.age.steps += 1;
        }
        if self.age.isp_steps.is_multiple_of(JUDGED_EVERY) {
            let mut frames = Vec::new();
            for number in 0..JUDGED_BATCHES {
                batch.cancel.check()?;
                frames.extend(self.frames(batch, FIRST_JUDGED + number)?);
            }
            let (isp, scores, cancel) = (self.plan.isp.as_ref(), &self.plan.scores, &batch.cancel);
            let judge = Judge { isp, frames: &frames, scores, cancel };
            let gap = judge.gap(self.trainer.proxy(), values, &batch.camera.body().device)?;
            figures.push(("imitation_psnr_db".to_owned(), gap.psnr_at_centre_db));
            figures.push(("imitation_gradient_cosine".to_owned(), gap.gradient_cosine));
            // What a score of the network's pictures promises beyond that of the ISP's, or holds back.
            let gaps =
                gap.scores.iter().map(|s| (format!("imitation_gap_{}", s.score.name), s.isp - s.proxy));
            figures.extend(gaps);
        }
        self.age.isp_steps += 1;
        Ok(figures)
    }

    fn frames(&self, batch: &Batch, number: u64) -> Result<Vec<Frame>> {
        // Raw frames are wanted: the ISP itself makes the picture beside them in the least time.
        let camera = batch.camera.with_chip(ChipValues::Exact(self.plan.values.clone()));
        take(&camera, &(batch.further)(number)?, batch.noise.seed)
    }

    /// What it needs to go on with the same bits.
    pub fn save(&self) -> Result<BlockState> {
        let [weights, optimizer] = self.trainer.save()?;
        let age = DesignError::json("the imitation of the ISP", &self.age)?.into_bytes();
        let parts = [(WEIGHTS, weights), (OPTIMIZER, optimizer), (STATE, age)];
        Ok(parts.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect())
    }

    /// Takes over what [`Imitation::save`] returned.
    pub fn load(&mut self, state: &BlockState) -> Result<(), String> {
        let [weights, optimizer] = [part(state, WEIGHTS)?, part(state, OPTIMIZER)?].map(<[u8]>::to_vec);
        self.age = super::parsed(state, STATE)?;
        self.trainer.load([weights, optimizer]).map_err(|e| e.to_string())
    }

    /// Whether a state holds an imitation.
    pub fn is_in(state: &BlockState) -> bool {
        state.contains_key(STATE)
    }
}
