//! The region proposal network (RPN): where in a picture objects of any class may be.

use burn::module::Module;
use burn::prelude::*;
use burn::tensor::activation::{relu, sigmoid};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::anchors::Anchors;
use super::box_coder::BoxCoder;
use super::layers::{Conv, ConvShape};
use super::loss::{binary_cross_entropy, smooth_l1};
use super::matcher::Matcher;
use super::nms::suppress;
use super::parameters::{Parameters, Start, tensor};
use super::sampler::sample;
use super::{BBox, Truth};
use crate::loss::{LossError, image_loss::read_numbers};
use crate::network::NetworkError;

/// Distance below which the loss of boxes is quadratic, for the proposals and for the boxes.
pub(crate) const BETA: f32 = 1.0 / 9.0;

/// Smallest side of a proposal, pixels.
const LEAST_SIDE: f32 = 1e-3;

/// Largest share of the anchors of which the loss is computed that have an object.
pub(super) const POSITIVE_ANCHORS: f32 = 0.5;

/// How proposals are made and trained.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProposalConfig {
    /// The anchors of every level.
    pub anchors: Anchors,
    /// Best anchors of each level that are looked at, in training and otherwise.
    pub before_suppression: [usize; 2],
    /// Proposals of a picture, in training and otherwise.
    pub after_suppression: [usize; 2],
    /// Overlap above which the better of two proposals of a level suppresses the other.
    pub most_overlap: f32,
    /// Which anchors have an object, and which have none.
    pub matcher: Matcher,
    /// Anchors of a picture of which the loss is computed.
    pub sampled: usize,
    /// Factor of the loss of boxes: it is divided by the number of all sampled anchors, of which few have an object.
    pub box_weight: f32,
}

/// The network: a 3x3 convolution over every level of the pyramid, then for each anchor one logit and four offsets.
#[derive(Module, Debug)]
pub(crate) struct ProposalNetwork {
    shared: Conv,
    logits: Conv,
    offsets: Conv,
    #[module(skip)]
    config: ProposalConfig,
}

/// What the network says of all anchors of a batch, and the anchors of a picture.
pub(crate) struct Proposed {
    /// `[batch, anchors]`.
    pub logits: Tensor<2>,
    /// `[batch, anchors, 4]`.
    pub offsets: Tensor<3>,
    /// The anchors, by level, row, column and shape.
    pub anchors: Vec<BBox>,
    /// Number of anchors of each level.
    pub per_level: Vec<usize>,
}

impl ProposalNetwork {
    /// The network under `{name}` for features of this number of channels.
    pub fn new(
        from: &Parameters,
        name: &str,
        channels: usize,
        config: ProposalConfig,
    ) -> Result<Self, NetworkError> {
        let per_place = config.anchors.per_place(0);
        let conv = |part: &str, outputs: usize, kernel: usize, start: Start| {
            Conv::new(from, &format!("{name}.{part}"), ConvShape::new(channels, outputs, kernel), start, 0.0)
        };
        let small = Start::Normal(0.01);
        Ok(Self {
            shared: conv("conv.0.0", channels, 3, ConvShape::new(channels, channels, 3).rectified())?,
            logits: conv("cls_logits", per_place, 1, small)?,
            offsets: conv("bbox_pred", 4 * per_place, 1, small)?,
            config,
        })
    }

    /// Looks at the maps of the pyramid of pictures that have this height and width where the backbone sees them.
    pub fn look(&self, maps: &[Tensor<4>], picture: [usize; 2]) -> Proposed {
        self.proposed(&maps.iter().flat_map(|map| self.outputs(map)).collect::<Vec<_>>(), picture)
    }

    /// Logits and offsets at the places of a map of the pyramid, as planes.
    pub fn outputs(&self, map: &Tensor<4>) -> [Tensor<4>; 2] {
        let seen = relu(self.shared.forward(map.clone()));
        [self.logits.forward(seen.clone()), self.offsets.forward(seen)]
    }

    /// The logits and offsets of all levels, one [pair](Self::outputs) after the other, by anchor.
    pub fn proposed(&self, outputs: &[Tensor<4>], picture: [usize; 2]) -> Proposed {
        let (mut logits, mut offsets) = (Vec::new(), Vec::new());
        let (mut anchors, mut per_level) = (Vec::new(), Vec::new());
        for (level, outputs) in outputs.chunks_exact(2).enumerate() {
            let [batch, _, height, width] = outputs[0].dims();
            let per_place = self.config.anchors.per_place(level);
            let by_place = |x: Tensor<4>, values: usize| {
                x.reshape([batch, per_place, values, height, width]).permute([0, 3, 4, 1, 2]).reshape([
                    batch,
                    height * width * per_place,
                    values,
                ])
            };
            logits.push(by_place(outputs[0].clone(), 1));
            offsets.push(by_place(outputs[1].clone(), 4));
            anchors.extend(self.config.anchors.of_level(level, [height, width], picture));
            per_level.push(height * width * per_place);
        }
        let logits = Tensor::cat(logits, 1);
        let [batch, all, _] = logits.dims();
        let (logits, offsets) = (logits.reshape([batch, all]), Tensor::cat(offsets, 1));
        Proposed { logits, offsets, anchors, per_level }
    }

