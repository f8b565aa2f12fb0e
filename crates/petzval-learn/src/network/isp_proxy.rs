//! A network that imitates an image signal processor (ISP) that cannot be differentiated.

use burn::{
    module::{Module, Param},
    prelude::*,
    tensor::{
        activation::leaky_relu,
        module::{adaptive_avg_pool2d, interpolate},
        ops::{InterpolateMode, InterpolateOptions},
    },
};
use serde::{Deserialize, Serialize};

use super::{
    NetworkError,
    leaky_conv::{LeakyConv, SLOPE},
    trunk::{Trunk, crop, double, extend, shuffle},
    weights::{self, Initializer, check_sizes},
};
use crate::weight_file::weights_file;

/// Colours of the mosaic: red, green in the red row, green in the blue row, blue.
const MOSAIC: usize = 4;

/// Rows and columns of the thumbnail.
const THUMBNAIL: usize = 16;

/// Colours of the picture, and values that a cell of the mosaic has in it.
const COLOURS: usize = 3;
const OUT: usize = COLOURS * 4;

/// Slope of the output beyond 0 and 1, where the ISP clips.
const LEAK: f32 = 0.02;

/// Added to the raw value before the square root, so that its slope stays finite at black.
const BLACK: f32 = 1e-4;

/// Size of an [`IspProxy`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IspProxyConfig {
    /// Parameters of the ISP, 1..=256.
    pub parameters: usize,
    /// Channels at the resolution of one colour of the mosaic, 1..=256. They double with each level. Multiples of 8 are the
    /// most efficient.
    pub base_channels: usize,
    /// Number of times that the picture is halved, 1..=6.
    pub levels: usize,
    /// Channels of the thumbnail, 1..=64.
    pub thumbnail_channels: usize,
    /// Width of the two layers of the dense network that turns parameters into modulations, 1..=1024.
    pub hidden: usize,
}

impl Default for IspProxyConfig {
    /// 16 parameters; 16 channels, 3 levels: small enough to be trained on two cores.
    fn default() -> Self {
        Self { parameters: 16, base_channels: 16, levels: 3, thumbnail_channels: 8, hidden: 128 }
    }
}

impl IspProxyConfig {
    /// Builds the network on `device`, with weights drawn from `seed` alone. Fails on a size that is out of range.
    ///
    /// The network starts as the square root of the raw with every colour repeated, whatever the parameters. The numbers
    /// under which an optimiser stores its state also derive from the seed: two networks that share an optimiser need two
    /// seeds.
    pub fn init(&self, seed: u64, device: &Device) -> Result<IspProxy, NetworkError> {
        check_sizes(&[
            ("parameters", self.parameters, 1..=256, "1 to 256"),
            ("base_channels", self.base_channels, 1..=256, "1 to 256"),
            ("levels", self.levels, 1..=6, "1 to 6"),
            ("thumbnail_channels", self.thumbnail_channels, 1..=64, "1 to 64"),
            ("hidden", self.hidden, 1..=1024, "1 to 1024"),
        ])?;
        let mut draw = Initializer::new(seed, device);
        let (base, small) = (self.base_channels, self.thumbnail_channels);
        // The thumbnail is modulated once, then every pair of the trunk.
        let mut widths = vec![small];
        widths.extend(Trunk::widths(base, self.levels));
        let modulations = 2 * widths.iter().sum::<usize>();
        let last = COLOURS * (COLOURS + 1) + OUT * (base + COLOURS);
        Ok(IspProxy {
            hidden_weight: draw
                .normal([self.parameters, self.hidden], (self.parameters as f32).sqrt().recip()),
            hidden_bias: draw.normal([self.hidden], 0.5),
            second_weight: draw.normal([self.hidden; 2], (self.hidden as f32).sqrt().recip()),
            second_bias: draw.zeros([self.hidden]),
            modulation_weight: draw.zeros([self.parameters + self.hidden, modulations]),
            modulation_bias: draw.zeros([modulations]),
            thumbnail: vec![
                LeakyConv::new(MOSAIC + COLOURS, small, &mut draw),
                LeakyConv::new(small, small, &mut draw),
                LeakyConv::new(small, small, &mut draw),
            ],
            trunk: Trunk::new(MOSAIC + COLOURS + small, base, self.levels, &mut draw),
            last_weight: draw.zeros([self.parameters + self.hidden, last]),
            last_bias: draw.zeros([last]),
            widths,
        })
    }
}

