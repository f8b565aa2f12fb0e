//! A small U-Net that finishes a developed picture: a software image signal processor (ISP).

use burn::{
    module::{Module, Param},
    prelude::*,
};
use serde::{Deserialize, Serialize};

use super::{
    NetworkError, NetworkInput, PictureNetwork, Reach, pointwise,
    trunk::{Trunk, crop, extend},
    weights::{Initializer, check_sizes},
};

/// Size of a [`UNet`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UNetConfig {
    /// Channels at full resolution, 1..=256. They double with each level. Multiples of 8 are the most efficient.
    pub base_channels: usize,
    /// Number of times that the picture is halved, 1..=6.
    pub levels: usize,
    /// Channels of the input, `out_channels`..=256. Additional channels may carry other inputs, such as the position in the
    /// field.
    pub in_channels: usize,
    /// Channels of the output, 1..=64.
    pub out_channels: usize,
}

impl Default for UNetConfig {
    /// 16 channels, 3 levels, RGB to RGB.
    fn default() -> Self {
        Self { base_channels: 16, levels: 3, in_channels: 3, out_channels: 3 }
    }
}

impl UNetConfig {
    /// Builds the network on `device`, with weights drawn from `seed` alone. Fails on a size that is out of range.
    ///
    /// The last layer starts at 0, so the output starts equal to the input. The numbers under which an optimiser stores its
    /// state also derive from the seed: two networks that share an optimiser need two seeds.
    pub fn init(&self, seed: u64, device: &Device) -> Result<UNet, NetworkError> {
        check_sizes(&[
            ("base_channels", self.base_channels, 1..=256, "1 to 256"),
            ("levels", self.levels, 1..=6, "1 to 6"),
            ("out_channels", self.out_channels, 1..=64, "1 to 64"),
            ("in_channels", self.in_channels, self.out_channels..=256, "out_channels to 256"),
        ])?;
        let mut initializer = Initializer::new(seed, device);
        Ok(UNet {
            trunk: Trunk::new(self.in_channels, self.base_channels, self.levels, &mut initializer),
            last_weight: initializer.zeros([self.out_channels, self.base_channels]),
            last_bias: initializer.zeros([self.out_channels]),
        })
    }
}

/// `output = input + U(input)`, where U is a U-Net of 3x3 convolutions and leaky rectifiers of slope 0.2.
///
/// The last layer has one weight per pair of channels, which starts at 0.
///
/// Source: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015; the residual form is common in restoration.
#[derive(Module, Debug)]
pub struct UNet {
    trunk: Trunk,
    last_weight: Param<Tensor<2>>,
    last_bias: Param<Tensor<1>>,
}

impl UNet {
    /// Finishes pictures `[batch, in_channels, height, width]`, sRGB-encoded, about 0..1; any height and width.
    ///
    /// Returns `[batch, out_channels, height, width]`, not clamped. A size that is not a multiple of `2^levels` is extended at
    /// the right and bottom by repeating the border, and cropped at the end.
    ///
    /// # Panics
    /// Panics if the picture does not have `in_channels` channels.
    pub fn forward(&self, picture: Tensor<4>) -> Tensor<4> {
        let [batch, _, height, width] = picture.dims();
        let x = self.trunk.forward(extend(picture.clone(), self.trunk.unit()), |_, x| x);

        // Mix the channels of each pixel into the correction.
        let correction = pointwise(x, self.last_weight.val(), self.last_bias.val());
        let [out_channels] = self.last_bias.dims();
        picture.slice([0..batch, 0..out_channels]) + crop(correction, [height, width])
    }

    /// How far it looks.
    pub fn reach(&self) -> Reach {
        self.trunk.reach()
    }
}

impl PictureNetwork for UNet {
    fn finish(&self, input: &NetworkInput) -> Tensor<4> {
        self.forward(input.picture())
    }

    fn reach(&self) -> Option<Reach> {
        Some(self.reach())
    }
}
