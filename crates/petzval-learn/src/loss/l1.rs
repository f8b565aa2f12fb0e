//! Mean absolute difference.

use burn::prelude::*;

use super::{LossError, same_shape};

/// `mean |image - target|` over batch, channels, rows and columns.
///
/// Both of shape `[batch, 3, height, width]`. The gradient with respect to a pixel is `sign(image - target) / n`, 0 where
/// they are equal. Returns one value.
pub fn l1(image: Tensor<4>, target: Tensor<4>) -> Result<Tensor<1>, LossError> {
    same_shape(image.dims(), target.dims())?;
    // Average rows first: the framework splits one long sum among threads in no fixed order.
    Ok((image - target).abs().mean_dim(3).mean())
}
