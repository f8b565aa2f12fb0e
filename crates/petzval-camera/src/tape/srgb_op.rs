//! The sRGB transfer curve as operations of the tensor framework.

use burn::prelude::*;

use crate::image::SRGB_TOE;

/// [`srgb_encode`](crate::image::srgb_encode) of every value.
pub fn srgb_encode_op<const D: usize>(linear: Tensor<D>) -> Tensor<D> {
    let toe = linear.clone() * 12.92;
    // The clamp keeps values below the toe, whose power has no slope at zero, out of the gradient.
    let curve = linear.clone().clamp_min(SRGB_TOE).powf_scalar(1.0 / 2.4) * 1.055 - 0.055;
    curve.mask_where(linear.lower_equal_elem(SRGB_TOE), toe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::srgb_encode;

    #[test]
    fn the_operation_is_the_curve_of_the_host() {
        let linear: Vec<f32> = (-200..=1300).map(|i| i as f32 * 1e-3).collect();
        let device = Device::flex();
        let tensor = Tensor::<1>::from_data(TensorData::new(linear.clone(), [linear.len()]), &device);
        let encoded = srgb_encode_op(tensor).into_data().try_to_vec::<f32>().unwrap();
        for (l, e) in linear.iter().zip(encoded) {
            assert!((e - srgb_encode(*l)).abs() < 1e-6, "{l}: {e}");
        }
    }
}
