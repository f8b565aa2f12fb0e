//! A network learns the PSFs of lenses that are traced for it.

use burn::optim::{AdamConfig, GradientsParams};
use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_learn::network::{OpticsProxyConfig, PredictedPsfs};
use petzval_learn::optimizer::Optimizer;
use petzval_learn::weight_file::Weights;
use petzval_optics::lens::Lens;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::proxy::{ProxyDomain, ProxyOptics, Scale};
use crate::error::{DesignError, Result};
use crate::experiment::cosine_rate;
use crate::lens::psf_plan::BankWithTape;
use crate::lens::sampler::LensSampler;

/// Learning rate at the start, and its share at the end.
const LEARNING_RATE: f64 = 2e-3;
const FINAL_LEARNING_RATE: f64 = 0.02;

petzval_base::parameters! {
    /// How a network is trained.
    pub struct OpticsTraining {
        /// Steps in all.
        steps: usize = 4000, "", 1..10_000_000, Linear, "2000 take about a quarter of an hour on two cores";
        /// Lenses of a step, each at a field of its own.
        batch: usize = 8, "", 1..1024, Linear, "8 is usual";
        /// Width of the two hidden layers.
        hidden: usize = 128, "", 1..1024, Log, "the paper has 128";
        /// Channels of the decoder.
        channels: usize = 64, "", 1..256, Log, "the paper has 64";
    }
    also {
        /// Seed of weights and lenses.
        seed: u64 = 1;
    }
}

/// Losses before a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OpticsLosses {
    /// Sum of absolute differences of the PSFs, each of unit sum: 0 to 2.
    pub psf: f64,
    /// The same of their differences between neighbouring cells, along rows and columns.
    pub slope: f64,
    /// Mean absolute difference of the relative illumination.
    pub illumination: f64,
}

/// A network in training.
pub struct ProxyOpticsTrainer {
    sampler: LensSampler,
    training: OpticsTraining,
    proxy: ProxyOptics,
    optimizer: Optimizer,
    device: Device,
}

impl ProxyOpticsTrainer {
    /// An untrained network for the lenses of a sampler. `device` has automatic differentiation.
    pub fn new(
        sampler: LensSampler,
        domain: ProxyDomain,
        training: OpticsTraining,
        device: &Device,
    ) -> Result<Self> {
        let scale = Scale::of(&sampler.inputs(domain.corner_mm));
        let space = sampler.start().space.space().clone();
        let OpticsTraining { seed, hidden, channels, .. } = training;
        let config = OpticsProxyConfig { hidden, channels, ..OpticsProxyConfig::default() };
        let proxy = ProxyOptics::new(space, domain, scale, config, seed, device)?;
        let optimizer = Optimizer::new(&proxy.network, AdamConfig::new().init());
        Ok(Self { sampler, training, proxy, optimizer, device: device.clone() })
    }

    /// The network as it stands.
    pub fn proxy(&self) -> &ProxyOptics {
        &self.proxy
    }

    /// One step of Adam on lenses that are drawn and traced for it.
    pub fn step(&mut self, step: usize) -> Result<OpticsLosses> {
        let batch = self.training.batch;
        let numbers = (step * batch) as u64..((step + 1) * batch) as u64;
        let drawn: Vec<(Lens, BankWithTape)> =
            numbers.into_par_iter().map(|n| self.sampler.lens_and_field(n)).collect::<Result<_, _>>()?;
        let fields: Vec<(&Lens, f64)> =
            drawn.iter().map(|(lens, traced)| (lens, traced.bank.field_radius_mm[0])).collect();
        let PredictedPsfs { values, illumination } = self.proxy.network.forward(self.proxy.inputs(&fields));
        let gather = |part: fn(&BankWithTape) -> &Vec<f32>| -> Vec<f32> {
            drawn.iter().flat_map(|(_, traced)| part(traced).iter().copied()).collect()
        };
        let exact = TensorData::new(gather(|t| &t.bank.values), values.dims());
        let exact_light = TensorData::new(gather(|t| &t.bank.illumination), illumination.dims());

        let colours = illumination.dims().iter().product::<usize>() as f32;
        let errors = values - Tensor::from_data(exact, &self.device);
        let psf = errors.clone().abs().sum() / colours;
        let slope = (neighbours(errors.clone(), 2) + neighbours(errors, 3)) / colours;
        let light = (illumination - Tensor::from_data(exact_light, &self.device)).abs().mean();
        let number = |loss: &Tensor<1>| f64::from(loss.clone().into_scalar::<f32>());
        let losses = OpticsLosses { psf: number(&psf), slope: number(&slope), illumination: number(&light) };
        let value = losses.psf + losses.slope + losses.illumination;
        if !value.is_finite() {
            let (camera, step) = ("the network of the optics".to_owned(), step as u64);
            return Err(DesignError::Diverged {
                camera,
                block: "proxy",
                step,
                value,
                first: None,
                hint: "; hint: lower the learning rate",
            });
        }
        let gradients = GradientsParams::from_grads((psf + slope + light).backward(), &self.proxy.network);
        let rate = cosine_rate(LEARNING_RATE, FINAL_LEARNING_RATE, step, self.training.steps);
        self.proxy.network = self.optimizer.step(rate, self.proxy.network.clone(), gradients);
        Ok(losses)
    }

    /// Weights and the state of the optimiser, as bytes.
    pub fn save(&self) -> Result<[Vec<u8>; 2]> {
        let optimizer = self.optimizer.to_bytes().map_err(|e| unusable(&e))?;
        Ok([self.proxy.network.to_bytes()?, optimizer])
    }

    /// The weights as a safetensors file.
    pub fn safetensors(&self) -> Result<Vec<u8>> {
        Ok(self.proxy.network.to_safetensors()?)
    }

    /// Takes over what [`ProxyOpticsTrainer::save`] returned.
    pub fn load(&mut self, [weights, optimizer]: [Vec<u8>; 2]) -> Result<()> {
        self.proxy.network = self.proxy.network.clone().load_bytes(weights)?;
        let fresh = Optimizer::new(&self.proxy.network, AdamConfig::new().init());
        self.optimizer = fresh.with_bytes(&optimizer).map_err(|e| unusable(&e))?;
        Ok(())
    }
}

fn unusable(error: &dyn std::fmt::Display) -> DesignError {
    DesignError::Unwritable { what: "the optimiser of the network", problem: error.to_string() }
}

/// Sum of the absolute differences between neighbours along a dimension.
fn neighbours(x: Tensor<4>, dimension: usize) -> Tensor<1> {
    let cells = x.dims()[dimension];
    let (first, second) = (x.clone().narrow(dimension, 0, cells - 1), x.narrow(dimension, 1, cells - 1));
    (second - first).abs().sum()
}
