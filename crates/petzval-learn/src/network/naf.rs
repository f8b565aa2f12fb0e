//! A restoration network without activation functions.

use burn::{
    module::{Module, Param},
    prelude::*,
};
use serde::{Deserialize, Serialize};

use super::{
    NetworkError, Reach, conv_leaky, depthwise, gated_pointwise, normalized_pointwise, pointwise,
    trunk::{crop, double, extend},
    weights::{Initializer, check_sizes},
};

/// Size of a [`Naf`] network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NafConfig {
    /// Channels of the input, 1..=256: the picture, and further planes such as the position in the field.
    pub in_channels: usize,
    /// Channels of the output, 1..=64.
    pub out_channels: usize,
    /// Channels at full resolution, 1..=256. They double with each level. Multiples of 8 are the most efficient.
    pub base_channels: usize,
    /// Number of times that the picture is halved, 1..=6.
    pub levels: usize,
    /// Blocks at every resolution on the way down, at the lowest resolution, and on the way up, 1..=16.
    pub blocks: usize,
}

impl Default for NafConfig {
    /// 8 planes to RGB; 16 channels, 3 levels, one block.
    fn default() -> Self {
        Self { in_channels: 8, out_channels: 3, base_channels: 16, levels: 3, blocks: 1 }
    }
}

impl NafConfig {
    /// Builds the network on `device`, with weights drawn from `seed` alone. Fails on a size that is out of range.
    ///
    /// The last layer starts at 0, so the output starts at 0. The numbers under which an optimiser stores its state also
    /// derive from the seed: two networks that share an optimiser need two seeds.
    pub fn init(&self, seed: u64, device: &Device) -> Result<Naf, NetworkError> {
        check_sizes(&[
            ("in_channels", self.in_channels, 1..=256, "1 to 256"),
            ("out_channels", self.out_channels, 1..=64, "1 to 64"),
            ("base_channels", self.base_channels, 1..=256, "1 to 256"),
            ("levels", self.levels, 1..=6, "1 to 6"),
            ("blocks", self.blocks, 1..=16, "1 to 16"),
        ])?;
        let mut draw = Initializer::new(seed, device);
        let channels = |level: usize| self.base_channels << level;
        let blocks = |level: usize, draw: &mut Initializer| -> Vec<Block> {
            (0..self.blocks).map(|_| Block::new(channels(level), draw)).collect()
        };

        let first = Conv::new(self.in_channels, channels(0), &mut draw);
        let encoder = (0..self.levels)
            .map(|level| Down {
                blocks: blocks(level, &mut draw),
                halve: Conv::new(channels(level), channels(level + 1), &mut draw),
            })
            .collect();
        let bottom = blocks(self.levels, &mut draw);
        let decoder = (0..self.levels)
            .rev()
            .map(|level| Up {
                narrow: Mix::new(channels(level + 1), channels(level), &mut draw),
                blocks: blocks(level, &mut draw),
            })
            .collect();
        let last = Conv {
            weight: draw.zeros([self.out_channels, channels(0), 3, 3]),
            bias: draw.zeros([self.out_channels]),
        };
        Ok(Naf { first, encoder, bottom, decoder, last })
    }
}

/// A 3x3 convolution.
#[derive(Module, Debug)]
struct Conv {
    weight: Param<Tensor<4>>,
    bias: Param<Tensor<1>>,
}

impl Conv {
    /// Normal weights of standard deviation `1 / sqrt(9 inputs)`, which keep the variance; zero bias.
    fn new(inputs: usize, outputs: usize, draw: &mut Initializer) -> Self {
        let deviation = (9.0 * inputs as f32).sqrt().recip();
        Self { weight: draw.normal([outputs, inputs, 3, 3], deviation), bias: draw.zeros([outputs]) }
    }

    /// A step of 2 halves the picture.
    fn forward(&self, x: Tensor<4>, step: usize) -> Tensor<4> {
        conv_leaky(x, self.weight.val(), self.bias.val(), step, 1.0)
    }
}

/// Weights and bias of a 1x1 convolution.
#[derive(Module, Debug)]
struct Mix {
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

impl Mix {
    /// Normal weights of standard deviation `1 / sqrt(inputs)`; zero bias.
    fn new(inputs: usize, outputs: usize, draw: &mut Initializer) -> Self {
        let deviation = (inputs as f32).sqrt().recip();
        Self { weight: draw.normal([outputs, inputs], deviation), bias: draw.zeros([outputs]) }
    }

