//! A network learns what an ISP makes of raw frames, and how that changes with the parameters.

use burn::optim::GradientsParams;
use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_camera::isp::{Isp, RawInput, RgbPicture};
use petzval_learn::network::IspProxyConfig;
use petzval_learn::optimizer::{Optimizer, muon_and_adam};
use petzval_learn::proxy_isp::{FRAME_NUMBERS, ProxyIsp};
use petzval_learn::weight_file::Weights;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::Frame;
use super::sampling::pair;
use crate::error::{DesignError, Result};
use crate::experiment::cosine_rate;

/// Learning rate at the start, and its share at the end.
const LEARNING_RATE: f64 = 2e-3;
const FINAL_LEARNING_RATE: f64 = 0.02;

/// Weight of the error in the difference of two pictures of one frame with neighbouring parameters.
const DIFFERENCE_WEIGHT: f64 = 1.0;

/// Pairs of lists of parameters with which a frame is developed in a step: a near and a far one.
pub(crate) const PAIRS: usize = 2;

petzval_base::parameters! {
    /// How a proxy is trained.
    pub struct ProxyTraining {
        /// Steps in all.
        steps: usize = 4000, "", 1..1_000_000, Linear, "4000 take minutes on two cores";
        /// Channels of the network at its finest resolution, 1..=256.
        base_channels: usize = 16, "", 1..256, Log, "16 are usual";
        /// Number of times that the network halves the picture, 1..=6.
        levels: usize = 3, "", 1..6, Linear, "3 are usual";
    }
    also {
        /// Seed of weights and parameters.
        seed: u64 = 1;
    }
}

/// Losses before a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepLosses {
    /// Mean absolute difference between the pictures of proxy and ISP.
    pub picture: f64,
    /// Mean absolute difference between the changes of the pictures by a change of the parameters.
    pub difference: f64,
    /// Mean absolute change of the ISP's pictures, beside which the difference is to be seen.
    pub change: f64,
}

/// A proxy in training.
#[derive(Clone)]
pub struct ProxyTrainer {
    training: ProxyTraining,
    /// Where the parameters lie about which the proxy is wanted, in their ranges.
    centre: Vec<f64>,
    proxy: ProxyIsp,
    optimizer: Optimizer,
    device: Device,
}

impl ProxyTrainer {
    /// An untrained proxy of an ISP in its parameters at the places `varied`, about `values`, of which there is one for each parameter.
    /// `device` has automatic differentiation.
    pub fn new(
        isp: &dyn Isp,
        varied: Vec<usize>,
        values: Vec<f64>,
        training: ProxyTraining,
        device: &Device,
    ) -> Result<Self> {
        let ProxyTraining { seed, base_channels, levels, .. } = training;
        let parameters = varied.len() + FRAME_NUMBERS;
        let config = IspProxyConfig { parameters, base_channels, levels, ..IspProxyConfig::default() };
        let network = config.init(seed, device)?;
        let proxy = ProxyIsp::new(isp, varied, values.clone(), network);
        let (centre, optimizer) = (proxy.places(&values), fresh_optimizer(&proxy));
        Ok(Self { training, centre, proxy, optimizer, device: device.clone() })
    }

    /// The proxy as it stands.
    pub fn proxy(&self) -> &ProxyIsp {
        &self.proxy
    }

    /// Learns from now on about these values, of which there is one for each parameter.
    pub fn recentre(&mut self, values: &[f64]) {
        self.centre = self.proxy.places(values);
    }

    /// One step on raw frames of one size and what the ISP makes of them. Each is developed with two pairs of neighbouring lists of
    /// parameters, drawn for this step.
    pub fn step(&mut self, isp: &dyn Isp, step: usize, frames: &[Frame]) -> Result<StepLosses> {
        let pairs: Vec<[Vec<f64>; 2]> = (0..(PAIRS * frames.len()) as u64)
            .map(|item| pair(&self.centre, self.training.seed, step as u64, item))
            .collect();
        // All first points, then all second ones, so that the two halves of the batch are neighbours.
        let work: Vec<(&RawInput, &Vec<f64>)> = (0..2)
            .flat_map(|half| {
                pairs.iter().enumerate().map(move |(i, pair)| (&frames[i / PAIRS].raw, &pair[half]))
            })
            .collect();
        let box_pictures = self.box_pictures(isp, &work)?;
        let pictures = self.proxy_pictures(&work)?;

        let change = |pictures: Tensor<4>| {
            let [first, second] = pictures.chunk(2, 0).try_into().expect("two halves");
            (second - first).abs().mean()
        };
        let errors = pictures - box_pictures.clone();
        let (picture, difference) = (errors.clone().abs().mean(), change(errors));
        let number = |loss: &Tensor<1>| f64::from(loss.clone().into_scalar::<f32>());
        let losses = StepLosses {
            picture: number(&picture),
            difference: number(&difference),
            change: number(&change(box_pictures)),
        };
        let value = losses.picture + losses.difference;
        if !value.is_finite() {
            let (camera, step) = (isp.name().to_owned(), step as u64);
            return Err(DesignError::Diverged {
                camera,
                block: "proxy",
                step,
                value,
                first: None,
                hint: "; hint: lower the learning rate",
            });
        }
        let loss = picture + difference * DIFFERENCE_WEIGHT;
        let network = &self.proxy.network;
        let gradients = GradientsParams::from_grads(loss.backward(), network);
        let rate = cosine_rate(LEARNING_RATE, FINAL_LEARNING_RATE, step, self.training.steps);
        self.proxy.network = self.optimizer.step(rate, network.clone(), gradients);
        Ok(losses)
    }

