//! Kind and sizes of a network, and how both follow from the names and shapes of its weights.

use std::collections::BTreeMap;

use petzval_camera::image::CHANNELS;
use serde::{Deserialize, Serialize};

use crate::detection::{BackboneKind, DetectorConfig, DetectorKind};
use crate::network::{IspProxyConfig, NetworkError, OpticsProxyConfig, UNetConfig};

/// A kind of network and its sizes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", content = "settings", rename_all = "kebab-case")]
pub enum NetworkSpec {
    /// A U-Net that finishes pictures.
    UNet(UNetConfig),
    /// A U-Net behind a restoration.
    Restoration(RestorationSpec),
    /// A network without activation functions behind a restoration.
    RestorationNaf(RestorationSpec),
    /// A U-Net for the classes of pixels.
    Segmenter(SegmenterSpec),
    /// A network in place of an ISP.
    IspProxy(IspProxyConfig),
    /// A network in place of ray tracing.
    OpticsProxy(OpticsProxyConfig),
    /// A detector of two stages.
    FasterRcnn(DetectorSpec),
    /// A detector of one stage.
    Fcos(DetectorSpec),
}

/// Sizes of a network behind a restoration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RestorationSpec {
    /// Channels at full resolution, 1..=256.
    pub base_channels: usize,
    /// How often the picture is halved, 1..=6.
    pub levels: usize,
}

/// Sizes of a network for the classes of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SegmenterSpec {
    /// Classes, 1..=64.
    pub classes: usize,
    /// Channels at full resolution, 1..=256.
    pub base_channels: usize,
    /// How often the picture is halved, 1..=6.
    pub levels: usize,
}

/// What a detector is built on, and for how many classes; all else follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DetectorSpec {
    /// The backbone.
    pub backbone: BackboneKind,
    /// Classes, without the background, 1..=1000.
    pub classes: usize,
}

/// Kinds of networks by name, as experiments and other programs have them.
const KINDS: [&str; 8] = [
    "u-net",
    "restoration",
    "restoration-naf",
    "segmenter",
    "isp-proxy",
    "optics-proxy",
    "faster-rcnn",
    "fcos",
];

/// Weights of the last layer of a detector, as this program and as torchvision call them, and the same of a detector of one stage.
const TWO_STAGES: [&str; 2] = ["boxes.logits", "roi_heads.box_predictor.cls_score"];
const ONE_STAGE: [&str; 2] = ["logits", "head.logits"];

/// Weights by which a backbone is known, as this program and as torchvision call them. A ResNet-50 has those of a ResNet-18, too.
const BACKBONES: [(BackboneKind, [&str; 2]); 4] = [
    (
        BackboneKind::Resnet50,
        ["body.layers.0.0.convolutions.2.weight", "backbone.body.layer1.0.conv3.weight"],
    ),
    (
        BackboneKind::Resnet18,
        ["body.layers.0.0.convolutions.1.weight", "backbone.body.layer1.0.conv2.weight"],
    ),
    (BackboneKind::MobilenetV2, ["body.first.weight", "backbone.body.0.0.weight"]),
    (BackboneKind::Small, ["body.stages.0.down.weight", "backbone.body.stages.0.down.weight"]),
];

