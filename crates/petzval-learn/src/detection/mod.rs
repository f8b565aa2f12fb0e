//! Detectors: where in a picture which objects are.
//!
//! | module | holds |
//! |---|---|
//! | `boxes`, `box_coder`, `anchors`, `levels` | boxes, and boxes relative to others |
//! | `matcher`, `sampler` | which box a loss is computed of, and against which object |
//! | `nms` | of boxes around the same object, the best |
//! | `roi_align` | features of a box, with their gradient |
//! | `backbone`, `pyramid` | pictures to features |
//! | `proposals`, `box_head`, `faster_rcnn` | the two stages of Faster R-CNN |
//! | `fcos` | a detector of one stage, without anchors |
//! | `zoomed` | a digital zoom in front of a detector |
//!
//! Names and defaults are torchvision's (0.29), whose trained weights can be read.

mod anchors;
mod any;
mod backbone;
mod box_coder;
mod box_head;
mod boxes;
mod faster_rcnn;
mod fcos;
mod layers;
mod levels;
mod loss;
mod matcher;
mod nms;
mod parameters;
mod proposals;
mod pyramid;
mod roi_align;
mod sampler;
mod zoomed;

#[cfg(test)]
mod reference;

pub use any::{AnyDetector, DetectorConfig, DetectorKind, WeightsOf};
pub use backbone::BackboneKind;
pub use boxes::BBox;
pub use faster_rcnn::{FasterRcnn, FasterRcnnConfig};
pub use fcos::{Fcos, FcosConfig};
pub use matcher::Match;
pub use zoomed::{Zoom, Zoomed};

use burn::prelude::*;
use burn::tensor::ops::PadMode;
use petzval_base::{Cancel, Cancelled};
use petzval_camera::image::LinearImage;
use petzval_camera::tape::on_device;
use serde::{Deserialize, Serialize};

use crate::loss::image_loss::read_numbers;
use crate::loss::{LossError, NamedLoss};
use crate::weight_file::NamedArray;

/// An object that is to be found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Object {
    /// Its box, pixels of the picture.
    pub bbox: BBox,
    /// Its class, from 0.
    pub class: usize,
}

/// A region in which detections are ignored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ignored {
    /// Its box, pixels of the picture.
    #[serde(flatten)]
    pub bbox: BBox,
    /// The class whose detections are ignored, from 0; those of every class if it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<usize>,
}

impl Ignored {
    /// A region in which detections of every class are ignored.
    pub fn of_all(bbox: BBox) -> Self {
        Self { bbox, class: None }
    }

    /// The same region elsewhere or in another size.
    pub fn with_box(self, bbox: BBox) -> Self {
        Self { bbox, ..self }
    }

    /// Whether detections of a class are ignored.
    pub fn is_of(&self, class: usize) -> bool {
        self.class.is_none_or(|own| own == class)
    }
}

/// What is known of a picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// The objects that are to be found.
    pub objects: Vec<Object>,
    /// Regions in which detections are ignored: objects that are too small, too hidden, or of a class that is not detected, and crowds.
    pub ignored: Vec<Ignored>,
    /// Objects that count and lie beside the picture or nearly so, because its lens shows less of the scene than the one with which it is
    /// compared: whole, where this lens would image them. They are missed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub beside: Vec<Object>,
}

impl Truth {
    /// The boxes of the regions in which detections are ignored. A loss ignores them whatever their class.
    pub fn ignored_boxes(&self) -> Vec<BBox> {
        self.ignored.iter().map(|region| region.bbox).collect()
    }
}

/// An object that was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// Its box, pixels of the picture.
    pub bbox: BBox,
    /// Its class, from 0.
    pub class: usize,
    /// How sure the detector is, 0..1.
    pub score: f32,
}

