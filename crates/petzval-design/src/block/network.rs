//! The network as a block: its weights, moved by the optimiser of its kind.

use std::any::Any;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::{GradientsAccumulator, GradientsParams, ModuleOptimizer};
use burn::prelude::*;
use burn::tensor::Gradients;
use petzval_camera::sensor::Noise;
use petzval_camera::tape::Frames;
use petzval_learn::network::GuestNetwork;
use petzval_learn::optimizer::Optimizer;
use petzval_learn::weight_file::Weights;

use super::by_window::{By, derivatives};
use super::guest::GuestInTraining;
use super::learner::{Learner, Sight, WEIGHTS};
use super::{Batch, Block, BlockState, part};
use crate::camera::{Camera, Shot};
use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, StepRule};

const OPTIMIZER: &str = "optimizer.bin";
const ANCHOR: &str = "anchor.bin";

/// Weights of a network for each pixel of windows that are taken together, about: with more, what a layer does once for all of its pixels takes
/// as long as the pixels do. A ResNet-50 sees ten windows of 100 x 100 pixels at once, or one of 320 x 320; the networks of 16 channels see one.
const WEIGHTS_PER_PIXEL: usize = 400;

/// How networks of a type work and learn in a camera.
pub trait CameraNetwork: Send + Sync + 'static {
    /// The network.
    type Module: Module + Sync + 'static;

    /// The camera with a network: behind its development, or looking at its pictures.
    fn attached(&self, network: Self::Module, camera: &Camera, sight: Sight) -> Camera;

    /// An optimiser that has not seen a gradient yet.
    fn optimizer(&self, network: &Self::Module) -> ModuleOptimizer;
}

/// A network of any kind with its optimiser.
pub struct NetworkBlock {
    learner: Box<dyn Learner>,
    sight: Sight,
}

impl NetworkBlock {
    /// A network at the start of its training.
    pub fn new<C: CameraNetwork>(network: C::Module, how: C) -> Self {
        Self { learner: Box::new(InTraining::new(network, how)), sight: Sight::default() }
    }

    /// A network of a user, which learns by an optimiser of its own.
    pub fn of_guest(network: Arc<GuestNetwork>) -> Self {
        Self { learner: Box::new(GuestInTraining(network)), sight: Sight::default() }
    }

    /// Sets what the network sees, if it looks at finished pictures.
    pub fn set_sight(&mut self, sight: Sight) {
        self.sight = sight;
    }

    /// What the network sees, if it looks at finished pictures.
    pub fn sight(&self) -> Sight {
        self.sight
    }

    /// The same with the weights of the file `path`, `bytes`, which a network of the same kind wrote.
    pub fn with_weights(mut self, path: &Path, bytes: &[u8]) -> Result<Self> {
        self.load_numbers(&BTreeMap::from([(WEIGHTS.to_owned(), bytes.to_vec())])).map_err(|problem| {
            let hint = "weights of the same kind of network, backbone and number of classes are needed";
            DesignError::misfit(path, &problem, hint)
        })?;
        self.begin_stage(true);
        Ok(self)
    }

    /// Whether it is a network of a user, which may remember what it saw.
    pub fn is_of_guest(&self) -> bool {
        self.learner.as_any().is::<GuestInTraining>()
    }

    /// The network with its weights held, if it is of this type.
    pub fn network<C: CameraNetwork>(&self) -> Option<C::Module> {
        let in_training = self.learner.as_any().downcast_ref::<InTraining<C>>()?;
        Some(in_training.network.clone().no_grad())
    }

    /// All weights as a safetensors file, for other programs; none of a network of a user, whose weights only its class can read.
    pub fn to_safetensors(&self) -> Result<Option<Vec<u8>>> {
        self.learner.to_safetensors()
    }

    /// Fails if a network of a user could not do its work on the tape.
    pub fn check(&self) -> Result<()> {
        self.learner.check()
    }

    /// A camera with this network, its weights held: no gradient goes to them.
    pub fn attached_to(&self, camera: &Camera) -> Camera {
        self.learner.attached(camera, self.sight, true)
    }
}

impl Block for NetworkBlock {
    fn name(&self) -> BlockName {
        BlockName::Network
    }

