//! A U-Net that gives every pixel of a picture a class.

use burn::{
    module::{Module, Param},
    prelude::*,
};
use petzval_camera::image::CHANNELS;

use super::{
    NetworkError, Reach, TILE, in_tiles_of, pointwise,
    trunk::{Trunk, crop, extend},
    weights::{Initializer, check_sizes},
};

/// The middle of the values of a picture: the network sees their distance from it.
const MIDDLE: f32 = 0.5;

/// Logits of classes, `W U(picture - 0.5) + b`, where U is the [U-Net](super::UNet) without its sum with the input, and W one weight for each
/// pair of its channels and a class. W and b start at 0: at first all classes are equally probable.
///
/// Source: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015.
#[derive(Module, Debug)]
pub struct Segmenter {
    trunk: Trunk,
    last_weight: Param<Tensor<2>>,
    last_bias: Param<Tensor<1>>,
}

impl Segmenter {
    /// Most classes.
    pub const MOST_CLASSES: usize = 64;

    /// A network for 1..=64 classes on `device`, with weights drawn from `seed` alone. `base_channels`: channels at full resolution, 1..=256.
    /// `levels`: how often the picture is halved, 1..=6. Fails on a size that is out of range.
    pub fn init(
        classes: usize,
        base_channels: usize,
        levels: usize,
        seed: u64,
        device: &Device,
    ) -> Result<Self, NetworkError> {
        check_sizes(&[
            ("classes", classes, 1..=Self::MOST_CLASSES, "1 to 64"),
            ("base_channels", base_channels, 1..=256, "1 to 256"),
            ("levels", levels, 1..=6, "1 to 6"),
        ])?;
        let mut initializer = Initializer::new(seed, device);
        Ok(Self {
            trunk: Trunk::new(CHANNELS, base_channels, levels, &mut initializer),
            last_weight: initializer.zeros([classes, base_channels]),
            last_bias: initializer.zeros([classes]),
        })
    }

    /// Number of classes.
    pub fn classes(&self) -> usize {
        self.last_bias.dims()[0]
    }

    /// Logits `[batch, classes, height, width]` of pictures `[batch, 3, height, width]`, sRGB-encoded, 0..1; any height and width.
    pub fn forward(&self, pictures: Tensor<4>) -> Tensor<4> {
        let [_, _, height, width] = pictures.dims();
        let x = self.trunk.forward(extend(pictures - MIDDLE, self.trunk.unit()), |_, x| x);
        crop(pointwise(x, self.last_weight.val(), self.last_bias.val()), [height, width])
    }

    /// The same, made in tiles where a picture has more than [`TILE`] pixels a side.
    pub fn forward_in_tiles(&self, pictures: Tensor<4>) -> Tensor<4> {
        in_tiles_of(pictures, TILE, self.reach(), |tile| self.forward(tile))
    }

    /// How far it looks.
    pub fn reach(&self) -> Reach {
        self.trunk.reach()
    }
}
