//! Faster R-CNN (Ren 2015) on a feature pyramid, as torchvision defines it.

use std::f32::consts::SQRT_2;

use burn::module::Module;
use burn::prelude::*;
use petzval_base::{Cancel, Cancelled};
use serde::Serialize;

use super::anchors::Anchors;
use super::backbone::{Backbone, BackboneKind};
use super::box_head::{BoxHead, BoxHeadConfig};
use super::levels::LevelOfBox;
use super::matcher::Matcher;
use super::parameters::Parameters;
use super::proposals::{ProposalConfig, ProposalNetwork, Proposed};
use super::pyramid::Pyramid;
use super::roi_align::RoiAlign;
use super::{BBox, Detection, Detector, Truth, features_unless, named, normalized, seen_sides};
use crate::loss::{LossError, NamedLoss};
use crate::network::NetworkError;
use crate::weight_file::NamedArray;

/// The parts of a Faster R-CNN and their settings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FasterRcnnConfig {
    /// The backbone.
    pub backbone: BackboneKind,
    /// Channels of the feature pyramid.
    pub channels: usize,
    /// The first stage.
    pub proposals: ProposalConfig,
    /// The second stage.
    pub boxes: BoxHeadConfig,
}

impl FasterRcnnConfig {
    /// The settings of torchvision's `fasterrcnn_resnet50_fpn`, for any backbone of its names.
    pub fn torchvision(backbone: BackboneKind, classes: usize) -> Self {
        let sizes = [32.0, 64.0, 128.0, 256.0, 512.0];
        Self {
            backbone,
            channels: 256,
            proposals: ProposalConfig {
                anchors: Anchors {
                    sizes: sizes.map(|s| vec![s]).to_vec(),
                    aspect_ratios: vec![0.5, 1.0, 2.0],
                },
                before_suppression: [2000, 1000],
                after_suppression: [2000, 1000],
                most_overlap: 0.7,
                matcher: Matcher { high: 0.7, low: 0.3, keep_best: true },
                sampled: 256,
                box_weight: 1.0,
            },
            boxes: BoxHeadConfig {
                classes,
                hidden: 1024,
                roi_align: RoiAlign { size: [7, 7], samples: Some(2), is_aligned: false },
                level: LevelOfBox { finest: 2, coarsest: 5, canonical_size: 224.0, canonical_level: 4 },
                sampled: 512,
                positive: 0.25,
                least_score: 0.05,
                most_overlap: 0.5,
                most_detections: 100,
            },
        }
    }

    /// A detector that trains on two processor cores: a small backbone, smaller and more anchors (objects of 8 pixels count), fewer proposals,
    /// and a larger loss of their boxes. It sees one or two objects in a picture, not seven as in COCO, and few pictures: each has to count.
    pub fn small(classes: usize) -> Self {
        let sizes = [12.0, 24.0, 48.0, 96.0, 160.0];
        let base = Self::torchvision(BackboneKind::Small, classes);
        Self {
            channels: 48,
            proposals: ProposalConfig {
                anchors: Anchors {
                    sizes: sizes.map(|s| vec![s, s * SQRT_2]).to_vec(),
                    aspect_ratios: vec![0.5, 1.0, 2.0],
                },
                before_suppression: [200, 200],
                after_suppression: [100, 100],
                matcher: Matcher { high: 0.5, ..base.proposals.matcher },
                sampled: 128,
                box_weight: 10.0,
                ..base.proposals
            },
            boxes: BoxHeadConfig {
                hidden: 128,
                roi_align: RoiAlign { size: [7, 7], samples: Some(2), is_aligned: true },
                // Ten places of a map across an object: it is smaller than the pictures of torchvision.
                level: LevelOfBox { canonical_size: 160.0, ..base.boxes.level },
                sampled: 64,
                ..base.boxes
            },
            ..base
        }
    }
}

/// A Faster R-CNN.
#[derive(Module, Debug)]
pub struct FasterRcnn {
    body: Backbone,
    pyramid: Pyramid,
    proposals: ProposalNetwork,
    boxes: BoxHead,
}

impl FasterRcnn {
    /// A detector with weights drawn from `seed` alone.
    pub fn new(config: FasterRcnnConfig, seed: u64, device: &Device) -> Result<Self, NetworkError> {
        Self::with(config, &Parameters::drawn(seed, device))
    }

