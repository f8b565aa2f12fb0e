//! Scores in the form in which results are published.

use burn::prelude::*;

use crate::loss::{LossError, Lpips, image_loss::read_values};

/// `1 - LPIPS` (AlexNet, v0.1) of each picture of the batch. A perfect picture has 1.
///
/// Shapes `[batch, 3, height, width]`, sRGB-encoded. `image` is first clamped to 0..1, the range of a picture file.
pub fn one_minus_lpips(lpips: &Lpips, image: Tensor<4>, reference: Tensor<4>) -> Result<Vec<f32>, LossError> {
    let image = image.detach().clamp(0.0, 1.0);
    let target = lpips.target(reference)?;
    let distances = read_values(lpips.distance_to(image, &target)?)?;
    Ok(distances.iter().map(|d| 1.0 - d).collect())
}
