//! Backbones: pictures to features at several resolutions.

mod mobilenet;
mod resnet;
mod small;

use burn::module::Module;
use burn::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::parameters::Parameters;
use crate::network::NetworkError;
use mobilenet::MobileNetV2;
use resnet::ResNet;
use small::Small;

/// A backbone by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BackboneKind {
    /// Blocks of 32 to 128 channels, each normalised over the channels of a pixel, which train on two processor cores.
    #[default]
    Small,
    /// ResNet-18 (He 2016) with frozen batch normalisation.
    Resnet18,
    /// ResNet-50 with frozen batch normalisation; the step of 2 is in the 3x3 convolutions, as in torchvision.
    Resnet50,
    /// MobileNetV2 (Sandler 2018) with frozen batch normalisation.
    MobilenetV2,
}

/// A backbone of one of the kinds.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one, which is hardly ever moved")]
pub(crate) enum Backbone {
    Small(Small),
    ResNet(ResNet),
    MobileNetV2(MobileNetV2),
}

impl Backbone {
    /// The backbone under `{name}`.
    pub fn new(kind: BackboneKind, from: &Parameters, name: &str) -> Result<Self, NetworkError> {
        Ok(match kind {
            BackboneKind::Small => Self::Small(Small::new(from, name)?),
            BackboneKind::Resnet18 => Self::ResNet(ResNet::with_basic_blocks(from, name, [2, 2, 2, 2])?),
            BackboneKind::Resnet50 => Self::ResNet(ResNet::with_bottlenecks(from, name, [3, 4, 6, 3])?),
            BackboneKind::MobilenetV2 => Self::MobileNetV2(MobileNetV2::new(from, name)?),
        })
    }

    /// Channels of the features, from the finest to the coarsest.
    pub fn channels(kind: BackboneKind) -> [usize; 4] {
        match kind {
            BackboneKind::Small => small::WIDTHS,
            BackboneKind::Resnet18 => [64, 128, 256, 512],
            BackboneKind::Resnet50 => [256, 512, 1024, 2048],
            BackboneKind::MobilenetV2 => [24, 32, 96, 1280],
        }
    }

    /// Features of a batch of pictures, 4, 8, 16 and 32 times smaller than the pictures. Each is computed when it is taken.
    pub fn features(&self, pictures: Tensor<4>) -> Box<dyn Iterator<Item = Tensor<4>> + '_> {
        match self {
            Self::Small(net) => Box::new(net.features(pictures)),
            Self::ResNet(net) => Box::new(net.features(pictures)),
            Self::MobileNetV2(net) => Box::new(net.features(pictures)),
        }
    }
}
