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
    pointwise,
    trunk::{Trunk, crop, double, extend},
    weights::{self, Initializer, check_sizes},
};

/// Colours of the mosaic: red, green in the red row, green in the blue row, blue.
const MOSAIC: usize = 4;

/// Rows and columns of the thumbnail.
const THUMBNAIL: usize = 16;

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
    /// Width of the dense network that turns parameters into modulations, 1..=1024.
    pub hidden: usize,
}

impl Default for IspProxyConfig {
    /// 16 parameters; 16 channels, 3 levels: small enough to be trained on two cores.
    fn default() -> Self {
        Self { parameters: 16, base_channels: 16, levels: 3, thumbnail_channels: 8, hidden: 64 }
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
        Ok(IspProxy {
            hidden_weight: draw
                .normal([self.parameters, self.hidden], (self.parameters as f32).sqrt().recip()),
            hidden_bias: draw.normal([self.hidden], 0.5),
            modulation_weight: draw.zeros([self.hidden, modulations]),
            modulation_bias: draw.zeros([modulations]),
            thumbnail: vec![
                LeakyConv::new(MOSAIC, small, &mut draw),
                LeakyConv::new(small, small, &mut draw),
                LeakyConv::new(small, small, &mut draw),
            ],
            trunk: Trunk::new(MOSAIC + small, base, self.levels, &mut draw),
            last_weight: draw.zeros([3 * 4, base]),
            last_bias: draw.zeros([3 * 4]),
            widths,
        })
    }
}

/// The picture that an ISP develops from a raw mosaic, as a differentiable function of the mosaic and the parameters.
///
/// ```text
/// encoded = sqrt(max(raw, 0) + 1e-4) - 0.01
/// far     = the thumbnail of encoded, 16 x 16 means of the whole mosaic, through three convolutions, enlarged
/// rgb     = encoded colours, repeated 2 x 2, + shuffle(U(encoded, far))
/// ```
///
/// The square root spreads the dark values. Local tone mapping looks far across the picture, which the thumbnail covers. Each
/// pair of convolutions of the U-Net `U`, and the thumbnail, is modulated by the parameters: `x (1 + scale) + shift` per
/// channel, where a dense network with one hidden layer gives all scales and shifts; they start at 0. `shuffle` places 4
/// channels per colour on 2 x 2 pixels.
///
/// Measured, CPU time, batch 4, raw of 128 x 128, forward and backward in the default size: 51 ms.
///
/// Sources: E. Perez et al., "FiLM: Visual Reasoning with a General Conditioning Layer", AAAI 2018, for the modulation; E.
/// Tseng et al., "Hyperparameter optimization in black-box image processing using differentiable proxies", ACM TOG 2019, for
/// the use.
#[derive(Module, Debug)]
pub struct IspProxy {
    hidden_weight: Param<Tensor<2>>,
    hidden_bias: Param<Tensor<1>>,
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
    /// white 1. `theta`: `[batch, parameters]`, each scaled to 0..1. Returns `[batch, 3, height, width]` on the scale of the
    /// ISP's output, not clamped. Any even height and width.
    ///
    /// # Panics
    /// Panics if the number of colours or parameters is wrong, or the batches differ.
    pub fn forward(&self, raw: Tensor<4>, theta: Tensor<2>) -> Tensor<4> {
        let ([batch, colours, height, width], [items, parameters]) = (raw.dims(), theta.dims());
        let [expected, _] = self.hidden_weight.dims();
        assert_eq!([colours, items, parameters], [MOSAIC, batch, expected], "IspProxy: shape of the input");
        let encoded = (raw.clamp_min(0.0) + BLACK).sqrt() - BLACK.sqrt();

        // Turn the parameters into a scale and a shift per channel of every block.
        let hidden =
            (theta * 2.0 - 1.0).matmul(self.hidden_weight.val()) + self.hidden_bias.val().unsqueeze();
        let modulations = leaky_relu(hidden, f64::from(SLOPE)).matmul(self.modulation_weight.val())
            + self.modulation_bias.val().unsqueeze();
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

        // Look at the whole picture through a thumbnail.
        let small = adaptive_avg_pool2d(encoded.clone(), [THUMBNAIL; 2]);
        let small = modulate(0, self.thumbnail[0].forward(small));
        let small = self.thumbnail[1..].iter().fold(small, |x, conv| conv.forward(x));
        let options = InterpolateOptions::new(InterpolateMode::Bilinear)
            .with_align_corners(false)
            .with_output_size([height, width]);
        let near_and_far = Tensor::cat(vec![encoded.clone(), interpolate(small, options)], 1);

        // Compute four values per colour for each cell of the mosaic, and place them on its pixels.
        let x = extend(near_and_far, self.trunk.unit());
        let x = self.trunk.forward(x, |pair, x| modulate(pair + 1, x));
        let mixed = crop(pointwise(x, self.last_weight.val(), self.last_bias.val()), [height, width]);
        let colour = |c: usize| encoded.clone().slice([0..batch, c..c + 1]);
        let green = (colour(1) + colour(2)) * 0.5;
        double(Tensor::cat(vec![colour(0), green, colour(3)], 1)) + shuffle(mixed)
    }

    /// All weights as bytes in Burn's format, exact to the bit.
    pub fn to_bytes(&self) -> Result<Vec<u8>, NetworkError> {
        weights::to_bytes(self)
    }

    /// Loads weights that [`to_bytes`](Self::to_bytes) wrote. Fails if they belong to another configuration.
    pub fn load_bytes(self, bytes: Vec<u8>) -> Result<Self, NetworkError> {
        weights::load_bytes(self, bytes)
    }
}

/// `y[c, 2 r + i, 2 s + j] = x[4 c + 2 i + j, r, s]`: channels to pixels.
fn shuffle(x: Tensor<4>) -> Tensor<4> {
    let [batch, channels, rows, columns] = x.dims();
    let colours = channels / 4;
    x.reshape([batch, colours, 2, 2, rows, columns]).permute([0, 1, 4, 2, 5, 3]).reshape([
        batch,
        colours,
        2 * rows,
        2 * columns,
    ])
}
