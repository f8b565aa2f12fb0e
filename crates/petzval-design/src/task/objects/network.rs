//! The detector of a camera.

use std::path::Path;

use burn::module::Module;
use burn::optim::ModuleOptimizer;
use burn::prelude::*;
use petzval_learn::dataset::Classes;
use petzval_learn::detection::{AnyDetector, BackboneKind, Detector, DetectorKind, WeightsOf, Zoom, Zoomed};
use petzval_learn::optimizer::muon_and_adam;
use petzval_learn::weight_file::Weights;

use crate::block::{CameraNetwork, NetworkBlock, Sight};
use crate::camera::Camera;
use crate::error::{DesignError, Result};
use crate::experiment::{DetectorConfig, Experiment};

/// A detector as the files of cameras hold it. Its one case is a part of the names of its weights.
#[derive(Module, Debug)]
pub enum DetectorNetwork {
    /// Of any kind.
    Detector(AnyDetector),
}

/// What looks for objects in the finished pictures of a camera.
pub struct Finder {
    /// The detector, behind a digital zoom if it has one.
    pub detector: Box<dyn Detector>,
    /// Its classes.
    pub classes: Classes,
}

/// A detector that learns in a camera, by Muon and Adam.
pub struct Finding {
    /// Its classes.
    pub classes: Classes,
}

impl CameraNetwork for Finding {
    type Module = DetectorNetwork;

    fn attached(&self, network: DetectorNetwork, camera: &Camera, sight: Sight) -> Camera {
        let detector = zoomed(network, sight);
        camera.with_reader(Finder { detector, classes: self.classes.clone() }, sight.sees)
    }

    fn optimizer(&self, network: &DetectorNetwork) -> ModuleOptimizer {
        let DetectorNetwork::Detector(detector) = network;
        muon_and_adam(detector)
    }
}

/// A detector that sees its pictures enlarged.
fn zoomed(DetectorNetwork::Detector(detector): DetectorNetwork, sight: Sight) -> Box<dyn Detector> {
    if sight.zoom == 1.0 {
        return Box::new(detector);
    }
    Box::new(Zoomed::new(detector, Zoom::Times(sight.zoom)))
}

/// The detector of a block with its weights held, so that no picture leaves anything in memory for a gradient; none if it holds another network.
pub fn detector_of(block: &NetworkBlock) -> Option<Box<dyn Detector>> {
    Some(zoomed(block.network::<Finding>()?, block.sight()))
}

/// The detector of an experiment before its weights are loaded.
pub fn untrained(experiment: &Experiment, device: &Device) -> Result<NetworkBlock> {
    Ok(NetworkBlock::new(drawn(experiment, device)?, Finding { classes: experiment.classes() }))
}

/// The weights that an experiment names for its detector.
pub(super) fn given_weights(experiment: &Experiment) -> Result<Option<Vec<u8>>> {
    let Some(path) = experiment.detector.weights.as_ref().map(Path::new) else { return Ok(None) };
    Ok(Some(petzval_base::read_whole(path).map_err(DesignError::io(path))?))
}

/// The detector of an experiment at the start, with given weights or those drawn from the seed.
pub(super) fn block(
    experiment: &Experiment,
    given_weights: Option<&[u8]>,
    device: &Device,
) -> Result<NetworkBlock> {
    let block = |network| NetworkBlock::new(network, Finding { classes: experiment.classes() });
    let Some((path, bytes)) = experiment.detector.weights.as_ref().zip(given_weights) else {
        return Ok(block(drawn(experiment, device)?));
    };
    match experiment.detector.safetensors() {
        Some(path) => Ok(block(read(experiment, path, bytes, device)?)),
        None => block(drawn(experiment, device)?).with_weights(Path::new(path), bytes),
    }
}

/// The detector of an experiment with weights drawn from its seed.
fn drawn(experiment: &Experiment, device: &Device) -> Result<DetectorNetwork> {
    let DetectorConfig { kind, backbone, .. } = experiment.detector;
    let classes = experiment.class.len();
    Ok(DetectorNetwork::Detector(kind.init(backbone, classes, experiment.seed, device)?))
}

/// The detector of an experiment with the weights of a safetensors file: of a detector of torchvision, of a classifier of torchvision for the
/// backbone alone, or `network.safetensors` of a run.
fn read(experiment: &Experiment, path: &Path, bytes: &[u8], device: &Device) -> Result<DetectorNetwork> {
    let DetectorConfig { kind, backbone, .. } = experiment.detector;
    let holds = WeightsOf::file(bytes);
    let misfit = match holds {
        WeightsOf::Detector if kind != DetectorKind::FasterRcnn || backbone == BackboneKind::Small => Some((
            "weights of torchvision, which has no detector of this kind on this backbone",
            "write \"faster-rcnn\" for detector.kind, and the backbone of the weights, such as \"resnet50\", for detector.backbone",
        )),
        WeightsOf::Classifier if backbone == BackboneKind::Small => Some((
            "weights of a classifier of torchvision, which has none on this backbone",
            "write the backbone of the weights, such as \"resnet50\", for detector.backbone",
        )),
        _ => None,
    };
    if let Some((message, hint)) = misfit {
        return Err(DesignError::misfit(path, &message, hint));
    }
    let (read, hint) = match holds {
        WeightsOf::Detector => (
            match experiment.class.iter().map(|class| class.coco).collect::<Option<Vec<usize>>>() {
                Some(numbers) => AnyDetector::from_coco(backbone, &numbers, bytes, device),
                None => AnyDetector::from_torchvision(backbone, experiment.class.len(), bytes, device),
            }
            .map(DetectorNetwork::Detector),
            "weights of a Faster R-CNN of torchvision on detector.backbone are needed, for the classes of the task or the 90 of COCO; then every \
             [[class]] needs `coco`, the number of what is most like it",
        ),
        WeightsOf::Classifier => (
            kind.from_classifier(backbone, experiment.class.len(), experiment.seed, bytes, device)
                .map(DetectorNetwork::Detector),
            "weights of a classifier of torchvision on detector.backbone are needed",
        ),
        WeightsOf::Other => (
            drawn(experiment, device)?.with_weights(bytes),
            "weights of the same kind of detector, backbone and number of classes are needed, or those of torchvision",
        ),
    };
    read.map_err(|problem| DesignError::misfit(path, &problem, hint))
}
