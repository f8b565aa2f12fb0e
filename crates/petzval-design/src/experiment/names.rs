//! The words of the experiment file that are more than text and numbers.

use petzval_learn::network;
use petzval_optics::psf::PsfKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The network behind the development, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NetworkKind {
    /// A U-Net that sees the picture alone.
    UNet,
    /// A U-Net behind a restoration whose regularisation is trained with it. It sees the pictures before and after restoration, its place
    /// in the field and the noise.
    Restoration,
    /// The same with a NAF network in place of the U-Net.
    #[default]
    RestorationNaf,
    /// A class in Python, which `python.network` names.
    Python,
}

impl NetworkKind {
    /// The kind of a network of this program; none for a class in Python.
    pub fn ours(self) -> Option<network::NetworkKind> {
        match self {
            Self::UNet => Some(network::NetworkKind::UNet),
            Self::Restoration => Some(network::NetworkKind::Restoration),
            Self::RestorationNaf => Some(network::NetworkKind::RestorationNaf),
            Self::Python => None,
        }
    }
}

/// The name of the built-in photographs.
pub const BUILT_IN_PHOTOS: &str = "built-in";

/// The name of the generated streets.
pub const STREET: &str = "street";

/// A block of the camera, by name. The order is that of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BlockName {
    /// The free numbers of the lens.
    Optics,
    /// Exposure time and gain of the sensor.
    Exposure,
    /// The parameters of the hardware ISP.
    Isp,
    /// The weights of the network.
    Network,
}

impl BlockName {
    /// Every block.
    pub const ALL: [Self; 4] = [Self::Optics, Self::Exposure, Self::Isp, Self::Network];

    /// Whether the PSFs of the camera change when the block moves.
    pub fn moves_psfs(self) -> bool {
        self == Self::Optics
    }

    /// The name in experiments, events and checkpoints.
    pub fn name(self) -> &'static str {
        match self {
            Self::Optics => "optics",
            Self::Exposure => "exposure",
            Self::Isp => "isp",
            Self::Network => "network",
        }
    }
}

/// Where the PSFs of an experiment come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PsfsBy {
    /// Rays.
    #[default]
    Geometric,
    /// Waves.
    Diffraction,
    /// A file: PSFs that were measured or made elsewhere, and stay as they are.
    File,
}

impl PsfsBy {
    /// How lenses are traced. PSFs in a file are those of real light, and waves stand beside them.
    pub fn traced(self) -> PsfKind {
        match self {
            Self::Geometric => PsfKind::Geometric,
            Self::Diffraction | Self::File => PsfKind::Diffraction,
        }
    }
}

impl From<PsfKind> for PsfsBy {
    fn from(kind: PsfKind) -> Self {
        match kind {
            PsfKind::Geometric => Self::Geometric,
            PsfKind::Diffraction => Self::Diffraction,
        }
    }
}

/// How a block finds its step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StepMethod {
    /// Down the gradient of the loss, by Adam. The two settings of the exposure have it by differences.
    #[default]
    Gradient,
    /// Without a gradient, by a generation of CMA-ES: of the hardware ISP as a black box in whole numbers, or of the lens.
    Evolution,
    /// By the curvature of the loss as lifted to the rays, after Levenberg and Marquardt: of the lens.
    Levenberg,
    /// Down the gradient of a network that imitates the hardware ISP as a black box, and learns on while the parameters move.
    Proxy,
    /// At random, so that a network learns to work behind many lenses or at many exposures: each step draws the numbers anew around those at
    /// the start of the stage, with which the stage ends again. The learning rate is the share of the way to the bounds that a draw may go.
    Random,
}

/// What the detector of a camera sees, in training and in scores.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DetectorInput {
    /// The finished pictures of the camera.
    #[default]
    Picture,
    /// The scenes without blur and noise: seen through the chief rays of the lens, and developed by the ISP with its values of the start.
    Truth,
}

/// Whether a lens that moves for the task keeps its field of view, and so its focal length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FieldOfView {
    /// That of the lens from which it starts, as far as `constraints.distortion_tolerance` allows.
    #[default]
    Held,
    /// It takes the one that is best for the task.
    Free,
}

/// What a lens is improved for without pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LensGoal {
    /// The RMS spot, whatever the rest of the camera is.
    Spot,
    /// The error of the best linear restoration of raw frames.
    Restored,
}

impl LensGoal {
    /// Every goal.
    pub const ALL: [Self; 2] = [Self::Spot, Self::Restored];

    /// The block of its events.
    pub fn event(self) -> &'static str {
        match self {
            Self::Spot => "spot",
            Self::Restored => "restored",
        }
    }

    /// What a camera has that was made for it.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Spot => "least spots",
            Self::Restored => "least error after restoration",
        }
    }
}
