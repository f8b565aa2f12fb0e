//! How far a picture is from the photograph it shows.
//!
//! [`l1`] measures pixels, [`Lpips`] measures what a viewer would notice, [`ImageLoss`] mixes the two.

mod error;
pub(crate) mod image_loss;
mod l1;
mod lpips;

pub use error::LossError;
pub use image_loss::{ImageLoss, ImageLossParts, ImageTarget};
pub use l1::l1;
pub use lpips::{LEAST_SIDE, Lpips, LpipsTarget};

/// Refuses pictures of different shapes, of no pixels, or without three channels.
fn same_shape(image: [usize; 4], target: [usize; 4]) -> Result<(), LossError> {
    if image != target || image[1] != 3 || image.contains(&0) {
        return Err(LossError::ShapeMismatch { image, target });
    }
    Ok(())
}