    /// What the ISP makes of frames, `[batch, 3, height, width]`.
    fn box_pictures(&self, isp: &dyn Isp, work: &[(&RawInput, &Vec<f64>)]) -> Result<Tensor<4>> {
        let develop = |(raw, places): &(&RawInput, &Vec<f64>)| isp.develop(raw, &self.proxy.values(places));
        let pictures: Vec<RgbPicture> = work.par_iter().map(develop).collect::<Result<_, _>>()?;
        let [height, width] = pictures.first().map_or([0, 0], |p| [p.height, p.width]);
        let encoded: Vec<f32> = pictures.iter().flat_map(RgbPicture::encoded).collect();
        Ok(Tensor::from_data(TensorData::new(encoded, [work.len(), 3, height, width]), &self.device))
    }

    /// What the proxy makes of them.
    fn proxy_pictures(&self, work: &[(&RawInput, &Vec<f64>)]) -> Result<Tensor<4>> {
        let frames = work.iter().map(|(raw, _)| (dn_on(raw, &self.device), *raw)).collect();
        let places: Vec<f32> = work.iter().flat_map(|(_, places)| places.iter().map(|v| *v as f32)).collect();
        let places = TensorData::new(places, [work.len(), self.centre.len()]);
        Ok(self.proxy.develop_batch(frames, Tensor::from_data(places, &self.device))?)
    }

    /// Weights and the state of the optimiser, as bytes.
    pub fn save(&self) -> Result<[Vec<u8>; 2]> {
        let optimizer = self.optimizer.to_bytes().map_err(|e| DesignError::Unwritable {
            what: "the optimiser of the proxy",
            problem: e.to_string(),
        })?;
        Ok([self.proxy.network.to_bytes()?, optimizer])
    }

    /// The weights as a safetensors file.
    pub fn safetensors(&self) -> Result<Vec<u8>> {
        Ok(self.proxy.network.to_safetensors()?)
    }

    /// Takes over what [`ProxyTrainer::save`] returned.
    pub fn load(&mut self, [weights, optimizer]: [Vec<u8>; 2]) -> Result<()> {
        self.proxy.network = self.proxy.network.clone().load_bytes(weights)?;
        self.optimizer = fresh_optimizer(&self.proxy).with_bytes(&optimizer).map_err(|e| {
            DesignError::Unwritable { what: "the optimiser of the proxy", problem: e.to_string() }
        })?;
        Ok(())
    }
}

/// An optimiser that has not seen a gradient yet.
fn fresh_optimizer(proxy: &ProxyIsp) -> Optimizer {
    Optimizer::new(&proxy.network, muon_and_adam(&proxy.network))
}

/// The linear digital numbers of a frame as a tensor.
pub(super) fn dn_on(raw: &RawInput, device: &Device) -> Tensor<4> {
    Tensor::from_data(TensorData::new(raw.linear_dn(), [1, 1, raw.height, raw.width]), device)
}

#[cfg(test)]
mod tests {
    use petzval_base::Cancel;
    use petzval_camera::isp::{FrameData, HardwareIsp, IspSettings, NoiseProfile};
    use petzval_learn::dataset::dead_leaves;

    use super::super::Judge;
    use super::*;

    const SIDE: usize = 32;
    const STEPS: usize = 120;

