//! The second stage of Faster R-CNN: what is in a proposal, and where exactly.

use burn::module::Module;
use burn::prelude::*;
use burn::tensor::activation::{relu, softmax};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::box_coder::BoxCoder;
use super::layers::Linear;
use super::levels::LevelOfBox;
use super::loss::{cross_entropy, smooth_l1};
use super::matcher::{Match, Matcher};
use super::nms::suppress;
use super::parameters::{Parameters, Start, tensor};
use super::proposals::BETA;
use super::roi_align::{Region, RoiAlign};
use super::sampler::sample;
use super::{BBox, Detection, Truth, seen_sides};
use crate::loss::{LossError, image_loss::read_numbers};
use crate::network::NetworkError;

/// Smallest side of a detected box, pixels.
const LEAST_SIDE: f32 = 1e-2;

/// Which proposals have an object in training.
pub(super) const PROPOSALS_WITH_OBJECTS: Matcher = Matcher { high: 0.5, low: 0.5, keep_best: false };

/// How proposals are judged and trained.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoxHeadConfig {
    /// Classes, without the background.
    pub classes: usize,
    /// Features between the two layers.
    pub hidden: usize,
    /// The small map of a proposal.
    pub roi_align: RoiAlign,
    /// On which level a proposal is looked at.
    pub level: LevelOfBox,
    /// Proposals of a picture of which the loss is computed.
    pub sampled: usize,
    /// Largest share of them with an object.
    pub positive: f32,
    /// Least score of a detection.
    pub least_score: f32,
    /// Overlap above which the better of two detections of a class suppresses the other.
    pub most_overlap: f32,
    /// Most detections of a picture.
    pub most_detections: usize,
}

/// Two layers over the small map of a proposal, then a logit for each class and the background, and four offsets for each.
#[derive(Module, Debug)]
pub(crate) struct BoxHead {
    first: Linear,
    second: Linear,
    logits: Linear,
    offsets: Linear,
    #[module(skip)]
    config: BoxHeadConfig,
}

impl BoxHead {
    /// The head under `{name}` for features of this number of channels.
    pub fn new(
        from: &Parameters,
        name: &str,
        channels: usize,
        config: BoxHeadConfig,
    ) -> Result<Self, NetworkError> {
        let [rows, columns] = config.roi_align.size;
        let (inputs, hidden) = (channels * rows * columns, config.hidden);
        let linear = |part: &str, shape: [usize; 2], start: Start| {
            Linear::new(from, &format!("{name}.{part}"), shape, start)
        };
        let rectified = |inputs: usize| Start::Normal((2.0 / inputs as f32).sqrt());
        let outputs = config.classes + 1;
        Ok(Self {
            first: linear("box_head.fc6", [inputs, hidden], rectified(inputs))?,
            second: linear("box_head.fc7", [hidden, hidden], rectified(hidden))?,
            logits: linear("box_predictor.cls_score", [hidden, outputs], Start::Normal(0.01))?,
            offsets: linear("box_predictor.bbox_pred", [hidden, 4 * outputs], Start::Normal(0.001))?,
            config,
        })
    }

    /// Logits `[regions, classes + 1]` and offsets `[regions, 4 (classes + 1)]` of regions, which are sorted by level first. Returned with
    /// the order in which they are.
    fn look(
        &self,
        maps: &[Tensor<4>],
        regions: &[Region],
        picture: [usize; 2],
    ) -> ([Tensor<2>; 2], Vec<usize>) {
        let level = |i: &usize| self.config.level.of(&regions[*i].bbox).min(maps.len() - 1);
        let mut order: Vec<usize> = (0..regions.len()).collect();
        order.sort_by_key(level);
        let mut pooled = Vec::new();
        for (number, map) in maps.iter().enumerate() {
            let on_level: Vec<Region> =
                order.iter().filter(|i| level(i) == number).map(|i| regions[*i]).collect();
            if !on_level.is_empty() {
                // A map is a power of two smaller than the picture, as far as sides are not rounded up.
                let scale = (map.dims()[2] as f32 / seen_sides(picture)[0] as f32).log2().round().exp2();
                pooled.push(self.config.roi_align.pool(map.clone(), &on_level, scale));
            }
        }
        let x = Tensor::cat(pooled, 0).flatten::<2>(1, 3);
        let x = relu(self.second.forward(relu(self.first.forward(x))));
        ([self.logits.forward(x.clone()), self.offsets.forward(x)], order)
    }

