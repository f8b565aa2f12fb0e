//! The network as a block: its weights, moved by Adam, or by the optimiser of detectors.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use burn::grad_clipping::GradientClippingConfig;
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};
use burn::prelude::*;
use burn::tensor::Bytes;
use petzval_learn::camera_network::CameraNetwork;
use petzval_learn::camera_network::Network;
use petzval_learn::camera_network::{Zoom, Zoomed};
use petzval_learn::optimizer::muon_and_adam;

use super::{Batch, Block, BlockState, backward, named, part};
use crate::camera::Camera;
use crate::error::DesignError;
use crate::experiment::{BlockName, DetectorInput, StepRule};

const WEIGHTS: &str = "weights.bin";
const OPTIMIZER: &str = "optimizer.bin";
const ANCHOR: &str = "anchor.bin";

/// A network of any kind with its optimiser.
pub struct NetworkBlock {
    network: Network,
    optimizer: ModuleOptimizer,
    /// The weights at the start of the stage: the centre of the proximal term.
    anchor: Network,
    /// By how much pictures are enlarged for its detector.
    zoom: Zoom,
    /// What its detector sees.
    sees: DetectorInput,
    /// How it learns, if it is not a detector.
    learning: Learning,
}

/// How the weights of a network for pictures follow their gradients, by Adam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learning {
    /// Decay of the mean of squared gradients.
    pub beta2: f32,
    /// Largest norm of the gradient of each weight tensor; none for no limit.
    pub largest_gradient: Option<f32>,
}

impl Default for Learning {
    /// Adam as it was published.
    fn default() -> Self {
        Self { beta2: 0.999, largest_gradient: None }
    }
}

impl NetworkBlock {
    /// A network at the start of its training.
    pub fn new(network: Network) -> Self {
        let learning = Learning::default();
        let (anchor, optimizer) = (network.clone(), optimizer(&network, learning));
        Self { anchor, optimizer, network, zoom: Zoom::Times(1.0), sees: DetectorInput::Picture, learning }
    }

    /// The same, which learns so if it is not a detector.
    pub fn with_learning(self, learning: Learning) -> Self {
        Self { optimizer: optimizer(&self.network, learning), learning, ..self }
    }

    /// Puts a digital zoom in front of its detector.
    pub fn set_zoom(&mut self, zoom: Zoom) {
        self.zoom = zoom;
    }

    /// Sets what its detector sees.
    pub fn set_sees(&mut self, sees: DetectorInput) {
        self.sees = sees;
    }

    /// The same with the weights of the file `path`, `bytes`, which a network of the same kind wrote.
    pub fn with_weights(mut self, path: &Path, bytes: &[u8]) -> Result<Self, DesignError> {
        self.load_numbers(&BTreeMap::from([(WEIGHTS.to_owned(), bytes.to_vec())])).map_err(|problem| {
            let hint = "weights of the same kind of network, backbone and number of classes are needed";
            DesignError::misfit(path, &problem, hint)
        })?;
        Ok(Self::new(self.network))
    }

    /// The network.
    pub fn network(&self) -> Network {
        self.network.clone()
    }

    /// The network with its weights held: no gradient goes to them.
    pub fn held(&self) -> Rc<dyn CameraNetwork> {
        self.behind_zoom(self.network.clone().no_grad())
    }

    /// A camera with this network, its weights held, which shows it what it sees.
    pub fn attached_to(&self, camera: &Camera) -> Camera {
        self.attached(self.network.clone().no_grad(), camera)
    }

    fn attached(&self, network: Network, camera: &Camera) -> Camera {
        camera.with_network(self.behind_zoom(network)).seeing(self.sees)
    }

    fn behind_zoom(&self, network: Network) -> Rc<dyn CameraNetwork> {
        match self.zoom {
            Zoom::Times(1.0) => Rc::new(network),
            zoom => Rc::new(Zoomed::new(network, zoom)),
        }
    }
}

impl Block for NetworkBlock {
    fn name(&self) -> BlockName {
        BlockName::Network
    }

    fn free_numbers(&self) -> usize {
        self.network.num_params()
    }

    fn begin_stage(&mut self, _is_moving: bool) {
        self.optimizer = optimizer(&self.network, self.learning);
        self.anchor = self.network.clone();
    }

    fn step(&mut self, batch: &Batch, rule: StepRule) -> Result<BTreeMap<String, f64>, DesignError> {
        let camera = self.attached(self.network.clone(), batch.camera);
        let frames = camera.take(batch.shots, &batch.noise)?;
        let loss = (batch.loss)(&camera, &frames, batch.shots)?;
        let losses = named(&loss);
        // A loss that is no number must not reach the weights; the caller ends the run.
        if losses.values().all(|v| v.is_finite()) {
            let gradients = GradientsParams::from_grads(backward(loss), &self.network);
            self.network = self.optimizer.step(rule.rate, self.network.clone(), gradients);
            if rule.proximal > 0.0 {
                self.network = pulled_towards(self.network.clone(), &self.anchor, rule.rate * rule.proximal);
            }
        }
        Ok(losses)
    }

