//! Faster R-CNN (Ren 2015) on a feature pyramid, as torchvision defines it.

use burn::module::Module;
use burn::prelude::*;

use super::anchors::Anchors;
use super::backbone::{Backbone, BackboneKind};
use super::box_head::{BoxHead, BoxHeadConfig};
use super::levels::LevelOfBox;
use super::parameters::Parameters;
use super::proposals::{ProposalConfig, ProposalNetwork};
use super::pyramid::Pyramid;
use super::roi_align::RoiAlign;
use super::{Detection, Detector, Truth, normalized};
use crate::loss::LossError;
use crate::network::NetworkError;
use crate::objective::NamedLoss;

/// The parts of a Faster R-CNN and their settings.
#[derive(Clone, Debug, PartialEq)]
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
                sampled: 256,
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

    /// A detector that trains on two processor cores: a small backbone, smaller anchors (objects of 8 pixels count), fewer proposals.
    pub fn small(classes: usize) -> Self {
        let sizes = [12.0, 24.0, 48.0, 96.0, 160.0];
        let base = Self::torchvision(BackboneKind::Small, classes);
        Self {
            channels: 48,
            proposals: ProposalConfig {
                anchors: Anchors {
                    sizes: sizes.map(|s| vec![s]).to_vec(),
                    aspect_ratios: vec![0.5, 1.0, 2.0],
                },
                before_suppression: [200, 200],
                after_suppression: [100, 100],
                sampled: 128,
                ..base.proposals
            },
            boxes: BoxHeadConfig {
                hidden: 128,
                roi_align: RoiAlign { size: [5, 5], samples: Some(2), is_aligned: true },
                level: LevelOfBox { canonical_size: 64.0, ..base.boxes.level },
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
        self.pyramid.forward(self.body.features(normalized(pictures)))
    }
}

/// Levels of the pyramid that the second stage looks at: all but the additional one.
fn for_boxes(maps: &[Tensor<4>]) -> &[Tensor<4>] {
    &maps[..maps.len() - 1]
}

impl Detector for FasterRcnn {
    fn loss(&self, pictures: Tensor<4>, truths: &[Truth], seed: u64) -> Result<NamedLoss, LossError> {
        let [_, _, height, width] = pictures.dims();
        let maps = self.maps(pictures);
        let seen = self.proposals.look(&maps, [height, width]);
        let proposals = self.proposals.proposals(&seen, [height, width], true)?;
        let [objectness, proposed] = self.proposals.losses(&seen, truths, seed);
        // The two stages draw from different streams.
        let own = seed ^ 0x5bd1_e995_9d1b_873f;
        let [class, bbox] = self.boxes.losses(for_boxes(&maps), &proposals, truths, [height, width], own);
        NamedLoss::sum(vec![
            ("objectness", objectness),
            ("proposal_box", proposed),
            ("class", class),
            ("box", bbox),
        ])
    }

    fn detect(&self, pictures: Tensor<4>) -> Result<Vec<Vec<Detection>>, LossError> {
        let [_, _, height, width] = pictures.dims();
        let maps = self.maps(pictures);
        let seen = self.proposals.look(&maps, [height, width]);
        let proposals = self.proposals.proposals(&seen, [height, width], false)?;
        self.boxes.detect(for_boxes(&maps), &proposals, [height, width])
    }
}
