//! Every kind of detector that an experiment may name, as one module.

use burn::module::{Module, ParamId};
use burn::prelude::*;
use petzval_base::Cancel;
use safetensors::SafeTensors;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::parameters::{Outputs, Parameters};
use super::{BackboneKind, Detection, Detector, FasterRcnn, FasterRcnnConfig, Fcos, FcosConfig, Truth};
use crate::loss::{LossError, NamedLoss};
use crate::network::NetworkError;
use crate::weight_file::NamedArray;

/// A kind of detector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DetectorKind {
    /// Two stages: proposals, then boxes.
    #[default]
    FasterRcnn,
    /// One stage without anchors.
    Fcos,
}

/// A detector of one of the kinds.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one, which is hardly ever moved")]
pub enum AnyDetector {
    /// See [`FasterRcnn`].
    FasterRcnn(FasterRcnn),
    /// See [`Fcos`].
    Fcos(Fcos),
}

impl DetectorKind {
    /// A detector for a number of classes, with weights drawn from `seed` alone. A small backbone comes with small layers behind it, the
    /// others with those of torchvision.
    pub fn init(
        self,
        backbone: BackboneKind,
        classes: usize,
        seed: u64,
        device: &Device,
    ) -> Result<AnyDetector, NetworkError> {
        self.with(backbone, classes, &Parameters::drawn(seed, device))
    }

    /// The same, whose backbone has the weights of a classifier of torchvision on it, from a safetensors file. Fails on a weight that is
    /// missing, of another shape or not finite, and names it.
    pub fn from_classifier(
        self,
        backbone: BackboneKind,
        classes: usize,
        seed: u64,
        bytes: &[u8],
        device: &Device,
    ) -> Result<AnyDetector, NetworkError> {
        self.with(backbone, classes, &Parameters::read_backbone(&file(bytes)?, seed, device))
    }

    fn with(
        self,
        backbone: BackboneKind,
        classes: usize,
        from: &Parameters,
    ) -> Result<AnyDetector, NetworkError> {
        Ok(match self.config(backbone, classes) {
            DetectorConfig::FasterRcnn(config) => AnyDetector::FasterRcnn(FasterRcnn::with(config, from)?),
            DetectorConfig::Fcos(config) => AnyDetector::Fcos(Fcos::with(config, from)?),
        })
    }

    /// The settings of a detector on a backbone.
    pub fn config(self, backbone: BackboneKind, classes: usize) -> DetectorConfig {
        match self {
            Self::FasterRcnn => DetectorConfig::FasterRcnn(two_stages(backbone, classes)),
            Self::Fcos => DetectorConfig::Fcos(match backbone {
                BackboneKind::Small => FcosConfig::small(classes),
                _ => FcosConfig { backbone, channels: 256, depth: 4, ..FcosConfig::small(classes) },
            }),
        }
    }

    /// A detector with zeros for weights, and the name of each weight by its number: torchvision's name where torchvision has such a weight.
    pub(crate) fn listed(
        self,
        backbone: BackboneKind,
        classes: usize,
        device: &Device,
    ) -> Result<(AnyDetector, Vec<(ParamId, String)>), NetworkError> {
        let from = Parameters::listed(device);
        let detector = self.with(backbone, classes, &from)?;
        Ok((detector, from.names()))
    }
}

/// Settings of a detector of one of the kinds.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum DetectorConfig {
    /// Of two stages.
    FasterRcnn(FasterRcnnConfig),
    /// Of one stage.
    Fcos(FcosConfig),
}

fn two_stages(backbone: BackboneKind, classes: usize) -> FasterRcnnConfig {
    match backbone {
        BackboneKind::Small => FasterRcnnConfig::small(classes),
        _ => FasterRcnnConfig::torchvision(backbone, classes),
    }
}

/// Outputs of torchvision's detectors for COCO: the background and the numbers up to 90.
const COCO_OUTPUTS: usize = 91;

/// A weight of torchvision's detectors with one value for each output.
const BIAS_OF_CLASSES: &str = "roi_heads.box_predictor.cls_score.bias";

/// The first convolution of a ResNet, and of a MobileNetV2, as torchvision's classifiers call it.
const FIRST_OF_CLASSIFIERS: [&str; 2] = ["conv1.weight", "features.0.0.weight"];