    /// The proposals of each picture, best first. No gradient goes through them.
    pub fn proposals(
        &self,
        seen: &Proposed,
        picture: [usize; 2],
        is_training: bool,
    ) -> Result<Vec<Vec<BBox>>, LossError> {
        let [batch, all] = seen.logits.dims();
        let scores = read_numbers(sigmoid(seen.logits.clone()), "scores of proposals")?;
        let offsets = read_numbers(seen.offsets.clone(), "boxes of proposals")?;
        let mode = usize::from(!is_training);
        let of_picture = |item: usize| {
            let (mut boxes, mut kept_scores, mut levels) = (Vec::new(), Vec::new(), Vec::new());
            let mut first = 0;
            for (level, count) in seen.per_level.iter().enumerate() {
                // The best anchors of a level, before any box is computed.
                let mut best: Vec<usize> = (first..first + count).collect();
                best.sort_by(|a, b| scores[item * all + b].total_cmp(&scores[item * all + a]));
                best.truncate(self.config.before_suppression[mode]);
                for anchor in best {
                    let at = item * all + anchor;
                    let offset = std::array::from_fn(|i| offsets[4 * at + i]);
                    let bbox = BoxCoder::PROPOSALS.decode(offset, &seen.anchors[anchor]).clipped(picture);
                    if bbox.is_at_least(LEAST_SIDE) {
                        boxes.push(bbox);
                        kept_scores.push(scores[at]);
                        levels.push(level);
                    }
                }
                first += count;
            }
            let (most_overlap, count) = (self.config.most_overlap, self.config.after_suppression[mode]);
            let kept = suppress(&boxes, &kept_scores, &levels, most_overlap, count);
            kept.into_iter().map(|i| boxes[i]).collect()
        };
        Ok((0..batch).into_par_iter().map(of_picture).collect())
    }

    /// The losses of logits and of offsets, over sampled anchors of all pictures.
    pub fn losses(&self, seen: &Proposed, truths: &[Truth], seed: u64) -> [Tensor<1>; 2] {
        let (device, all) = (seen.logits.device(), seen.anchors.len());
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut with, mut without, mut targets) = (Vec::new(), Vec::new(), Vec::new());
        let matched = |truth: &Truth| {
            let boxes: Vec<BBox> = truth.objects.iter().map(|o| o.bbox).collect();
            let matches = self.config.matcher.matches(&boxes, &truth.ignored_boxes(), &seen.anchors);
            (boxes, matches)
        };
        let matched: Vec<_> = truths.par_iter().map(matched).collect();
        // The anchors are drawn picture by picture.
        for (item, (boxes, matches)) in matched.into_iter().enumerate() {
            let drawn = sample(&matches, self.config.sampled, POSITIVE_ANCHORS, &mut random);
            for (anchor, object) in drawn.positive {
                with.push((item * all + anchor) as i64);
                targets.extend(BoxCoder::PROPOSALS.encode(&boxes[object], &seen.anchors[anchor]));
            }
            without.extend(drawn.negative.into_iter().map(|anchor| (item * all + anchor) as i64));
        }
        let (positive, count) = (with.len(), with.len() + without.len());
        if count == 0 {
            return [0, 1].map(|_| Tensor::zeros([1], &device));
        }
        let index = |places: Vec<i64>| {
            let places_count = places.len();
            Tensor::<1, Int>::from_data(TensorData::new(places, [places_count]), &device)
        };
        let [batch, _] = seen.logits.dims();
        // Offsets: only those of anchors with an object.
        let by_offset = match positive {
            0 => Tensor::zeros([1], &device),
            _ => {
                let offsets = seen.offsets.clone().reshape([batch * all, 4]).select(0, index(with.clone()));
                let weight = self.config.box_weight / count as f32;
                smooth_l1(offsets, tensor(targets, [positive, 4], &device), BETA) * weight
            }
        };
        // Logits: of both.
        let mut labels = vec![1.0; positive];
        labels.resize(count, 0.0);
        with.extend(without);
        let logits = seen.logits.clone().reshape([batch * all]).select(0, index(with));
        let by_logit = binary_cross_entropy(logits, tensor(labels, [count], &device)).mean();
        [by_logit, by_offset]
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Proposals of maps by weights of a file, for the reference test.
    pub(crate) fn proposals_of(
        parameters: &Parameters,
        maps: &[Tensor<4>],
        config: ProposalConfig,
        picture: [usize; 2],
    ) -> Vec<Vec<BBox>> {
        let [_, channels, _, _] = maps[0].dims();
        let network = ProposalNetwork::new(parameters, "head", channels, config).unwrap();
        network.proposals(&network.look(maps, picture), picture, false).unwrap()
    }
}