    /// A detector with the given weights, by torchvision's names.
    pub(crate) fn with(config: FasterRcnnConfig, from: &Parameters) -> Result<Self, NetworkError> {
        let inputs = Backbone::channels(config.backbone);
        Ok(Self {
            body: Backbone::new(config.backbone, from, "backbone.body")?,
            pyramid: Pyramid::new(from, "backbone.fpn", &inputs, config.channels)?,
            proposals: ProposalNetwork::new(from, "rpn.head", config.channels, config.proposals)?,
            boxes: BoxHead::new(from, "roi_heads", config.channels, config.boxes)?,
        })
    }

    fn maps(&self, pictures: Tensor<4>) -> Vec<Tensor<4>> {
        self.pyramid.forward(self.body.features(normalized(pictures)).collect())
    }

    /// As [`maps`](Self::maps), ending before the next layers of the backbone or the pyramid once it is cancelled.
    fn maps_unless(&self, cancel: &Cancel, pictures: Tensor<4>) -> Result<Vec<Tensor<4>>, Cancelled> {
        Ok(self.pyramid.forward(features_unless(cancel, &self.body, pictures)?))
    }
}

impl FasterRcnn {
    /// The losses of both stages, the second of these proposals.
    fn loss_on(
        &self,
        proposals: &[Vec<BBox>],
        maps: &[Tensor<4>],
        seen: &Proposed,
        truths: &[Truth],
        picture: [usize; 2],
        seed: u64,
    ) -> Result<NamedLoss, LossError> {
        let [objectness, proposed] = self.proposals.losses(seen, truths, seed);
        // The two stages draw from different streams.
        let own = seed ^ 0x5bd1_e995_9d1b_873f;
        let [class, bbox] = self.boxes.losses(for_boxes(maps), proposals, truths, picture, own);
        NamedLoss::sum(vec![
            ("objectness", objectness),
            ("proposal_box", proposed),
            ("class", class),
            ("box", bbox),
        ])
    }
}

impl FasterRcnn {
    /// See [`AnyDetector::heads`](super::AnyDetector::heads).
    pub(super) fn heads(&self, pictures: Tensor<4>) -> Result<Vec<NamedArray>, LossError> {
        let [_, _, height, width] = pictures.dims();
        let seen = self.proposals.look(&self.maps(pictures), seen_sides([height, width]));
        Ok(vec![
            named("objectness", seen.logits, "logits of proposals")?,
            named("offsets", seen.offsets, "boxes of proposals")?,
        ])
    }
}

/// Levels of the pyramid that the second stage looks at: all but the additional one.
fn for_boxes(maps: &[Tensor<4>]) -> &[Tensor<4>] {
    &maps[..maps.len() - 1]
}

impl Detector for FasterRcnn {
    /// The maps of the pyramid, then logits and offsets of each.
    fn look(&self, pictures: Tensor<4>) -> Vec<Tensor<4>> {
        let mut look = self.maps(pictures);
        let outputs: Vec<_> = look.iter().flat_map(|map| self.proposals.outputs(map)).collect();
        look.extend(outputs);
        look
    }

    fn loss_of_look(
        &self,
        look: Vec<Tensor<4>>,
        picture: [usize; 2],
        truths: &[Truth],
        seed: u64,
    ) -> Result<NamedLoss, LossError> {
        let (maps, outputs) = look.split_at(look.len() / 3);
        let seen = self.proposals.proposed(outputs, seen_sides(picture));
        let proposals = self.proposals.proposals(&seen, picture, true)?;
        self.loss_on(&proposals, maps, &seen, truths, picture, seed)
    }

    fn detect_unless(&self, cancel: &Cancel, pictures: Tensor<4>) -> Result<Vec<Vec<Detection>>, LossError> {
        let [_, _, height, width] = pictures.dims();
        let maps = self.maps_unless(cancel, pictures)?;
        cancel.check()?;
        let seen = self.proposals.look(&maps, seen_sides([height, width]));
        cancel.check()?;
        let proposals = self.proposals.proposals(&seen, [height, width], false)?;
        cancel.check()?;
        self.boxes.detect(for_boxes(&maps), &proposals, [height, width])
    }
}