    fn free_numbers(&self) -> usize {
        self.learner.weights()
    }

    fn begin_stage(&mut self, _is_moving: bool) {
        self.learner.begin_stage();
    }

    fn step(&mut self, batch: &Batch, rule: StepRule) -> Result<BTreeMap<String, f64>> {
        self.learner.step(batch, self.sight, rule)
    }

    fn save_numbers(&self) -> Result<BlockState> {
        self.learner.save_numbers()
    }

    fn load_numbers(&mut self, state: &BlockState) -> Result<(), String> {
        self.learner.load_numbers(state)
    }

    fn save_progress(&self) -> Result<BlockState> {
        self.learner.save_progress()
    }

    fn load_progress(&mut self, state: &BlockState) -> Result<(), String> {
        self.learner.load_progress(state)
    }
}

/// A network of one type in training.
struct InTraining<C: CameraNetwork> {
    network: C::Module,
    how: C,
    optimizer: Optimizer,
    /// The weights at the start of the stage: the centre of the proximal term.
    anchor: C::Module,
}

impl<C: CameraNetwork> InTraining<C> {
    fn new(network: C::Module, how: C) -> Self {
        Self { anchor: network.clone(), optimizer: fresh_optimizer(&network, &how), network, how }
    }
}

/// Makes every weight a leaf of its own, with the same values in the same memory. A fork of the module would lead through the tape of the weights.
struct NewLeaves;

impl ModuleMapper for NewLeaves {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        param.map(Tensor::detach)
    }
}

/// The weights of a network, which a camera has in front of or behind its pictures.
pub(super) struct ByWeights<'a, C: CameraNetwork> {
    pub network: &'a C::Module,
    pub how: &'a C,
    pub camera: &'a Camera,
    pub sight: Sight,
}

impl<C: CameraNetwork> By for ByWeights<'_, C> {
    type Leaves = C::Module;
    type Derivatives = GradientsParams;

    fn leaves(&self) -> C::Module {
        self.network.clone().map(&mut NewLeaves)
    }

    fn camera(&self, network: &C::Module) -> Camera {
        self.how.attached(network.clone(), self.camera, self.sight)
    }

    fn take(&self, camera: &Camera, _: &C::Module, shots: &[Shot], noise: &Noise) -> Result<Frames> {
        camera.take(shots, noise)
    }

    fn read(&self, network: &C::Module, gradients: Gradients) -> Result<GradientsParams> {
        Ok(GradientsParams::from_grads(gradients, network))
    }

    fn plus(&self, sum: GradientsParams, own: GradientsParams) -> GradientsParams {
        let mut accumulator = GradientsAccumulator::<C::Module>::new();
        for gradients in [sum, own] {
            accumulator.accumulate(self.network, gradients);
        }
        accumulator.grads()
    }

    /// Layers pack their weights and write a gradient once for all windows.
    fn windows_together(&self, pixels: usize) -> usize {
        self.network.num_params().div_ceil(WEIGHTS_PER_PIXEL * pixels)
    }
}

impl<C: CameraNetwork> InTraining<C> {
    fn descend(&mut self, gradients: GradientsParams, rule: StepRule) {
        self.network = self.optimizer.step(rule.rate, self.network.clone(), gradients);
        if rule.proximal > 0.0 {
            self.network = pulled_towards(self.network.clone(), &self.anchor, rule.rate * rule.proximal);
        }
    }
}

impl<C: CameraNetwork> Learner for InTraining<C> {
    fn as_any(&self) -> &dyn Any {
        self
    }

    fn weights(&self) -> usize {
        self.network.num_params()
    }

    fn begin_stage(&mut self) {
        self.optimizer = fresh_optimizer(&self.network, &self.how);
        self.anchor = self.network.clone();
    }

    fn attached(&self, camera: &Camera, sight: Sight, is_held: bool) -> Camera {
        let network = self.network.clone();
        self.how.attached(if is_held { network.no_grad() } else { network }, camera, sight)
    }

