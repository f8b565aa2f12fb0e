//! Pictures of another size.

use burn::prelude::*;
use burn::tensor::module::interpolate;
use burn::tensor::ops::{InterpolateMode, InterpolateOptions};

/// Planes `[batch, channels, height, width]` scaled to `sides`, rows and columns, by bilinear interpolation between the middles of pixels.
pub fn resized(planes: Tensor<4>, sides: [usize; 2]) -> Tensor<4> {
    let options =
        InterpolateOptions::new(InterpolateMode::Bilinear).with_align_corners(false).with_output_size(sides);
    interpolate(planes, options)
}
