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
    weights::{Initializer, check_sizes},
};

/// Colours of the mosaic: red, green in the red row, green in the blue row, blue.
const MOSAIC: usize = 4;

/// Rows and columns of the thumbnail.
const THUMBNAIL: usize = 16;

/// Colours of the picture, and values that a cell of the mosaic has in it.
const COLOURS: usize = 3;
const OUT: usize = COLOURS * 4;

/// Straight pieces of the curve of the tones: enough for a gamma curve with a knee, few enough to be learnt.
const PIECES: usize = 8;

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
        let last = last_counts(small, base + COLOURS).iter().sum();
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
/// encoded  = encode(raw)
/// light    = red, mean of the greens, and blue of raw
/// mixed(x) = encode(x + A x + b)
/// far      = the thumbnail of encoded and mixed(light), 16 x 16 means of the whole mosaic, through three convolutions, enlarged
/// bend(x)  = x + sum over k of B_k max(x - k / 8, 0), k = 0..7
/// colours  = bend(mixed(light exp(c far)))
/// rgb      = clip(colours, repeated 2 x 2, + shuffle(M (U(encoded, colours, far), colours)))
/// ```
///
/// The path of `colours` has the form of what an ISP does to the brightness of a pixel. It applies a gain that depends on the surroundings
/// (local tone mapping, whose thumbnail covers the whole picture), mixes colours, and bends the tones. What remains, denoising, demosaicing
/// and sharpening, is for the U-Net `U`. The square root spreads the dark values.
///
/// A dense network with two hidden layers turns the parameters into `A`, `b`, `c`, `B_k` and `M`. All are 0 at first, so that the network
/// begins as the square root of the raw. It also gives a scale and a shift for each channel of the thumbnail and of every pair of
/// convolutions of `U`: `x (1 + scale) + shift`, both 0 at first. `shuffle` places 4 channels per colour on 2 x 2 pixels. `clip` leaves a
/// slope of 0.02 beyond 0 and 1, so that the network may say how far beyond its range the ISP would be, and a gradient remains.
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
    /// How many parameters it takes.
    pub fn parameters(&self) -> usize {
        self.hidden_weight.dims()[0]
    }

    /// Develops raw mosaics with parameters.
    ///
    /// `raw`: `[batch, 4, height / 2, width / 2]`, colours red, green, green, blue of the 2x2 mosaic, linear, black 0 and
    /// white 1. `theta`: `[batch, parameters]`, each scaled to about -1..1. Returns `[batch, 3, height, width]` on the scale of the ISP's output, not clamped. Any even height and width.
    ///
    /// # Panics
    /// Panics if the number of colours or parameters is wrong, or the batches differ.
    pub fn forward(&self, raw: Tensor<4>, theta: Tensor<2>) -> Tensor<4> {
        let ([batch, colours, height, width], [items, parameters]) = (raw.dims(), theta.dims());
        let [expected, _] = self.hidden_weight.dims();
        assert_eq!([colours, items, parameters], [MOSAIC, batch, expected], "IspProxy: shape of the input");
        let controls = self.controls(theta);

        // The light as the ISP sees it, and without the mosaic.
        let encoded = encode(raw.clone());
        let colour = |c: usize| raw.clone().slice([0..batch, c..c + 1]);
        let light = Tensor::cat(vec![colour(0), (colour(1) + colour(2)) * 0.5, colour(3)], 1);
        let mixed = |light: Tensor<4>| {
            encode(light.clone() + mix(&controls.by_colour, light, COLOURS) + controls.shift.clone())
        };

        // Look at the whole picture through a thumbnail.
        let near = Tensor::cat(vec![encoded.clone(), mixed(light.clone())], 1);
        let small =
            controls.modulated(0, self.thumbnail[0].forward(adaptive_avg_pool2d(near, [THUMBNAIL; 2])));
        let small = self.thumbnail[1..].iter().fold(small, |x, conv| conv.forward(x));
        let options = InterpolateOptions::new(InterpolateMode::Bilinear)
            .with_align_corners(false)
            .with_output_size([height, width]);
        let far = interpolate(small, options);

        // Amplify by what lies around, mix the colours, and bend the tones.
        let gain = mix(&controls.by_far, far.clone(), 1).exp();
        let colours = mixed(light * gain);
        let above = |k: usize| (colours.clone() - k as f64 / PIECES as f64).clamp_min(0.0);
        let pieces = Tensor::cat((0..PIECES).map(above).collect(), 1);
        let colours = colours.clone() + mix(&controls.by_piece, pieces, COLOURS);

        // Add what the network finds for each pixel of a cell of the mosaic.
        let x = Tensor::cat(vec![encoded, colours.clone(), far], 1);
        let x = extend(x, self.trunk.unit());
        let x = crop(self.trunk.forward(x, |pair, x| controls.modulated(pair + 1, x)), [height, width]);
        let found = mix(&controls.by_feature, Tensor::cat(vec![x, colours.clone()], 1), OUT);
        leaky_clip(double(colours) + shuffle(found))
    }

    /// What the dense network makes of the parameters.
    fn controls(&self, theta: Tensor<2>) -> Controls {
        let [batch, _] = theta.dims();
        let first = theta.clone().matmul(self.hidden_weight.val()) + self.hidden_bias.val().unsqueeze();
        let first = leaky_relu(first, f64::from(SLOPE));
        let second = first.clone().matmul(self.second_weight.val()) + self.second_bias.val().unsqueeze();
        let hidden = Tensor::cat(vec![theta, first + leaky_relu(second, f64::from(SLOPE))], 1);

        let modulations =
            hidden.clone().matmul(self.modulation_weight.val()) + self.modulation_bias.val().unsqueeze();
        let channels = self.widths.iter().flat_map(|width| [*width; 2]).collect();
        let modulations = modulations.split_with_sizes(channels, 1);
        let [_, last] = self.last_weight.dims();
        let mut counts = last_counts(self.widths[0], 0);
        counts[4] = last - counts.iter().sum::<usize>();
        let last = hidden.matmul(self.last_weight.val()) + self.last_bias.val().unsqueeze();
        let [by_colour, shift, by_far, by_piece, by_feature] =
            last.split_with_sizes(counts.to_vec(), 1).try_into().expect("five parts");
        Controls {
            modulations: modulations.into_iter().map(|m| m.unsqueeze_dims(&[2, 3])).collect(),
            by_colour,
            shift: shift.reshape([batch, COLOURS, 1, 1]),
            by_far,
            by_piece,
            by_feature,
        }
    }
}