/// Whose weights a safetensors file holds, by their names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WeightsOf {
    /// A Faster R-CNN of torchvision.
    Detector,
    /// A classifier of torchvision, such as those that were trained on ImageNet, whose layers before the last one are a backbone.
    Classifier,
    /// Something else: a detector of this program, if anything of use.
    Other,
}

impl WeightsOf {
    /// What a file holds.
    pub fn file(bytes: &[u8]) -> Self {
        let Ok(file) = file(bytes) else { return Self::Other };
        let holds = |name: &str| file.tensor(name).is_ok();
        match holds(BIAS_OF_CLASSES) {
            true => Self::Detector,
            false if FIRST_OF_CLASSIFIERS.into_iter().any(holds) => Self::Classifier,
            false => Self::Other,
        }
    }
}

fn file(bytes: &[u8]) -> Result<SafeTensors<'_>, NetworkError> {
    SafeTensors::deserialize(bytes)
        .map_err(|error| NetworkError::BadWeights(format!("not a safetensors file: {error}")))
}

impl AnyDetector {
    /// A Faster R-CNN with the weights of a safetensors file that holds them under the names of torchvision. Fails on a weight that is
    /// missing, of another shape or not finite, and names it.
    pub fn from_torchvision(
        backbone: BackboneKind,
        classes: usize,
        bytes: &[u8],
        device: &Device,
    ) -> Result<Self, NetworkError> {
        let file = file(bytes)?;
        let from = Parameters::read(&file, 1, device);
        Ok(Self::FasterRcnn(FasterRcnn::with(two_stages(backbone, classes), &from)?))
    }

    /// The same for a detector of other classes than the 90 of COCO, which the file has: class `c` starts as what COCO has under the number
    /// `coco[c]`. A file that has as many classes as `coco` is taken as it is.
    pub fn from_coco(
        backbone: BackboneKind,
        coco: &[usize],
        bytes: &[u8],
        device: &Device,
    ) -> Result<Self, NetworkError> {
        let file = file(bytes)?;
        let outputs = file.tensor(BIAS_OF_CLASSES).map(|bias| bias.shape().to_vec());
        let from = Parameters::read(&file, 1, device);
        let from = if outputs.is_ok_and(|shape| shape == [coco.len() + 1]) {
            from
        } else {
            from.taking(Outputs { of: COCO_OUTPUTS, taken: [&[0], coco].concat() })
        };
        Ok(Self::FasterRcnn(FasterRcnn::with(two_stages(backbone, coco.len()), &from)?))
    }

    /// The same with its weights held: no gradient goes to them.
    pub fn held(self) -> Self {
        self.no_grad()
    }

    /// What its last layers say of pictures `[batch, 3, height, width]`, sRGB-encoded, before any box is chosen.
    ///
    /// Faster R-CNN: `objectness` `[batch, anchors]` and `offsets` `[batch, anchors, 4]` of the first stage. One stage: `logits` `[batch, places,
    /// classes]`, `distances` `[batch, places, 4]` (logarithms of distances in strides) and `centredness` `[batch, places]`.
    pub fn heads(&self, pictures: Tensor<4>) -> Result<Vec<NamedArray>, LossError> {
        match self {
            Self::FasterRcnn(detector) => detector.heads(pictures),
            Self::Fcos(detector) => detector.heads(pictures),
        }
    }

    fn of_kind(&self) -> &dyn Detector {
        match self {
            Self::FasterRcnn(detector) => detector,
            Self::Fcos(detector) => detector,
        }
    }
}

impl Detector for AnyDetector {
    fn look(&self, pictures: Tensor<4>) -> Vec<Tensor<4>> {
        self.of_kind().look(pictures)
    }

    fn loss_of_look(
        &self,
        look: Vec<Tensor<4>>,
        picture: [usize; 2],
        truths: &[Truth],
        seed: u64,
    ) -> Result<NamedLoss, LossError> {
        self.of_kind().loss_of_look(look, picture, truths, seed)
    }

    fn detect_unless(&self, cancel: &Cancel, pictures: Tensor<4>) -> Result<Vec<Vec<Detection>>, LossError> {
        self.of_kind().detect_unless(cancel, pictures)
    }
}