/// A network that finds objects.
pub trait Detector: Send + Sync {
    /// The loss of pictures `[batch, 3, height, width]`, sRGB-encoded, 0..1, one truth each. Its graph leads to the weights and to the
    /// pictures. `seed` decides of which boxes it is computed.
    fn loss(&self, pictures: Tensor<4>, truths: &[Truth], seed: u64) -> Result<NamedLoss, LossError> {
        let [_, _, height, width] = pictures.dims();
        self.loss_of_look(self.look(pictures), [height, width], truths, seed)
    }

    /// The layers that see each picture alone, nearly all of the work: tensors of which each has the pictures along its first dimension.
    fn look(&self, pictures: Tensor<4>) -> Vec<Tensor<4>>;

    /// [`loss`](Self::loss) of pictures with this height and width, from what [`look`](Self::look) gives of all of them.
    fn loss_of_look(
        &self,
        look: Vec<Tensor<4>>,
        picture: [usize; 2],
        truths: &[Truth],
        seed: u64,
    ) -> Result<NamedLoss, LossError>;

    /// What is found in each picture, best first.
    fn detect(&self, pictures: Tensor<4>) -> Result<Vec<Vec<Detection>>, LossError> {
        self.detect_unless(&Cancel::default(), pictures)
    }

    /// As [`detect`](Self::detect), for large pictures: ends between two groups of layers once it is cancelled, with [`LossError::Stopped`].
    fn detect_unless(&self, cancel: &Cancel, pictures: Tensor<4>) -> Result<Vec<Vec<Detection>>, LossError>;
}

/// What a detector finds in one picture of the host, three planes, sRGB-encoded, 0..1; best first. Ends with [`LossError::Stopped`] once `cancel` is
/// set.
pub fn detect_in(
    detector: &dyn Detector,
    encoded: &LinearImage,
    device: &Device,
    cancel: &Cancel,
) -> Result<Vec<Detection>, LossError> {
    Ok(detector.detect_unless(cancel, on_device(encoded, device))?.swap_remove(0))
}

/// The numbers of a tensor under a name. `what` names the tensor in errors.
fn named<const D: usize>(name: &str, values: Tensor<D>, what: &'static str) -> Result<NamedArray, LossError> {
    let shape = values.dims();
    Ok(NamedArray::new(name, shape, read_numbers(values, what)?))
}

/// Mean and standard deviation of the pictures on which backbones of torchvision were trained (R, G, B).
const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];

/// Sides of the pictures that backbones see are multiples of this, so that no map but the coarsest is rounded up.
const SIDE_UNIT: usize = 32;

/// Pictures with the mean and the spread that backbones expect, extended at the right and bottom by the mean to sides that are multiples of 32
/// pixels: torchvision's transform of detectors, but for its scaling.
fn normalized(pictures: Tensor<4>) -> Tensor<4> {
    let device = pictures.device();
    let by_channel = |v: [f32; 3]| parameters::tensor(v.to_vec(), [1, 3, 1, 1], &device);
    let normal = (pictures - by_channel(MEAN)) * by_channel(DEVIATION.map(|d| 1.0 / d));
    let [_, _, height, width] = normal.dims();
    let [down, right] = [height, width].map(|side| side.next_multiple_of(SIDE_UNIT) - side);
    if down + right == 0 { normal } else { normal.pad([(0, down), (0, right)], PadMode::Constant(0.0)) }
}

/// What a backbone sees of pictures, finest first. Ends before its next layers once it is cancelled.
fn features_unless(
    cancel: &Cancel,
    body: &backbone::Backbone,
    pictures: Tensor<4>,
) -> Result<Vec<Tensor<4>>, Cancelled> {
    cancel.check()?;
    let looked = |features: Tensor<4>| cancel.check().map(|()| features);
    body.features(normalized(pictures)).map(looked).collect()
}

/// Height and width of the pictures that backbones see, of pictures of this height and width.
fn seen_sides(picture: [usize; 2]) -> [usize; 2] {
    picture.map(|side| side.next_multiple_of(SIDE_UNIT))
}
