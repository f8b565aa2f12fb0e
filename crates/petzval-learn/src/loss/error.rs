//! What can be wrong with a loss.

/// A loss that cannot be built or computed, and what to do about it.
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
        /// What was found.
        found: String,
        /// What is needed.
        expected: String,
    },
    /// The picture is smaller than the network's reach.
    #[error(
        "picture of {height} x {width} pixels; LPIPS with AlexNet needs at least {least} x {least}: use a larger crop"
    )]
    TooSmall {
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
        /// Least side, pixels.
        least: usize,
    },
    /// The pictures compared do not have one shape, or not three channels.
    #[error(
        "picture of shape {image:?} against {target:?}; both must be [batch, 3, height, width] of one size"
    )]
    ShapeMismatch {
        /// Shape of the judged picture.
        image: [usize; 4],
        /// Shape of the reference.
        target: [usize; 4],
    },
    /// A weight of the composite loss is negative or not a number.
    #[error("{name} is {value}; a loss weight must be finite and not negative")]
    BadLossWeight {
        /// `l1_weight` or `lpips_weight`.
        name: &'static str,
        /// The value.
        value: f32,
    },
    /// The loss values could not be read back from the device.
    #[error("the loss could not be read back from the device: {0}")]
    ReadBack(String),
}