    /// Weight and bias times a factor per output.
    fn scaled(&self, scale: &Param<Tensor<1>>) -> (Tensor<2>, Tensor<1>) {
        (self.weight.val() * scale.val().unsqueeze_dim::<2>(1), self.bias.val() * scale.val())
    }
}

/// Two residual halves: `y = x + s1 B(gate(D(A(norm(x)))))`, then `y + s2 F(gate(E(norm(y))))`.
///
/// A, B, E and F are 1x1 convolutions, A and E to twice the channels. D is a 3x3 convolution of each channel. The gate multiplies the two
/// halves of the channels. s1 and s2 are factors per channel that start at 0.
#[derive(Module, Debug)]
struct Block {
    widen: Mix,
    spatial_weight: Param<Tensor<3>>,
    spatial_bias: Param<Tensor<1>>,
    join: Mix,
    join_scale: Param<Tensor<1>>,
    expand: Mix,
    reduce: Mix,
    reduce_scale: Param<Tensor<1>>,
}

impl Block {
    fn new(channels: usize, draw: &mut Initializer) -> Self {
        Self {
            widen: Mix::new(channels, 2 * channels, draw),
            spatial_weight: draw.normal([2 * channels, 3, 3], 1.0 / 3.0),
            spatial_bias: draw.zeros([2 * channels]),
            join: Mix::new(channels, channels, draw),
            join_scale: draw.zeros([channels]),
            expand: Mix::new(channels, 2 * channels, draw),
            reduce: Mix::new(channels, channels, draw),
            reduce_scale: draw.zeros([channels]),
        }
    }

    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        // Mix neighbouring pixels.
        let wide = normalized_pointwise(x.clone(), self.widen.weight.val(), self.widen.bias.val());
        let wide = depthwise(wide, self.spatial_weight.val(), self.spatial_bias.val());
        let (weight, bias) = self.join.scaled(&self.join_scale);
        let y = x + gated_pointwise(wide, weight, bias);

        // Mix the channels of every pixel.
        let wide = normalized_pointwise(y.clone(), self.expand.weight.val(), self.expand.bias.val());
        let (weight, bias) = self.reduce.scaled(&self.reduce_scale);
        y + gated_pointwise(wide, weight, bias)
    }
}

/// Blocks, then half the resolution with twice the channels.
#[derive(Module, Debug)]
struct Down {
    blocks: Vec<Block>,
    halve: Conv,
}

/// Half the channels at twice the resolution, then blocks.
#[derive(Module, Debug)]
struct Up {
    narrow: Mix,
    blocks: Vec<Block>,
}

/// A U-shaped network of blocks whose only non-linearity is a product of channels.
///
/// Source: L. Chen, X. Chu, X. Zhang, J. Sun, "Simple Baselines for Image Restoration", ECCV 2022. Differences: a strided
/// 3x3 convolution halves the picture; a 1x1 convolution and repeated pixels double it; the scale and shift of the
/// normalisation are part of the 1x1 convolution behind it; and there is no channel attention. The attention weighs channels
/// by their mean over the whole picture. With it, a tile would be restored otherwise than the frame that holds it. The mean
/// over a window that moves along avoids that, but widens the overlap of the tiles by half the window per block.
///
/// A pixel depends only on the pixels within [`reach`](Self::reach). A frame may therefore be restored in
/// [tiles](super::in_tiles).
///
/// Measured, CPU time, batch 4, 8 planes of 96 x 96, forward and backward: 83 ms in the default size, 165 ms with 24 channels. A U-Net with
/// as many channels and levels has more weights and takes 106 ms.
#[derive(Module, Debug)]
pub struct Naf {
    first: Conv,
    encoder: Vec<Down>,
    bottom: Vec<Block>,
    decoder: Vec<Up>,
    last: Conv,
}

impl Naf {
    /// `[batch, in_channels, height, width]` to `[batch, out_channels, height, width]`; any height and width.
    ///
    /// The caller adds the result to the picture. A size that is not a multiple of the unit of its [`reach`](Self::reach) is extended at the
    /// right and bottom by repeating the border, and cropped at the end.
    ///
    /// # Panics
    /// Panics if the picture does not have `in_channels` channels.
    pub fn forward(&self, picture: Tensor<4>) -> Tensor<4> {
        let [_, _, height, width] = picture.dims();
        let run = |blocks: &[Block], x: Tensor<4>| blocks.iter().fold(x, |x, block| block.forward(x));
        let mut x = self.first.forward(extend(picture, self.unit()), 1);

        // Halve the picture level by level, and keep each resolution for the way up.
        let mut skips = Vec::with_capacity(self.encoder.len());
        for down in &self.encoder {
            let kept = run(&down.blocks, x);
            x = down.halve.forward(kept.clone(), 2);
            skips.push(kept);
        }
        x = run(&self.bottom, x);

        // Double the picture level by level, and add the kept resolution.
        for (up, kept) in self.decoder.iter().zip(skips.into_iter().rev()) {
            let narrow = pointwise(x, up.narrow.weight.val(), up.narrow.bias.val());
            x = run(&up.blocks, double(narrow) + kept);
        }
        crop(self.last.forward(x, 1), [height, width])
    }

    /// Pixels that one pixel of the lowest resolution covers in each direction.
    fn unit(&self) -> usize {
        1 << self.encoder.len()
    }

    /// How far it looks.
    pub fn reach(&self) -> Reach {
        // Each 3x3 convolution reaches one pixel of its resolution. Repeated pixels take their value from up to one pixel
        // of the doubled resolution away.
        let way = |level: usize| (2 * self.bottom.len() + 2) << level;
        let levels = (0..self.encoder.len()).map(way).sum::<usize>();
        Reach { pixels: 2 + levels + self.bottom.len() * self.unit(), unit: self.unit() }
    }
}
