//! How the weights of networks are moved.

use std::cmp::Reverse;
use std::collections::HashMap;

use burn::grad_clipping::GradientClippingConfig;
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param, ParamGroup, ParamId};
use burn::optim::{AdamConfig, AdjustLrFn, GradientsParams, ModuleOptimizer, MuonConfig};
use burn::prelude::*;
use burn::store::RecordError;
use burn::tensor::Bytes;
use rayon::prelude::*;

/// Largest norm of the gradient of a weight: few boxes, or few pixels, of a batch may say very much.
const LARGEST_GRADIENT: f32 = 1.0;

/// Least rows and columns of a matrix that Muon moves. Layers that give out logits or offsets are smaller.
const LEAST_SIDE: usize = 16;

/// Parts of an optimiser, which take their step at once. The weights of a part are moved one after the other.
const PARTS: usize = 16;

/// An optimiser of all weights of a network, on all threads: each weight tensor is in one of several parts, which take their step at once. The new
/// values of a weight depend on its own gradients alone, so that they have the same bits on any number of threads, and in any parts.
#[derive(Clone)]
pub struct Optimizer {
    parts: Vec<ModuleOptimizer>,
    of_weights: PartOf,
}

/// The part of each weight, by its number.
#[derive(Clone)]
struct PartOf(HashMap<ParamId, usize>);

impl PartOf {
    /// The part that moves a weight: the first for weights that the network had not when its optimiser was made.
    fn get(&self, weight: ParamId) -> usize {
        self.0.get(&weight).copied().unwrap_or(0)
    }

    /// The weights of all parts but one.
    fn others(&self, than: usize) -> Vec<ParamId> {
        self.0.iter().filter(|(_, part)| **part != than).map(|(weight, _)| *weight).collect()
    }
}

impl Optimizer {
    /// An optimiser of the weights of `network` by one that has not seen a gradient yet.
    pub fn new<M: Module>(network: &M, own: ModuleOptimizer) -> Self {
        let mut costs = Costs(Vec::new());
        network.visit(&mut costs);
        // The dearest weight first, each to the part that has the least to do so far.
        costs.0.sort_by_key(|(_, cost)| Reverse(*cost));
        let parts = PARTS.min(costs.0.len()).max(1);
        let (mut part_of, mut work) = (HashMap::new(), vec![0; parts]);
        for (weight, cost) in costs.0 {
            let part = (0..parts).min_by_key(|part| work[*part]).unwrap_or(0);
            work[part] += cost;
            part_of.insert(weight, part);
        }
        Self { parts: vec![own; parts], of_weights: PartOf(part_of) }
    }

    /// The network after a step at a learning rate. Weights without a gradient stay.
    pub fn step<M: Module>(&mut self, rate: f64, network: M, gradients: GradientsParams) -> M {
        let own = (0..self.parts.len()).map(|_| GradientsParams::new()).collect();
        let mut split = Split { gradients, part_of: &self.of_weights, own };
        network.visit(&mut split);
        let work: Vec<(&mut ModuleOptimizer, GradientsParams, M)> = (self.parts.iter_mut().zip(split.own))
            .map(|(part, gradients)| (part, gradients, network.clone()))
            .collect();
        let moved: Vec<M> = work
            .into_par_iter()
            .map(|(part, gradients, network)| part.step(rate, network, gradients))
            .collect();
        let mut weights = GradientsParams::new();
        for (part, moved) in moved.iter().enumerate() {
            moved.visit(&mut Collected { part, part_of: &self.of_weights, weights: &mut weights });
        }
        network.map(&mut Moved(weights))
    }

    /// What the optimiser remembers of earlier gradients, for [`Optimizer::with_bytes`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, RecordError> {
        let mut bytes = MAGIC.to_vec();
        for part in &self.parts {
            let own = part.into_bytes()?;
            bytes.extend((own.len() as u64).to_le_bytes());
            bytes.extend(&own[..]);
        }
        Ok(bytes)
    }

    /// The optimiser with what one of the same network remembers. Bytes of an optimiser without parts are read, too.
    pub fn with_bytes(mut self, bytes: &[u8]) -> Result<Self, RecordError> {
        let mut rest = bytes.strip_prefix(MAGIC);
        for (number, part) in self.parts.iter_mut().enumerate() {
            let own = rest.as_mut().map_or(bytes, next_of);
            *part = part.clone().from_bytes(Bytes::from_bytes_vec(own.to_vec()))?;
            // Without parts all weights are in these bytes. A group of its own makes an optimiser forget a weight.
            if rest.is_none() {
                let others = ParamGroup::from_ids(self.of_weights.others(number));
                *part = part.clone().with_group(others, MuonConfig::new().build(), None);
            }
        }
        Ok(self)
    }
}

/// What the bytes of an optimiser in parts begin with. Then comes each part: the number of its bytes as eight bytes, the lowest first, and the bytes.
const MAGIC: &[u8] = b"petzval optimiser in parts\n";

/// Takes the bytes of the next part; fewer where they end before.
fn next_of<'b>(rest: &mut &'b [u8]) -> &'b [u8] {
    let (count, after) = rest.split_first_chunk::<8>().unwrap_or((&[0; 8], &[]));
    let count = usize::try_from(u64::from_le_bytes(*count)).unwrap_or(usize::MAX).min(after.len());
    let (own, after) = after.split_at(count);
    *rest = after;
    own
}

/// The weights of a module, each with the time that its step takes, about.
struct Costs(Vec<(ParamId, usize)>);

