//! Losses: the distance between a picture and the photograph that it shows, or between the classes of pixels and their labels.
//!
//! [`l1`] and [`l2`] compare pixel values, [`ssim`] the structure of small windows, [`Lpips`] features as a viewer perceives them;
//! [`ImageLoss`] adds them up. [`cross_entropy`] is the loss of a segmentation.

mod cross_entropy;
mod difference;
mod error;
pub(crate) mod image_loss;
mod lpips;
mod named;
mod ssim;

pub use cross_entropy::{IGNORED, cross_entropy, label_weight};
pub use difference::{l1, l2};
pub use error::LossError;
pub use image_loss::{ImageLoss, ImageLossParts, ImageTarget, LossPart};
pub use lpips::{LEAST_SIDE, Lpips, LpipsTarget};
pub use named::NamedLoss;
pub use ssim::ssim;

/// Checks that two pictures have the same shape, at least one pixel, and three channels.
fn same_shape(image: [usize; 4], target: [usize; 4]) -> Result<(), LossError> {
    if image != target || image[1] != 3 || image.contains(&0) {
        return Err(LossError::ShapeMismatch { image, target });
    }
    Ok(())
}