    fn save_numbers(&self) -> Result<BlockState, DesignError> {
        Ok(BTreeMap::from([(WEIGHTS.to_owned(), bytes_of(&self.network)?)]))
    }

    fn load_numbers(&mut self, state: &BlockState) -> Result<(), String> {
        self.network = with_bytes(&self.network, state, WEIGHTS)?;
        Ok(())
    }

    fn save_progress(&self) -> Result<BlockState, DesignError> {
        let optimizer = self.optimizer.into_bytes().map_err(|e| unwritable(&e))?;
        let parts = [(OPTIMIZER, optimizer.to_vec()), (ANCHOR, bytes_of(&self.anchor)?)];
        Ok(parts.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect())
    }

    fn load_progress(&mut self, state: &BlockState) -> Result<(), String> {
        self.anchor = with_bytes(&self.anchor, state, ANCHOR)?;
        let optimizer = Bytes::from_bytes_vec(part(state, OPTIMIZER)?.to_vec());
        self.optimizer = self::optimizer(&self.network, self.learning)
            .from_bytes(optimizer)
            .map_err(|e| format!("{OPTIMIZER}: not the state of this optimiser: {e}"))?;
        Ok(())
    }
}

/// An optimiser that has not seen a gradient yet.
fn optimizer(network: &Network, learning: Learning) -> ModuleOptimizer {
    match network {
        Network::Detector(detector) => muon_and_adam(detector),
        _ => {
            let limit = learning.largest_gradient.map(GradientClippingConfig::Norm);
            AdamConfig::new().with_beta_2(learning.beta2).with_grad_clipping(limit).init()
        }
    }
}

fn unwritable(problem: &dyn std::fmt::Display) -> DesignError {
    DesignError::Unwritable { what: "the network", problem: problem.to_string() }
}

fn bytes_of(network: &Network) -> Result<Vec<u8>, DesignError> {
    network.to_bytes().map_err(|e| unwritable(&e))
}

/// A network with the weights of a part of a state.
fn with_bytes(network: &Network, state: &BlockState, name: &str) -> Result<Network, String> {
    let bytes = part(state, name)?.to_vec();
    network.clone().load_bytes(bytes).map_err(|e| format!("{name}: {e}"))
}

/// The proximal map of `strength / 2 |theta - anchor|^2`: `theta <- (theta + strength anchor) / (1 + strength)`.
fn pulled_towards(network: Network, anchor: &Network, strength: f64) -> Network {
    let mut centre = Weights(Vec::new());
    anchor.visit(&mut centre);
    network.map(&mut Pull { anchor: centre.0.into_iter(), strength })
}

/// Collects the weights of a network in the order of a visit.
struct Weights(Vec<TensorData>);

impl ModuleVisitor for Weights {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        self.0.push(param.val().detach().into_data());
    }
}

struct Pull {
    anchor: std::vec::IntoIter<TensorData>,
    strength: f64,
}

impl ModuleMapper for Pull {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let Some(anchor) = self.anchor.next() else { return param };
        param.map(|weights| {
            let is_tracked = weights.is_require_grad();
            let anchor = Tensor::<D>::from_data(anchor, &weights.device());
            // `detach` alone would leave the tensor tracked, and the result would be no leaf.
            let weights = weights.detach().set_require_grad(false);
            let pulled = (weights + anchor * self.strength) / (1.0 + self.strength);
            pulled.set_require_grad(is_tracked)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use petzval_learn::Device;
    use petzval_learn::camera_network::NetworkKind;

    fn weights(network: &Network) -> Vec<f32> {
        let mut all = Weights(Vec::new());
        network.visit(&mut all);
        all.0.into_iter().flat_map(|data| data.try_to_vec::<f32>().unwrap()).collect()
    }

    #[test]
    fn the_proximal_map_moves_weights_towards_the_anchor_by_its_share() {
        let device = Device::flex().autodiff();
        for kind in [NetworkKind::UNet, NetworkKind::Restoration, NetworkKind::RestorationNaf] {
            let [network, anchor] = [1, 2].map(|seed| kind.init(8, 1, seed, &device).unwrap());
            let pulled = weights(&pulled_towards(network.clone(), &anchor, 3.0));
            for ((w, a), p) in weights(&network).iter().zip(weights(&anchor)).zip(pulled) {
                assert!((p - (0.25 * w + 0.75 * a)).abs() < 1e-6, "{w} {a} {p}");
            }
        }
    }

    #[test]
    fn a_restored_block_has_the_weights_and_the_anchor_of_the_kept_one() {
        let device = Device::flex().autodiff();
        let network = |seed| NetworkKind::Restoration.init(8, 1, seed, &device).unwrap();
        // A block that has moved since its stage began.
        let mut kept = NetworkBlock::new(network(1));
        kept.network = network(2);
        let mut restored = NetworkBlock::new(network(3));
        restored.load_numbers(&kept.save_numbers().unwrap()).unwrap();
        restored.load_progress(&kept.save_progress().unwrap()).unwrap();
        assert_eq!(weights(&restored.network), weights(&kept.network));
        assert_eq!(weights(&restored.anchor), weights(&network(1)));
        assert!(restored.load_progress(&BlockState::new()).is_err());
    }
}
