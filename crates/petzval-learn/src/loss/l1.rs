//! Mean absolute difference.

use burn::prelude::*;

use super::{LossError, same_shape};

/// `mean |image - target|` over batch, channels, rows and columns.
///
/// Both have the shape `[batch, 3, height, width]`. The gradient with respect to a value is `sign(image - target) / n`, and
/// 0 where the two are equal. Returns one value.
pub fn l1(image: Tensor<4>, target: Tensor<4>) -> Result<Tensor<1>, LossError> {
    same_shape(image.dims(), target.dims())?;
    // Average rows first: the framework adds one long sum in an order that depends on its threads.
    Ok((image - target).abs().mean_dim(3).mean())
}