#[cfg(test)]
mod torchvision;

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use super::*;
    use crate::detection::{MEAN, Object};

    /// Which boxes are proposed and sampled changes in steps; between them the loss has this gradient.
    #[test]
    fn the_loss_of_fixed_proposals_has_its_gradient_by_the_picture() {
        let device = Device::flex().autodiff();
        let detector = FasterRcnn::new(FasterRcnnConfig::small(2), 3, &device).unwrap();
        let side = 64;
        let values: Vec<f32> =
            (0..2 * 3 * side * side).map(|i| 0.5 + 0.4 * (0.37 * i as f32).sin()).collect();
        let object = |x: f32, class| Object { bbox: BBox::new(x, 10.0, x + 20.0, 40.0), class };
        let truths = [vec![object(5.0, 0), object(30.0, 1)], vec![object(20.0, 1)]]
            .map(|objects| Truth { objects, ..Truth::default() });
        let run = |values: &[f32], fixed: Option<&Vec<Vec<BBox>>>| {
            let data = TensorData::new(values.to_vec(), [2, 3, side, side]);
            let leaf = Tensor::<4>::from_data(data, &device).require_grad();
            let maps = detector.maps(leaf.clone());
            let seen = detector.proposals.look(&maps, [side; 2]);
            let proposals = match fixed {
                Some(fixed) => fixed.clone(),
                None => detector.proposals.proposals(&seen, [side; 2], true).unwrap(),
            };
            let loss = detector.loss_on(&proposals, &maps, &seen, &truths, [side; 2], 7).unwrap();
            let total = loss.parts.last().unwrap().1;
            let gradient =
                leaf.grad(&loss.total.backward()).unwrap().into_data().try_to_vec::<f32>().unwrap();
            (total, gradient, proposals)
        };
        let (_, gradient, proposals) = run(&values, None);
        let square: f64 = gradient.iter().map(|g| f64::from(*g).powi(2)).sum();
        let step = 0.05 / square.sqrt();
        let moved = |sign: f64| -> Vec<f32> {
            values.iter().zip(&gradient).map(|(v, g)| v + (sign * step * f64::from(*g)) as f32).collect()
        };
        let loss = |sign: f64| run(&moved(sign), Some(&proposals)).0;
        let difference = (loss(1.0) - loss(-1.0)) / (2.0 * step);
        assert!((difference / square - 1.0).abs() < 0.03, "{difference} {square}");
    }

    #[test]
    fn detection_that_is_cancelled_ends_before_its_next_layers() {
        let device = Device::flex();
        let detector = FasterRcnn::new(FasterRcnnConfig::small(2), 3, &device).unwrap();
        let cancel = Cancel::default();
        cancel.set();
        let found = detector.detect_unless(&cancel, Tensor::zeros([1, 3, 64, 64], &device));
        assert!(matches!(found, Err(LossError::Stopped(_))));
    }

    #[test]
    fn pictures_are_seen_in_the_corner_of_larger_ones_with_sides_that_are_multiples_of_32() {
        let device = Device::flex();
        let detector = FasterRcnn::new(FasterRcnnConfig::small(2), 3, &device).unwrap();
        let (height, width) = (70, 100);
        let picture = |height: usize, width: usize, at: &dyn Fn(usize, usize, usize) -> f32| {
            let places = (0..3).flat_map(|c| (0..height * width).map(move |i| (c, i / width, i % width)));
            let values: Vec<f32> = places.map(|(c, row, column)| at(c, row, column)).collect();
            Tensor::<4>::from_data(TensorData::new(values, [1, 3, height, width]), &device)
        };
        let inside =
            |c: usize, row: usize, column: usize| 0.5 + 0.4 * (0.7 * (c + 3 * row + 5 * column) as f32).sin();
        let own = detector.maps(picture(height, width, &inside));
        let extended = detector.maps(picture(96, 128, &|c, row, column| {
            if row < height && column < width { inside(c, row, column) } else { MEAN[c] }
        }));
        assert_eq!(own.len(), extended.len());
        for (own, extended) in own.into_iter().zip(extended) {
            assert_eq!(own.dims(), extended.dims());
            let difference = (own - extended).abs().max().into_scalar::<f32>();
            assert!(difference < 1e-5, "{difference}");
        }
        // Nothing is found outside of the picture.
        let found = detector.detect(picture(height, width, &inside)).unwrap().remove(0);
        assert!(found.iter().all(|d| d.bbox.x2 <= width as f32 && d.bbox.y2 <= height as f32));
    }
}
