//! What a camera took: every carrier between the stages.

use burn::prelude::*;

/// A batch of frames after each stage of the camera, in the order of the light.
#[derive(Clone)]
pub struct Frames {
    /// Light on the pixels, `[batch, 3, height, width]`, 1 = white on the axis.
    pub irradiance: Tensor<4>,
    /// Relative illumination of the pixels that the development corrects for, of the same shape, 1 on the axis.
    pub illumination: Tensor<4>,
    /// Digital numbers of the mosaic, `[batch, 1, height, width]`.
    pub raw: Tensor<4>,
    /// Developed pictures `[batch, 3, height, width]`: linear light, 1 = white.
    pub developed: Tensor<4>,
    /// The same without the blur of the lens, as far as their noise allows; none where the camera does not restore.
    pub restored: Option<Tensor<4>>,
    /// Finished pictures of the same shape, sRGB-encoded, about 0..1: what the network makes of them, or, without a
    /// network, the restored or developed ones encoded.
    pub finished: Tensor<4>,
}