    /// A frame of generated scenes without noise or blur.
    fn frame(number: u64) -> Frame {
        let scene = dead_leaves(SIDE, 5, number, 0);
        let cfa: petzval_camera::sensor::CfaPattern = "RGGB".parse().unwrap();
        let dn = |i: usize| {
            let plane = cfa.colour(i / SIDE, i % SIDE).plane().unwrap();
            (64.0 + 3000.0 * scene.get(plane, i / SIDE, i % SIDE)).round().max(64.0) as u32
        };
        let about = FrameData {
            black_dn: 64.0,
            white_dn: 3064.0,
            response: [1.0; 3],
            saturation: 1.3,
            noise: NoiseProfile { shot: 1e-4, read: 1e-6 },
            gain_ev: 0.0,
            colour_matrix: None,
            companding: None,
            shading: None,
            warp: None,
        };
        let dn = (0..SIDE * SIDE).map(dn).collect();
        let raw = RawInput { height: SIDE, width: SIDE, dn, bits: 12, cfa, about };
        // What is brighter than it should be has a slope by every parameter of the brightness.
        let ideal = RawInput { dn: raw.dn.iter().map(|dn| 64 + (dn - 64) / 2).collect(), ..raw.clone() };
        Frame { raw, ideal }
    }

    fn frames(step: usize) -> Vec<Frame> {
        (0..2).map(|item| frame(2 * step as u64 + item)).collect()
    }

    fn isp() -> HardwareIsp {
        HardwareIsp { settings: IspSettings { bits: 16, ..IspSettings::default() } }
    }

    fn trainer(isp: &HardwareIsp, seed: u64, device: &Device) -> ProxyTrainer {
        let place = |name: &str| isp.parameters().iter().position(|p| p.name == name).unwrap();
        let varied = vec![place("gain.stops"), place("gamma.exponent")];
        let training = ProxyTraining { steps: STEPS, seed, base_channels: 8, levels: 2 };
        ProxyTrainer::new(isp, varied, isp.defaults(), training, device).unwrap()
    }

    #[test]
    fn training_brings_pictures_and_slopes_of_the_proxy_to_those_of_the_isp() {
        let (isp, device) = (isp(), Device::flex().autodiff());
        let mut trainer = trainer(&isp, 1, &device);
        let unseen: Vec<Frame> = (1_000_000..1_000_004).map(frame).collect();
        let cancel = Cancel::default();
        let judge = Judge { isp: &isp, frames: &unseen, scores: &[], cancel: &cancel };
        let gap = |trainer: &ProxyTrainer| judge.gap(trainer.proxy(), &isp.defaults(), &device).unwrap();
        let before = gap(&trainer);
        for step in 0..STEPS {
            trainer.step(&isp, step, &frames(step)).unwrap();
        }
        let after = gap(&trainer);
        assert!(after.psnr_at_centre_db > before.psnr_at_centre_db + 1.5, "{before:?} {after:?}");
        assert!(after.psnr_far_db > before.psnr_far_db + 3.0, "{before:?} {after:?}");
        assert!(before.gradient_cosine == 0.0 && after.gradient_cosine > 0.97, "{after:?}");
        // Both slopes through the ISP are real ones.
        assert!(after.slopes.iter().all(|slope| slope.isp.abs() > 1e-4), "{after:?}");
        // So they are where the ISP has its best parameters, at which the error has no slope.
        let best: Vec<Frame> =
            unseen.iter().map(|frame| Frame { raw: frame.raw.clone(), ideal: frame.raw.clone() }).collect();
        let judge = Judge { isp: &isp, frames: &best, scores: &[], cancel: &cancel };
        let at_best = judge.gap(trainer.proxy(), &isp.defaults(), &device).unwrap();
        assert!(at_best.slopes.iter().all(|slope| slope.isp.abs() > 1e-4), "{at_best:?}");
        assert!(at_best.gradient_cosine > 0.9, "{at_best:?}");
        cancel.set();
        assert!(judge.gap(trainer.proxy(), &isp.defaults(), &device).unwrap_err().is_stopped());
    }

    #[test]
    fn a_restored_training_goes_on_with_the_same_bits() {
        let (isp, device) = (isp(), Device::flex().autodiff());
        let mut whole = trainer(&isp, 1, &device);
        for step in 0..2 {
            whole.step(&isp, step, &frames(step)).unwrap();
        }
        let mut restored = trainer(&isp, 7, &device);
        restored.training.seed = 1;
        restored.load(whole.save().unwrap()).unwrap();
        let losses = [&mut whole, &mut restored].map(|trainer| trainer.step(&isp, 2, &frames(2)).unwrap());
        assert_eq!(losses[0], losses[1]);
        assert_eq!(whole.save().unwrap()[0], restored.save().unwrap()[0]);
        assert!(restored.load([vec![1, 2, 3], Vec::new()]).is_err());
    }
}
