//! The hardware ISP as a block: the varied parameters as positions in their ranges. Adam moves them down the gradient of the floating-point
//! ISP, or of a network that imitates it; CMA-ES moves them on the ISP itself.

use std::collections::BTreeMap;

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_camera::isp::IspParameter;
use serde::{Deserialize, Serialize};

use super::generations::{FirstGeneration, Generations, PointScore};
use super::imitation::{Imitation, ImitationFigures, ImitationPlan};
use super::{Batch, Block, BlockState, Descent, as_json, backward, named, parsed, read_places};
use crate::camera::{ChipValues, to_host};
use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, StepMethod, StepRule};

const PLACES: &str = "places.json";
const PROGRESS: &str = "progress.json";
const OTHER_PARAMETERS: &str = "the ISP has other varied parameters; has the experiment been changed?";

/// The parameters of a hardware ISP on their way. Without any, it is a camera without such an ISP.
pub struct IspBlock {
    parameters: Vec<IspParameter>,
    /// The values of all parameters; those of the varied ones are at the start.
    values: Vec<f64>,
    varied: Vec<usize>,
    /// Places of the varied ones in their ranges, 0..1.
    places: Vec<f64>,
    progress: Progress,
    /// Whether the ISP has a form in floating point.
    is_smooth: bool,
    plan: Option<ImitationPlan>,
    /// The network that leads it, once a step by this method has been taken.
    imitation: Option<Imitation>,
}

/// How far a stage has come, beside the places.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Progress {
    #[serde(flatten)]
    way: Descent,
    /// The search of a stage without gradient, from its first step on.
    search: Generations,
}

/// First standard deviation of a search, as a share of a parameter's range.
const FIRST_DEVIATION: f64 = 0.1;

impl Progress {
    fn at(places: &[f64]) -> Self {
        Self { way: Descent::from(places), search: Generations::default() }
    }
}

impl IspBlock {
    /// An ISP at some values of all its parameters, those at the places `varied` of which may move.
    pub fn new(parameters: Vec<IspParameter>, values: Vec<f64>, varied: Vec<usize>) -> Self {
        let places: Vec<f64> = varied.iter().map(|i| parameters[*i].about.unit_of(values[*i])).collect();
        let progress = Progress::at(&places);
        let (plan, imitation) = (None, None);
        Self { parameters, values, varied, places, progress, is_smooth: true, plan, imitation }
    }

    /// The same block of an ISP without a form in floating point: only a network that imitates it has a gradient.
    pub fn without_gradient(self) -> Self {
        Self { is_smooth: false, ..self }
    }

    /// The same block, which trains a network to imitate its ISP as this plan says if a stage moves it by the method `proxy`.
    pub fn with_imitation(self, plan: ImitationPlan) -> Self {
        Self { plan: Some(plan), ..self }
    }

    /// The values of all parameters.
    pub fn values(&self) -> Vec<f64> {
        self.values_at(&self.places)
    }

    /// The values of all parameters where the varied ones lie at some places.
    fn values_at(&self, places: &[f64]) -> Vec<f64> {
        let mut values = self.values.clone();
        for (i, place) in self.varied.iter().zip(places) {
            values[*i] = self.parameters[*i].about.value_at(*place);
        }
        values
    }

    /// A generation of CMA-ES: at every point the ISP itself develops the same noisy frames. Returns the mean losses of the generation.
    fn evolve(&mut self, batch: &Batch, rule: StepRule) -> Result<BTreeMap<String, f64>> {
        let mut search = std::mem::take(&mut self.progress.search);
        let first =
            FirstGeneration { middle: &self.places, deviation: FIRST_DEVIATION, seed: batch.noise.seed };
        let stepped = search.step(first, |point| {
            batch.cancel.check()?;
            let camera = batch.camera.with_chip(ChipValues::Exact(self.values_at(point)));
            let frames = camera.take(batch.shots, &batch.noise)?;
            let losses = named(&batch.loss.loss(&camera, &frames, batch.shots)?);
            let value = losses["total"] + self.progress.way.proximal_term(point, rule);
            Ok(Some(PointScore { value, losses }))
        });
        // A generation that fails leaves the search where it was.
        self.progress.search = search;
        let (places, losses) = stepped?;
        self.places = places;
        Ok(losses)
    }

    /// The values of all parameters as a tensor.
    fn tensor(&self, device: &Device) -> Tensor<1> {
        let values: Vec<f32> = self.values().into_iter().map(|v| v as f32).collect();
        let count = values.len();
        Tensor::from_data(TensorData::new(values, [count]), device)
    }

    /// The ISP with its values held, on the tape; itself, without a gradient, if it has no form in floating point and nothing imitates it yet.
    pub fn held(&self, device: &Device) -> ChipValues {
        if self.is_smooth || self.ready_imitation().is_some() {
            self.on_tape(self.tensor(device))
        } else {
            ChipValues::Exact(self.values())
        }
    }

    /// Whether a network that imitates the ISP learns, and the parameters rest until it has learnt enough.
    pub fn is_warming_up(&self) -> bool {
        self.imitation.as_ref().is_some_and(Imitation::is_warming_up)
    }

    /// The network that imitates the ISP, once it has learnt enough.
    fn ready_imitation(&self) -> Option<&Imitation> {
        self.imitation.as_ref().filter(|imitation| !imitation.is_warming_up())
    }