    fn step(&mut self, batch: &Batch, sight: Sight, rule: StepRule) -> Result<BTreeMap<String, f64>> {
        let Self { network, how, .. } = self;
        let by = ByWeights { network, how, camera: batch.camera, sight };
        let (losses, gradients) = derivatives(batch, &by)?;
        // A loss that is no number must not reach the weights; the caller ends the run.
        if let Some(gradients) = gradients {
            self.descend(gradients, rule);
        }
        Ok(losses)
    }

    fn to_safetensors(&self) -> Result<Option<Vec<u8>>> {
        Ok(Some(self.network.to_safetensors()?))
    }

    fn save_numbers(&self) -> Result<BlockState> {
        Ok(BTreeMap::from([(WEIGHTS.to_owned(), bytes_of(&self.network)?)]))
    }

    fn load_numbers(&mut self, state: &BlockState) -> Result<(), String> {
        self.network = with_bytes(&self.network, state, WEIGHTS)?;
        Ok(())
    }

    fn save_progress(&self) -> Result<BlockState> {
        let optimizer = self.optimizer.to_bytes().map_err(|e| unwritable(&e))?;
        let parts = [(OPTIMIZER, optimizer), (ANCHOR, bytes_of(&self.anchor)?)];
        Ok(parts.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect())
    }

    fn load_progress(&mut self, state: &BlockState) -> Result<(), String> {
        self.anchor = with_bytes(&self.anchor, state, ANCHOR)?;
        self.optimizer = fresh_optimizer(&self.network, &self.how)
            .with_bytes(part(state, OPTIMIZER)?)
            .map_err(|e| format!("{OPTIMIZER}: not the state of this optimiser: {e}"))?;
        Ok(())
    }
}

/// An optimiser that has not seen a gradient yet.
fn fresh_optimizer<C: CameraNetwork>(network: &C::Module, how: &C) -> Optimizer {
    Optimizer::new(network, how.optimizer(network))
}

fn unwritable(problem: &dyn std::fmt::Display) -> DesignError {
    DesignError::Unwritable { what: "the network", problem: problem.to_string() }
}

fn bytes_of<M: Module>(network: &M) -> Result<Vec<u8>> {
    network.to_bytes().map_err(|e| unwritable(&e))
}

/// A network with the weights of a part of a state.
fn with_bytes<M: Module>(network: &M, state: &BlockState, name: &str) -> Result<M, String> {
    let bytes = part(state, name)?.to_vec();
    network.clone().load_bytes(bytes).map_err(|e| format!("{name}: {e}"))
}

/// The proximal map of `strength / 2 |theta - anchor|^2`: `theta <- (theta + strength anchor) / (1 + strength)`.
fn pulled_towards<M: Module>(network: M, anchor: &M, strength: f64) -> M {
    let mut centre = WeightValues(Vec::new());
    anchor.visit(&mut centre);
    network.map(&mut Pull { anchor: centre.0.into_iter(), strength })
}

/// Collects the weights of a network in the order of a visit.
struct WeightValues(Vec<TensorData>);

impl ModuleVisitor for WeightValues {
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
    use burn::optim::AdamConfig;
    use petzval_learn::Device;
    use petzval_learn::network::{Network, NetworkKind};

    struct ByAdam;

    impl CameraNetwork for ByAdam {
        type Module = Network;

        fn attached(&self, _: Network, camera: &Camera, _: Sight) -> Camera {
            camera.clone()
        }

        fn optimizer(&self, _: &Network) -> ModuleOptimizer {
            AdamConfig::new().init()
        }
    }

    fn weights<M: Module>(network: &M) -> Vec<f32> {
        let mut all = WeightValues(Vec::new());
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
        // A network that has moved since its stage began.
        let kept = InTraining { network: network(2), ..InTraining::new(network(1), ByAdam) };
        let mut restored = InTraining::new(network(3), ByAdam);
        restored.load_numbers(&kept.save_numbers().unwrap()).unwrap();
        restored.load_progress(&kept.save_progress().unwrap()).unwrap();
        assert_eq!(weights(&restored.network), weights(&kept.network));
        assert_eq!(weights(&restored.anchor), weights(&network(1)));
        assert!(restored.load_progress(&BlockState::new()).is_err());
    }
}
