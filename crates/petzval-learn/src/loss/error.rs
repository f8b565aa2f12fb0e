//! Errors of a loss.

use petzval_base::Cancelled;

/// Why a loss cannot be built or computed. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum LossError {
    /// The weight file is not a safetensors file.
    #[error("LPIPS weights: not a readable safetensors file; pass the bytes of lpips_alex_f16.safetensors")]
    BadFile(#[from] safetensors::SafeTensorError),
    /// A weight is missing, or has the wrong shape or number type.
    #[error(
        "LPIPS weights: {name} is {found}, expected {expected}; pass the bytes of lpips_alex_f16.safetensors"
    )]
    BadWeight {
        /// Name of the tensor.
        name: &'static str,
        /// Shape or number type in the file.
        found: String,
        /// Shape and number types that are needed.
        expected: String,
    },
    /// The picture is too small for the layers of the network.
    #[error(
        "picture of {width} x {height} pixels; LPIPS with AlexNet needs at least {least} x {least}: use a larger crop"
    )]
    TooSmall {
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
        /// Least side, pixels.
        least: usize,
    },
    /// The picture is too small for the window of SSIM.
    #[error("picture of {width} x {height} pixels; SSIM needs at least {least} x {least}: use a larger crop")]
    SmallerThanWindow {
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
        /// Side of the window, pixels.
        least: usize,
    },
    /// The two pictures differ in shape, or do not have three channels.
    #[error(
        "picture of shape {image:?} against {target:?}; both must be [batch, 3, height, width] of one size"
    )]
    ShapeMismatch {
        /// Shape of the scored picture.
        image: [usize; 4],
        /// Shape of the reference.
        target: [usize; 4],
    },
    /// There are more or fewer labels than pixels.
    #[error("{labels} labels for {pixels} pixels; every pixel needs one, 255 where it is ignored")]
    LabelCount {
        /// Labels.
        labels: usize,
        /// Pixels of the batch.
        pixels: usize,
    },
    /// There are more or fewer weights than classes.
    #[error("{weights} weights for {classes} classes")]
    WeightCount {
        /// Weights.
        weights: usize,
        /// Classes.
        classes: usize,
    },
    /// A label is the number of no class.
    #[error("label {label} where there are {classes} classes; labels are 0 to {}, or 255 where a pixel is ignored", classes.saturating_sub(1))]
    NoClass {
        /// The label.
        label: u8,
        /// Number of classes.
        classes: usize,
    },
    /// A weight of the composite loss is negative or not a number.
    #[error("{name} is {value}; a loss weight must be finite and not negative")]
    BadLossWeight {
        /// Name of the weight, such as `l1_weight`.
        name: &'static str,
        /// The value.
        value: f32,
    },
    /// A network gave what is no number.
    #[error("{0} are no numbers; the weights or the picture are damaged, or the training went astray")]
    NotANumber(&'static str),
    /// The job was cancelled between two layers of the network.
    #[error(transparent)]
    Stopped(#[from] Cancelled),
    /// The loss values could not be read back from the device.
    #[error("the loss could not be read back from the device: {0}")]
    ReadBack(String),
}