impl NetworkSpec {
    /// Name of the kind.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::UNet(_) => KINDS[0],
            Self::Restoration(_) => KINDS[1],
            Self::RestorationNaf(_) => KINDS[2],
            Self::Segmenter(_) => KINDS[3],
            Self::IspProxy(_) => KINDS[4],
            Self::OpticsProxy(_) => KINDS[5],
            Self::FasterRcnn(_) => KINDS[6],
            Self::Fcos(_) => KINDS[7],
        }
    }

    /// All settings of a detector; none of another network.
    pub fn detector(&self) -> Option<DetectorConfig> {
        let (kind, of) = self.of_detector()?;
        Some(kind.config(of.backbone, of.classes))
    }

    /// What kind of detector it is, and on what.
    pub(super) fn of_detector(&self) -> Option<(DetectorKind, DetectorSpec)> {
        match self {
            Self::FasterRcnn(of) => Some((DetectorKind::FasterRcnn, *of)),
            Self::Fcos(of) => Some((DetectorKind::Fcos, *of)),
            _ => None,
        }
    }

    /// Channels of the pictures that a U-Net takes; none of another network.
    pub(super) fn in_channels(&self) -> Option<usize> {
        match self {
            Self::UNet(of) => Some(of.in_channels),
            _ => None,
        }
    }

    /// The network that has weights of these shapes. A U-Net that finishes pictures and one for three classes of pixels have the same: without
    /// `kind` it is the former. Fails where no network has such weights.
    pub(super) fn of_shapes(shapes: &Shapes, kind: Option<&str>) -> Result<Self, NetworkError> {
        let kind = match kind {
            Some(kind) => kind,
            None => kind_of(shapes)?,
        };
        match kind {
            "u-net" => {
                let (base_channels, levels) = shapes.trunk("")?;
                let [_, in_channels, ..] = shapes.of::<4>("trunk.encoder.0.first.weight")?;
                let [out_channels, _] = shapes.of("last_weight")?;
                Ok(Self::UNet(UNetConfig { base_channels, levels, in_channels, out_channels }))
            }
            "restoration" => {
                let (base_channels, levels) = shapes.trunk("correction.")?;
                Ok(Self::Restoration(RestorationSpec { base_channels, levels }))
            }
            "restoration-naf" => {
                let [base_channels, ..] = shapes.of::<4>("correction.first.weight")?;
                let levels = shapes.count("correction.encoder", "halve.weight");
                let largest = format!("correction.encoder.{}.halve.weight", levels.saturating_sub(1));
                shapes.check_largest(&largest, base_channels, levels)?;
                Ok(Self::RestorationNaf(RestorationSpec { base_channels, levels }))
            }
            "segmenter" => {
                let (base_channels, levels) = shapes.trunk("")?;
                let [classes, _] = shapes.of("last_weight")?;
                Ok(Self::Segmenter(SegmenterSpec { classes, base_channels, levels }))
            }
            "isp-proxy" => {
                let (base_channels, levels) = shapes.trunk("")?;
                let [parameters, hidden] = shapes.of("hidden_weight")?;
                let [thumbnail_channels, ..] = shapes.of::<4>("thumbnail.0.weight")?;
                let sizes = IspProxyConfig { parameters, base_channels, levels, thumbnail_channels, hidden };
                Ok(Self::IspProxy(sizes))
            }
            "optics-proxy" => {
                let [inputs, hidden] = shapes.of("first.weight")?;
                let [channels, ..] = shapes.of::<4>("coarse.0.weight")?;
                Ok(Self::OpticsProxy(OpticsProxyConfig { inputs, hidden, channels }))
            }
            "faster-rcnn" => {
                let name = shapes.one_of(TWO_STAGES, ".weight")?;
                let [outputs, _] = shapes.of(&name)?;
                Ok(Self::FasterRcnn(shapes.detector(outputs.saturating_sub(1))?))
            }
            "fcos" => {
                let name = shapes.one_of(ONE_STAGE, ".weight")?;
                let [classes, ..] = shapes.of::<4>(&name)?;
                Ok(Self::Fcos(shapes.detector(classes)?))
            }
            other => Err(NetworkError::BadWeights(format!(
                "`{other}` is no kind of network; there are {}",
                KINDS.join(", ")
            ))),
        }
    }
}