    /// The ISP at values on the tape: the network that imitates it, once it has learnt enough, else the ISP in floating point.
    fn on_tape(&self, values: Tensor<1>) -> ChipValues {
        match self.ready_imitation() {
            Some(imitation) => imitation.chip(values),
            None => ChipValues::OnTape(Box::new(values)),
        }
    }

    /// Trains the imitation for a step by it. Returns its figures, and whether it may lead already.
    fn imitate(&mut self, batch: &Batch) -> Result<(ImitationFigures, bool)> {
        let values = self.values();
        let mut imitation = match self.imitation.take() {
            Some(imitation) => imitation,
            None => self.new_imitation()?,
        };
        let figures = imitation.train(batch, &values)?;
        let is_ready = !imitation.is_warming_up();
        self.imitation = Some(imitation);
        Ok((figures, is_ready))
    }

    /// The step by the rule's method. If it fails, the network that imitates the ISP may have learnt from it.
    fn step_by(&mut self, batch: &Batch, rule: StepRule) -> Result<BTreeMap<String, f64>> {
        let figures = match rule.method {
            StepMethod::Evolution => {
                self.imitation = None;
                return self.evolve(batch, rule);
            }
            StepMethod::Gradient | StepMethod::Levenberg | StepMethod::Random => {
                self.imitation = None;
                ImitationFigures::new()
            }
            StepMethod::Proxy => {
                let (figures, is_ready) = self.imitate(batch)?;
                if !is_ready {
                    return Ok(figures.into_iter().collect());
                }
                figures
            }
        };
        let (mut losses, gradient) = self.gradient(batch)?;
        losses.extend(figures);
        self.progress.way.step_within_ranges(&mut self.places, &gradient, rule);
        Ok(losses)
    }

    fn new_imitation(&self) -> Result<Imitation> {
        let plan = self.plan.clone().ok_or(DesignError::NoGradient("an ISP that nothing imitates"))?;
        Imitation::new(plan, &self.varied, self.values.clone())
    }

    /// The varied parameters: each with its value at the start, and now.
    pub fn changes(&self) -> Vec<(&IspParameter, f64, f64)> {
        let now = self.values();
        self.varied.iter().map(|i| (&self.parameters[*i], self.values[*i], now[*i])).collect()
    }

    /// The derivative of a varied parameter's value by its place.
    fn slope(&self, k: usize) -> f64 {
        const STEP: f64 = 1e-5;
        let (about, place) = (&self.parameters[self.varied[k]].about, self.places[k]);
        let (low, high) = ((place - STEP).max(0.0), (place + STEP).min(1.0));
        (about.value_at(high) - about.value_at(low)) / (high - low)
    }

    /// Losses at the present values, and the derivatives of the batch's loss by the places.
    pub fn gradient(&self, batch: &Batch) -> Result<(BTreeMap<String, f64>, Vec<f64>)> {
        batch.cancel.check()?;
        let values = self.tensor(&batch.camera.body().device).require_grad();
        let camera = batch.camera.with_chip(self.on_tape(values.clone()));
        let frames = camera.take(batch.shots, &batch.noise)?;
        let loss = batch.loss.loss(&camera, &frames, batch.shots)?;
        let losses = named(&loss);
        let gradients = backward(loss);
        let by =
            to_host(values.grad(&gradients).ok_or(DesignError::NoGradient("the parameters of the ISP"))?)?;
        let by_place = |(k, i): (usize, &usize)| f64::from(by[*i]) * self.slope(k);
        Ok((losses, self.varied.iter().enumerate().map(by_place).collect()))
    }
}

impl Block for IspBlock {
    fn name(&self) -> BlockName {
        BlockName::Isp
    }

    fn free_numbers(&self) -> usize {
        self.places.len()
    }

    fn begin_stage(&mut self, is_moving: bool) {
        self.progress = Progress::at(&self.places);
        if !is_moving {
            self.imitation = None;
        }
    }

    fn step(&mut self, batch: &Batch, rule: StepRule) -> Result<BTreeMap<String, f64>> {
        let before = self.imitation.clone();
        let stepped = self.step_by(batch, rule);
        // A step that fails has not taught the network either.
        if stepped.is_err() {
            self.imitation = before;
        }
        stepped
    }

    fn is_finite(&self) -> bool {
        self.places.iter().all(|p| p.is_finite())
    }

    fn save_numbers(&self) -> Result<BlockState> {
        let mut state = as_json(PLACES, "the parameters of the ISP", &self.places)?;
        // A later stage goes on with what the network has learnt.
        if let Some(imitation) = &self.imitation {
            state.extend(imitation.save()?);
        }
        Ok(state)
    }

    fn load_numbers(&mut self, state: &BlockState) -> Result<(), String> {
        let places = read_places(state, PLACES, self.places.len(), OTHER_PARAMETERS)?;
        self.imitation = if Imitation::is_in(state) {
            let mut imitation = self.new_imitation().map_err(|e| e.to_string())?;
            imitation.load(state)?;
            Some(imitation)
        } else {
            None
        };
        self.places = places;
        Ok(())
    }

    fn save_progress(&self) -> Result<BlockState> {
        as_json(PROGRESS, "the moments of the ISP", &self.progress)
    }

    fn load_progress(&mut self, state: &BlockState) -> Result<(), String> {
        let progress: Progress = parsed(state, PROGRESS)?;
        if !(progress.way.fits(self.places.len()) && progress.search.fits(self.places.len())) {
            return Err(format!("{PROGRESS}: {OTHER_PARAMETERS}"));
        }
        self.progress = progress;
        Ok(())
    }
}