/// The picture that an ISP develops from a raw mosaic, as a differentiable function of the mosaic and the parameters.
///
/// ```text
/// encode(light) = sqrt(max(light, 0) + 1e-4) - 0.01
/// encoded = encode(raw)
/// light   = red, mean of the greens, and blue of raw
/// colours = encode(A light + b)
/// far     = the thumbnail of encoded and colours, 16 x 16 means of the whole mosaic, through three convolutions, enlarged
/// rgb     = clip(colours, repeated 2 x 2, + shuffle(M (U(encoded, colours, far), colours)))
/// ```
///
/// The square root spreads the dark values. Local tone mapping looks far across the picture, which the thumbnail covers. Each
/// pair of convolutions of the U-Net `U`, and the thumbnail, is modulated by the parameters: `x (1 + scale) + shift` per
/// channel, where a dense network with two hidden layers, and the parameters themselves, give all scales and shifts; they start at 0. It also gives `A`, `b` and
/// `M`, by which parameters mix and amplify colours; they start as 1, 0 and 0. `shuffle` places 4 channels per colour on 2 x 2 pixels. `clip` leaves a slope of 0.02 beyond 0 and 1,
/// so that the network may say how far beyond its range the ISP would be, and a gradient remains.
///
/// Sources: E. Perez et al., "FiLM: Visual Reasoning with a General Conditioning Layer", AAAI 2018, for the modulation; E.
/// Tseng et al., "Hyperparameter optimization in black-box image processing using differentiable proxies", ACM TOG 2019, for
/// the use.
#[derive(Module, Debug)]
pub struct IspProxy {
    hidden_weight: Param<Tensor<2>>,
    hidden_bias: Param<Tensor<1>>,
    second_weight: Param<Tensor<2>>,
    second_bias: Param<Tensor<1>>,
    modulation_weight: Param<Tensor<2>>,
    modulation_bias: Param<Tensor<1>>,
    thumbnail: Vec<LeakyConv>,
    trunk: Trunk,
    last_weight: Param<Tensor<2>>,
    last_bias: Param<Tensor<1>>,
    #[module(skip)]
    widths: Vec<usize>,
}

