//! Mean differences of pixel values.

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

/// `mean (image - target)^2` over batch, channels, rows and columns: the error that PSNR is the logarithm of.
///
/// Both have the shape `[batch, 3, height, width]`. Returns one value.
pub fn l2(image: Tensor<4>, target: Tensor<4>) -> Result<Tensor<1>, LossError> {
    same_shape(image.dims(), target.dims())?;
    Ok((image - target).square().mean_dim(3).mean())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_two_pictures_of_known_difference() {
        let device = Device::flex();
        // Half of the pixels differ by 0.5, the others by 0.1.
        let target = Tensor::<4>::zeros([2, 3, 4, 4], &device);
        let half = Tensor::<4>::zeros([2, 3, 4, 2], &device);
        let image = Tensor::cat(vec![half.clone() + 0.5, half - 0.1], 3);
        let l1: f32 = l1(image.clone(), target.clone()).unwrap().into_scalar();
        let l2: f32 = l2(image.clone(), target).unwrap().into_scalar();
        assert!((l1 - 0.3).abs() < 1e-6 && (l2 - 0.13).abs() < 1e-6, "{l1} {l2}");
        assert!(super::l2(image, Tensor::zeros([2, 3, 4, 3], &device)).is_err());
    }
}