impl ModuleVisitor for Costs {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let sides = param.val().dims();
        // Muon multiplies a matrix with itself, along its shorter side.
        let times = if is_for_muon(&sides) { sides.iter().copied().min().unwrap_or(1) } else { 1 };
        self.0.push((param.id, times * sides.iter().product::<usize>()));
    }
}

/// Gives each part the gradients of its weights.
struct Split<'o> {
    gradients: GradientsParams,
    part_of: &'o PartOf,
    own: Vec<GradientsParams>,
}

impl ModuleVisitor for Split<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.remove::<D>(param.id) {
            self.own[self.part_of.get(param.id)].register(param.id, gradient);
        }
    }
}

/// Collects the weights that a part moves.
struct Collected<'o> {
    part: usize,
    part_of: &'o PartOf,
    weights: &'o mut GradientsParams,
}

impl ModuleVisitor for Collected<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if self.part_of.get(param.id) == self.part {
            self.weights.register(param.id, param.val());
        }
    }
}

/// Puts collected weights into a module.
struct Moved(GradientsParams);

impl ModuleMapper for Moved {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let moved = self.0.remove::<D>(param.id);
        param.map(|value| moved.unwrap_or(value))
    }
}

/// An optimiser that has not seen a gradient yet: Muon (Jordan 2024) for the matrices between hidden features, scaled so that it takes steps as
/// large as Adam's (Liu 2025), and Adam for all other weights.
///
/// Muon turns the gradient of a matrix into the nearest orthogonal matrix: what shows in few or weak directions of the gradient, such as rare
/// objects or a parameter that changes few pixels, is learnt as fast as the rest.
pub fn muon_and_adam<M: Module>(network: &M) -> ModuleOptimizer {
    let mut matrices = Matrices(Vec::new());
    network.visit(&mut matrices);
    let adam = AdamConfig::new().with_grad_clipping(Some(GradientClippingConfig::Norm(LARGEST_GRADIENT)));
    let muon = MuonConfig::new().with_adjust_lr_fn(AdjustLrFn::MatchRmsAdamW);
    adam.init().with_group(ParamGroup::from_ids(matrices.0), muon.build(), None)
}

/// Whether Muon moves a weight with these sides.
fn is_for_muon(sides: &[usize]) -> bool {
    sides.len() == 2 && sides.iter().all(|side| *side >= LEAST_SIDE)
}

/// The matrices of a module that Muon moves.
struct Matrices(Vec<ParamId>);

impl ModuleVisitor for Matrices {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if is_for_muon(&param.val().dims()) {
            self.0.push(param.id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detection::{FasterRcnn, FasterRcnnConfig};

    /// The weights of a network, one after the other.
    struct Values(Vec<f32>);

    impl ModuleVisitor for Values {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            self.0.extend(param.val().into_data().try_to_vec::<f32>().unwrap());
        }
    }

    fn values<M: Module>(network: &M) -> Vec<f32> {
        let mut values = Values(Vec::new());
        network.visit(&mut values);
        values.0
    }

    /// Gradients that differ from step to step.
    struct Drawn(GradientsParams, f32);

    impl ModuleVisitor for Drawn {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let value = param.val().detach().inner();
            self.0.register(param.id, (value * self.1).sin() + self.1);
        }
    }

    fn gradients<M: Module>(network: &M, step: usize) -> GradientsParams {
        let mut drawn = Drawn(GradientsParams::new(), 0.3 + step as f32);
        network.visit(&mut drawn);
        drawn.0
    }

    fn in_parts<M: Module>(network: &M) -> Optimizer {
        Optimizer::new(network, muon_and_adam(network))
    }

    #[test]
    fn parts_move_every_weight_as_the_whole_does_and_go_on_from_their_bytes_and_from_its() {
        let start = FasterRcnn::new(FasterRcnnConfig::small(2), 1, &Device::flex().autodiff()).unwrap();
        let (mut expected, mut own) = (start.clone(), muon_and_adam(&start));
        let (mut network, mut optimizer) = (start.clone(), in_parts(&start));
        assert_eq!(optimizer.parts.len(), PARTS);
        for step in 0..2 {
            let (first, second) = (gradients(&expected, step), gradients(&network, step));
            expected = own.step(0.01, expected, first);
            network = optimizer.step(0.01, network, second);
            assert_eq!(values(&network), values(&expected), "step {step}");
        }
        assert_ne!(values(&network), values(&start));
        let without_parts = own.into_bytes().unwrap();
        let last = gradients(&expected, 7);
        expected = own.step(0.01, expected, last);
        for bytes in [optimizer.to_bytes().unwrap(), without_parts.to_vec()] {
            let mut resumed = in_parts(&network).with_bytes(&bytes).unwrap();
            let moved = resumed.step(0.01, network.clone(), gradients(&network, 7));
            assert_eq!(values(&moved), values(&expected));
            // What was read without parts is kept in parts.
            assert!(resumed.to_bytes().unwrap().len() < 2 * without_parts.len());
            assert!(in_parts(&network).with_bytes(&bytes[..bytes.len() / 2]).is_err());
        }
        // A weight without a gradient stays.
        let unmoved = optimizer.step(0.01, network.clone(), GradientsParams::new());
        assert_eq!(values(&unmoved), values(&network));
    }

    #[test]
    fn matrices_between_hidden_features_are_moved_by_muon() {
        let detector = FasterRcnn::new(FasterRcnnConfig::small(2), 1, &Device::flex()).unwrap();
        let mut matrices = Matrices(Vec::new());
        detector.visit(&mut matrices);
        // Two of each of the seven blocks, what the four stages show, and the two layers over a proposal.
        assert_eq!(matrices.0.len(), 2 * 7 + 4 + 2);
    }
}