/// How many numbers the dense network gives for the thumbnail's channels and the features of the last layer: those of
/// [`Controls::by_colour`], `shift`, `by_far`, `by_piece` and `by_feature`.
fn last_counts(thumbnail_channels: usize, features: usize) -> [usize; 5] {
    [COLOURS * COLOURS, COLOURS, thumbnail_channels, COLOURS * COLOURS * PIECES, OUT * features]
}

/// What the parameters do to each picture of a batch; the letters are those of [`IspProxy`].
struct Controls {
    /// Scale and shift of every block, in turns: `[batch, channels, 1, 1]`.
    modulations: Vec<Tensor<4>>,
    /// `A`, `[batch, 3 * 3]`.
    by_colour: Tensor<2>,
    /// `b`, `[batch, 3, 1, 1]`.
    shift: Tensor<4>,
    /// `c`, `[batch, channels of the thumbnail]`.
    by_far: Tensor<2>,
    /// `B_k`, `[batch, 3 * 3 * pieces]`.
    by_piece: Tensor<2>,
    /// `M`, `[batch, 12 * features]`.
    by_feature: Tensor<2>,
}

impl Controls {
    /// The features of a block, scaled and shifted. The thumbnail is the first block; the pairs of the trunk follow.
    fn modulated(&self, block: usize, x: Tensor<4>) -> Tensor<4> {
        x * (self.modulations[2 * block].clone() + 1.0) + self.modulations[2 * block + 1].clone()
    }
}

/// The square root of light, with a finite slope at black.
fn encode(light: Tensor<4>) -> Tensor<4> {
    (light.clamp_min(0.0) + BLACK).sqrt() - BLACK.sqrt()
}

/// At every pixel, `outputs` sums of its channels, with weights `[batch, outputs * channels]`.
fn mix(weights: &Tensor<2>, x: Tensor<4>, outputs: usize) -> Tensor<4> {
    let [batch, channels, height, width] = x.dims();
    let weights = weights.clone().reshape([batch, outputs, channels]);
    weights.matmul(x.reshape([batch, channels, height * width])).reshape([batch, outputs, height, width])
}

/// Values between 0 and 1 as they are; beyond, with a slope of [`LEAK`].
fn leaky_clip(x: Tensor<4>) -> Tensor<4> {
    x.clone().clamp(0.0, 1.0) * (1.0 - LEAK) + x * LEAK
}