/// The kind of network that has weights of these names.
fn kind_of(shapes: &Shapes) -> Result<&'static str, NetworkError> {
    let has = |name: &str| shapes.0.contains_key(name);
    let has_one = |names: [&str; 2]| names.iter().any(|name| has(&format!("{name}.weight")));
    let found = if has("correction.last.weight") {
        "restoration-naf"
    } else if has("correction.last_weight") {
        "restoration"
    } else if has("hidden_weight") {
        "isp-proxy"
    } else if has("coarse.0.weight") {
        "optics-proxy"
    } else if has_one(TWO_STAGES) {
        "faster-rcnn"
    } else if has_one(ONE_STAGE) {
        "fcos"
    } else if has("trunk.bottom.first.weight") {
        if shapes.of("last_weight").is_ok_and(|[outputs, _]| outputs == CHANNELS) {
            "u-net"
        } else {
            "segmenter"
        }
    } else {
        let some: Vec<&str> = shapes.0.keys().take(3).map(String::as_str).collect();
        return Err(NetworkError::BadWeights(format!(
            "no network has weights such as {}; there are {}",
            some.join(", "),
            KINDS.join(", ")
        )));
    };
    Ok(found)
}

/// Shapes of weights by name.
#[derive(Clone, Debug, Default)]
pub(super) struct Shapes(pub BTreeMap<String, Vec<usize>>);

impl Shapes {
    /// The shape of a weight of as many dimensions.
    fn of<const D: usize>(&self, name: &str) -> Result<[usize; D], NetworkError> {
        let shape = self.0.get(name).ok_or_else(|| missing(name))?;
        shape.as_slice().try_into().map_err(|_| {
            NetworkError::BadWeights(format!("{name} has shape {shape:?}, and needs {D} dimensions"))
        })
    }

    /// How many layers `{before}.0.{after}`, `{before}.1.{after}` and so on there are.
    fn count(&self, before: &str, after: &str) -> usize {
        (0..).take_while(|i| self.0.contains_key(&format!("{before}.{i}.{after}"))).count()
    }

    /// Channels at full resolution and levels of the way down and up of a U-Net.
    fn trunk(&self, prefix: &str) -> Result<(usize, usize), NetworkError> {
        let [base, ..] = self.of::<4>(&format!("{prefix}trunk.encoder.0.first.weight"))?;
        let levels = self.count(&format!("{prefix}trunk.encoder"), "first.weight");
        self.check_largest(&format!("{prefix}trunk.bottom.first.weight"), base, levels)?;
        Ok((base, levels))
    }

    /// Checks the largest weight of a network whose channels double with each level, so that none is built that is larger than its file.
    fn check_largest(&self, name: &str, base: usize, levels: usize) -> Result<(), NetworkError> {
        let [outputs, inputs, ..] = self.of::<4>(name)?;
        let channels = |level: usize| base.checked_shl(level as u32);
        if levels == 0 || Some(outputs) != channels(levels) || Some(inputs) != channels(levels - 1) {
            return Err(NetworkError::BadWeights(format!(
                "{name} has {outputs} x {inputs} channels, which is not what {levels} levels above {base} channels have"
            )));
        }
        Ok(())
    }

    /// The name of a weight that is there in one of two ways.
    fn one_of(&self, names: [&str; 2], part: &str) -> Result<String, NetworkError> {
        let names = names.map(|name| format!("{name}{part}"));
        names.iter().find(|name| self.0.contains_key(*name)).cloned().ok_or_else(|| missing(&names[0]))
    }

    /// A detector of these weights for a number of classes.
    fn detector(&self, classes: usize) -> Result<DetectorSpec, NetworkError> {
        check_classes(classes)?;
        let is_there = |names: &[&str; 2]| names.iter().any(|name| self.0.contains_key(*name));
        let found = BACKBONES.iter().find(|(_, names)| is_there(names));
        let (backbone, _) = found.ok_or_else(|| {
            NetworkError::BadWeights(
                "its backbone is none of small, resnet18, resnet50, mobilenet-v2".to_owned(),
            )
        })?;
        Ok(DetectorSpec { backbone: *backbone, classes })
    }
}

/// Refuses a number of classes that no detector has.
pub(super) fn check_classes(classes: usize) -> Result<(), NetworkError> {
    match classes {
        1..=1000 => Ok(()),
        value => Err(NetworkError::BadSize { name: "classes", value, range: "1 to 1000" }),
    }
}

pub(super) fn missing(name: &str) -> NetworkError {
    NetworkError::BadWeights(format!("{name} is missing"))
}