impl IspProxy {
    /// Develops raw mosaics with parameters.
    ///
    /// `raw`: `[batch, 4, height / 2, width / 2]`, colours red, green, green, blue of the 2x2 mosaic, linear, black 0 and
    /// white 1. `theta`: `[batch, parameters]`, each scaled to about -1..1. Returns `[batch, 3, height, width]` on the scale of the
    /// ISP's output, not clamped. Any even height and width.
    ///
    /// # Panics
    /// Panics if the number of colours or parameters is wrong, or the batches differ.
    pub fn forward(&self, raw: Tensor<4>, theta: Tensor<2>) -> Tensor<4> {
        let ([batch, colours, height, width], [items, parameters]) = (raw.dims(), theta.dims());
        let [expected, _] = self.hidden_weight.dims();
        assert_eq!([colours, items, parameters], [MOSAIC, batch, expected], "IspProxy: shape of the input");
        let encoded = encode(raw.clone());

        // Turn the parameters into a scale and a shift per channel of every block.
        let first = theta.clone().matmul(self.hidden_weight.val()) + self.hidden_bias.val().unsqueeze();
        let first = leaky_relu(first, f64::from(SLOPE));
        let second = first.clone().matmul(self.second_weight.val()) + self.second_bias.val().unsqueeze();
        let hidden = Tensor::cat(vec![theta, first + leaky_relu(second, f64::from(SLOPE))], 1);
        let modulations =
            hidden.clone().matmul(self.modulation_weight.val()) + self.modulation_bias.val().unsqueeze();
        let modulate = |block: usize, x: Tensor<4>| {
            let first = 2 * self.widths[..block].iter().sum::<usize>();
            let part = |first: usize| {
                let channels = self.widths[block];
                modulations
                    .clone()
                    .slice([0..batch, first..first + channels])
                    .reshape([batch, channels, 1, 1])
            };
            x * (part(first) + 1.0) + part(first + self.widths[block])
        };

        // Mix the colours of light as the parameters say, and encode them.
        let weights = hidden.matmul(self.last_weight.val()) + self.last_bias.val().unsqueeze();
        let features = self.last_weight.dims()[1] - COLOURS * (COLOURS + 1);
        let [by_colour, shift, by_feature] = weights
            .split_with_sizes(vec![COLOURS * COLOURS, COLOURS, features], 1)
            .try_into()
            .expect("three parts");
        let colour = |c: usize| raw.clone().slice([0..batch, c..c + 1]);
        let light = Tensor::cat(vec![colour(0), (colour(1) + colour(2)) * 0.5, colour(3)], 1);
        let mixed = light.clone() + mix(by_colour, light, COLOURS) + shift.reshape([batch, COLOURS, 1, 1]);
        let colours = encode(mixed);
        let near = Tensor::cat(vec![encoded, colours.clone()], 1);

        // Look at the whole picture through a thumbnail.
        let small = adaptive_avg_pool2d(near.clone(), [THUMBNAIL; 2]);
        let small = modulate(0, self.thumbnail[0].forward(small));
        let small = self.thumbnail[1..].iter().fold(small, |x, conv| conv.forward(x));
        let options = InterpolateOptions::new(InterpolateMode::Bilinear)
            .with_align_corners(false)
            .with_output_size([height, width]);
        let near_and_far = Tensor::cat(vec![near, interpolate(small, options)], 1);

        // Add what the network finds for each pixel of a cell of the mosaic.
        let x = extend(near_and_far, self.trunk.unit());
        let x = crop(self.trunk.forward(x, |pair, x| modulate(pair + 1, x)), [height, width]);
        let found = mix(by_feature, Tensor::cat(vec![x, colours.clone()], 1), OUT);
        leaky_clip(double(colours) + shuffle(found))
    }

    /// All weights as bytes in Burn's format, exact to the bit.
    pub fn to_bytes(&self) -> Result<Vec<u8>, NetworkError> {
        weights::to_bytes(self)
    }

    /// All weights as a safetensors file, for other programs; its names are the fields of this type and of those in it.
    pub fn to_safetensors(&self) -> Result<Vec<u8>, NetworkError> {
        weights_file(self)
    }

    /// Loads weights that [`to_bytes`](Self::to_bytes) wrote. Fails if they belong to another configuration.
    pub fn load_bytes(self, bytes: Vec<u8>) -> Result<Self, NetworkError> {
        weights::load_bytes(self, bytes)
    }
}

/// The square root of light, with a finite slope at black.
fn encode(light: Tensor<4>) -> Tensor<4> {
    (light.clamp_min(0.0) + BLACK).sqrt() - BLACK.sqrt()
}

/// At every pixel, `outputs` sums of its channels, with weights `[batch, outputs * channels]`.
fn mix(weights: Tensor<2>, x: Tensor<4>, outputs: usize) -> Tensor<4> {
    let [batch, channels, height, width] = x.dims();
    let weights = weights.reshape([batch, outputs, channels]);
    weights.matmul(x.reshape([batch, channels, height * width])).reshape([batch, outputs, height, width])
}

/// Values between 0 and 1 as they are; beyond, with a slope of [`LEAK`].
fn leaky_clip(x: Tensor<4>) -> Tensor<4> {
    x.clone().clamp(0.0, 1.0) * (1.0 - LEAK) + x * LEAK
}