    /// The losses of classes and of boxes over sampled proposals of all pictures; the true boxes count among the proposals.
    pub fn losses(
        &self,
        maps: &[Tensor<4>],
        proposals: &[Vec<BBox>],
        truths: &[Truth],
        picture: [usize; 2],
        seed: u64,
    ) -> [Tensor<1>; 2] {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // Of each sampled region, the class and the offsets of its object.
        let (mut regions, mut classes, mut targets) = (Vec::new(), Vec::new(), Vec::new());
        for (item, (truth, proposals)) in truths.iter().zip(proposals).enumerate() {
            let objects: Vec<BBox> = truth.objects.iter().map(|o| o.bbox).collect();
            let boxes: Vec<BBox> = proposals.iter().chain(&objects).copied().collect();
            let matches: Vec<Match> =
                PROPOSALS_WITH_OBJECTS.matches(&objects, &truth.ignored_boxes(), &boxes);
            let drawn = sample(&matches, self.config.sampled, self.config.positive, &mut random);
            for (number, object) in drawn.positive {
                let bbox = boxes[number];
                regions.push(Region { picture: item, bbox });
                classes.push(truth.objects[object].class + 1);
                targets.push(BoxCoder::BOXES.encode(&objects[object], &bbox));
            }
            for number in drawn.negative {
                regions.push(Region { picture: item, bbox: boxes[number] });
                classes.push(0);
                targets.push([0.0; 4]);
            }
        }
        let device = maps[0].device();
        if regions.is_empty() {
            return [0, 1].map(|_| Tensor::zeros([1], &device));
        }
        let ([logits, offsets], order) = self.look(maps, &regions, picture);
        let classes: Vec<usize> = order.iter().map(|i| classes[*i]).collect();
        let targets: Vec<[f32; 4]> = order.iter().map(|i| targets[*i]).collect();
        box_losses(logits, offsets, &classes, &targets)
    }

    /// What the head detects among the proposals of each picture.
    pub fn detect(
        &self,
        maps: &[Tensor<4>],
        proposals: &[Vec<BBox>],
        picture: [usize; 2],
    ) -> Result<Vec<Vec<Detection>>, LossError> {
        let on_pictures = proposals.iter().enumerate();
        let regions: Vec<Region> = on_pictures
            .flat_map(|(picture, boxes)| boxes.iter().map(move |bbox| Region { picture, bbox: *bbox }))
            .collect();
        let mut found = vec![Vec::new(); proposals.len()];
        if regions.is_empty() {
            return Ok(found);
        }
        let ([logits, offsets], order) = self.look(maps, &regions, picture);
        let scores = read_numbers(softmax(logits, 1), "scores of objects")?;
        let offsets = read_numbers(offsets, "boxes of objects")?;
        let outputs = self.config.classes + 1;
        for (row, region) in order.iter().enumerate() {
            let Region { picture: item, bbox: proposal } = regions[*region];
            for class in 1..outputs {
                let (at, score) = (row * outputs + class, scores[row * outputs + class]);
                let bbox = BoxCoder::BOXES
                    .decode(std::array::from_fn(|i| offsets[4 * at + i]), &proposal)
                    .clipped(picture);
                if score > self.config.least_score && bbox.is_at_least(LEAST_SIDE) {
                    found[item].push(Detection { bbox, class: class - 1, score });
                }
            }
        }
        let best = |found: Vec<Detection>| best(found, self.config.most_overlap, self.config.most_detections);
        Ok(found.into_iter().map(best).collect())
    }
}

/// The best detections of a picture: none of a class covers another of it.
pub(crate) fn best(found: Vec<Detection>, most_overlap: f32, most: usize) -> Vec<Detection> {
    let boxes: Vec<BBox> = found.iter().map(|d| d.bbox).collect();
    let scores: Vec<f32> = found.iter().map(|d| d.score).collect();
    let classes: Vec<usize> = found.iter().map(|d| d.class).collect();
    suppress(&boxes, &scores, &classes, most_overlap, most).into_iter().map(|i| found[i]).collect()
}

/// Cross entropy of the classes (0 is background), and for regions with an object the smooth L1 distance of the offsets of its class, summed
/// and divided by the number of all regions.
pub(crate) fn box_losses(
    logits: Tensor<2>,
    offsets: Tensor<2>,
    classes: &[usize],
    targets: &[[f32; 4]],
) -> [Tensor<1>; 2] {
    let [count, outputs] = logits.dims();
    let device = logits.device();
    let with: Vec<usize> = (0..count).filter(|i| classes[*i] > 0).collect();
    let by_class = cross_entropy(logits, classes);
    if with.is_empty() {
        return [by_class, Tensor::zeros([1], &device)];
    }
    let rows: Vec<i64> = with.iter().map(|i| (i * outputs + classes[*i]) as i64).collect();
    let rows = Tensor::<1, Int>::from_data(TensorData::new(rows, [with.len()]), &device);
    let offsets = offsets.reshape([count * outputs, 4]).select(0, rows);
    let targets = with.iter().flat_map(|i| targets[*i]).collect();
    let by_box = smooth_l1(offsets, tensor(targets, [with.len(), 4], &device), BETA) / count as f32;
    [by_class, by_box]
}
