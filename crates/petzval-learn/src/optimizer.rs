//! How the weights of detectors and of the proxy of an image signal processor are moved.

use burn::grad_clipping::GradientClippingConfig;
use burn::module::{Module, ModuleVisitor, Param, ParamGroup, ParamId};
use burn::optim::{AdamConfig, AdjustLrFn, ModuleOptimizer, MuonConfig};
use burn::prelude::*;

/// Largest norm of the gradient of a weight: few boxes, or few pixels, of a batch may say very much.
const LARGEST_GRADIENT: f32 = 1.0;

/// Least rows and columns of a matrix that Muon moves. Layers that give out logits or offsets are smaller.
const LEAST_SIDE: usize = 16;

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

/// The matrices of a module that Muon moves.
struct Matrices(Vec<ParamId>);

impl ModuleVisitor for Matrices {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if D == 2 && param.val().dims().iter().all(|side| *side >= LEAST_SIDE) {
            self.0.push(param.id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detection::{FasterRcnn, FasterRcnnConfig};

    #[test]
    fn matrices_between_hidden_features_are_moved_by_muon() {
        let detector = FasterRcnn::new(FasterRcnnConfig::small(2), 1, &Device::flex()).unwrap();
        let mut matrices = Matrices(Vec::new());
        detector.visit(&mut matrices);
        // Two of each of the seven blocks, what the four stages show, and the two layers over a proposal.
        assert_eq!(matrices.0.len(), 2 * 7 + 4 + 2);
    }
}
