//! Losses: the distance between a picture and the photograph that it shows.
//!
//! [`l1`] compares pixel values, [`Lpips`] compares features as a viewer perceives them, [`ImageLoss`] adds the two.

mod error;
pub(crate) mod image_loss;
mod l1;
mod lpips;
mod named;

pub use error::LossError;
pub use image_loss::{ImageLoss, ImageLossParts, ImageTarget};
pub use l1::l1;
pub use lpips::{LEAST_SIDE, Lpips, LpipsTarget};
pub use named::NamedLoss;

/// Checks that two pictures have the same shape, at least one pixel, and three channels.
fn same_shape(image: [usize; 4], target: [usize; 4]) -> Result<(), LossError> {
    if image != target || image[1] != 3 || image.contains(&0) {
        return Err(LossError::ShapeMismatch { image, target });
    }
    Ok(())
}
