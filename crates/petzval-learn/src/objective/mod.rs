//! What a camera is optimised for: a named loss of what it took, against labels.
//!
//! A new objective is one file here and one line in [`petzval_design`'s experiment](self), because the design loop knows
//! an objective only by the trait [`Objective`].

mod image_quality;
mod objects;

pub use image_quality::ImageQuality;
pub use objects::FindObjects;

use burn::prelude::*;
use petzval_camera::tape::Frames;

use crate::detection::{Detector, Truth};
use crate::loss::LossError;

pub use crate::loss::NamedLoss;

/// What is known of the scenes of a batch: the truth that an objective compares with.
#[derive(Clone)]
#[expect(clippy::large_enum_variant, reason = "there is one, which is hardly ever moved")]
pub enum Labels {
    /// The scenes as a perfect camera would show them, `[batch, 3, height, width]`, sRGB-encoded, 0..1.
    Pictures(Tensor<4>),
    /// The objects of each scene.
    Objects(Vec<Truth>),
}

/// The kind of labels that an objective compares with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LabelKind {
    /// See [`Labels::Pictures`].
    Pictures,
    /// See [`Labels::Objects`].
    Objects,
}

/// What a camera took.
pub struct Taken<'a> {
    /// The frames of a batch.
    pub frames: &'a Frames,
    /// What looks at its finished pictures; none behind a camera for people.
    pub detector: Option<&'a dyn Detector>,
    /// Decides what is drawn at random in a loss: the same for the same batch.
    pub seed: u64,
}

/// A loss of what a camera took.
pub trait Objective {
    /// What it compares with.
    fn labels(&self) -> LabelKind;

    /// The loss of a batch of frames, the mean over its pictures. Its graph leads to whatever the graphs of the frames and of the detector
    /// lead to. Fails on labels of another kind.
    fn loss(&self, taken: &Taken, labels: &Labels) -> Result<NamedLoss, LossError>;
}
