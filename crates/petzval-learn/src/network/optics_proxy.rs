//! A network that imitates a lens: from its numbers and a field to the point spread functions of three colours.

use burn::{
    module::{Module, Param},
    prelude::*,
    tensor::activation::{leaky_relu, softmax, softplus},
};
use serde::{Deserialize, Serialize};

use super::{
    NetworkError, conv_leaky,
    leaky_conv::{LeakyConv, SLOPE},
    pointwise,
    trunk::shuffle,
    weights::{Initializer, check_sizes},
};

/// Colours of a PSF.
const COLOURS: usize = 3;

/// Rows and columns of the picture from which the decoder starts. It is doubled twice.
const SMALL: usize = 32;

/// Rows and columns of the predicted PSFs.
pub const PROXY_GRID: usize = 4 * SMALL;

/// The inverse of softplus at 1: the illumination starts there.
const UNIT: f32 = 0.541_325;

/// Size of an [`OpticsProxy`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OpticsProxyConfig {
    /// Inputs: numbers of the lens, and the field. 1..=256.
    pub inputs: usize,
    /// Width of the two hidden layers, 1..=1024.
    pub hidden: usize,
    /// Channels of the decoder, 1..=256. Multiples of 8 are the most efficient.
    pub channels: usize,
}

impl Default for OpticsProxyConfig {
    /// The sizes of the paper: 128 hidden units and 64 channels.
    fn default() -> Self {
        Self { inputs: 20, hidden: 128, channels: 64 }
    }
}

impl OpticsProxyConfig {
    /// Builds the network on `device`, with weights drawn from `seed` alone. Fails on a size that is out of range.
    pub fn init(&self, seed: u64, device: &Device) -> Result<OpticsProxy, NetworkError> {
        check_sizes(&[
            ("inputs", self.inputs, 1..=256, "1 to 256"),
            ("hidden", self.hidden, 1..=1024, "1 to 1024"),
            ("channels", self.channels, 1..=256, "1 to 256"),
        ])?;
        let mut draw = Initializer::new(seed, device);
        let Self { inputs, hidden, channels } = *self;
        let outputs = COLOURS * SMALL * SMALL + COLOURS;
        Ok(OpticsProxy {
            first: Dense::new(inputs, hidden, &mut draw),
            second: Dense::new(hidden, hidden, &mut draw),
            third: Dense::new(hidden, outputs, &mut draw),
            coarse: vec![
                LeakyConv::new(COLOURS, channels, &mut draw),
                LeakyConv::new(channels, channels, &mut draw),
            ],
            to_middle: Doubling::new(channels, &mut draw),
            middle: vec![
                LeakyConv::new(channels, channels, &mut draw),
                LeakyConv::new(channels, channels, &mut draw),
            ],
            to_fine: Doubling::new(channels, &mut draw),
            last_weight: draw.normal([COLOURS, channels, 3, 3], (9.0 * channels as f32).sqrt().recip()),
            last_bias: draw.zeros([COLOURS]),
        })
    }
}

/// `x weight + bias`.
#[derive(Module, Debug)]
struct Dense {
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

impl Dense {
    fn new(inputs: usize, outputs: usize, draw: &mut Initializer) -> Self {
        let weight = draw.normal([inputs, outputs], (inputs as f32).sqrt().recip());
        Self { weight, bias: draw.zeros([outputs]) }
    }

    fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        x.matmul(self.weight.val()) + self.bias.val().unsqueeze()
    }
}

/// The transposed convolution with a 2x2 kernel and a step of 2: every pixel becomes 2x2 pixels, each by a matrix of its own.
#[derive(Module, Debug)]
struct Doubling {
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

impl Doubling {
    fn new(channels: usize, draw: &mut Initializer) -> Self {
        let weight = draw.normal([4 * channels, channels], (channels as f32).sqrt().recip());
        Self { weight, bias: draw.zeros([4 * channels]) }
    }

    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        shuffle(pointwise(x, self.weight.val(), self.bias.val()))
    }
}

/// PSFs as a network predicts them.
pub struct PredictedPsfs {
    /// `[batch, 3, 128, 128]`, each of unit sum.
    pub values: Tensor<4>,
    /// Relative illumination, `[batch, 3]`.
    pub illumination: Tensor<2>,
}

/// PSFs of a lens as a differentiable function of its numbers and of the field: the optics meta-network of the paper.
///
/// ```text
/// numbers, field -> 128 -> 128 -> 3 x 32 x 32 and 3
/// 3 x 32 x 32 -> conv 64, conv 64 -> doubling -> conv 64, conv 64 -> doubling -> conv 3 -> 3 x 128 x 128
/// PSF = exp(...) over its sum, colour by colour;  illumination = softplus(the last 3)
/// ```
///
/// The paper says that each colour is divided by its sum, and nothing about activations: leaky rectifiers and the exponential function
/// are our choice.
///
/// Source: E. Tseng et al., "Differentiable Compound Optics and Processing Pipeline Optimization for End-to-end Camera Design", ACM TOG
/// 2021, supplement, section 4.
#[derive(Module, Debug)]
pub struct OpticsProxy {
    first: Dense,
    second: Dense,
    third: Dense,
    coarse: Vec<LeakyConv>,
    to_middle: Doubling,
    middle: Vec<LeakyConv>,
    to_fine: Doubling,
    last_weight: Param<Tensor<4>>,
    last_bias: Param<Tensor<1>>,
}

impl OpticsProxy {
    /// How many inputs it takes.
    pub fn inputs(&self) -> usize {
        self.first.weight.dims()[0]
    }

    /// The PSFs of numbers and fields `[batch, inputs]`, each input scaled to mean 0 and variance 1.
    pub fn forward(&self, inputs: Tensor<2>) -> PredictedPsfs {
        let [batch, _] = inputs.dims();
        let slope = f64::from(SLOPE);
        let hidden = leaky_relu(self.first.forward(inputs), slope);
        let hidden = leaky_relu(self.second.forward(hidden), slope);
        let parts = self.third.forward(hidden).split_with_sizes(vec![COLOURS * SMALL * SMALL, COLOURS], 1);
        let [picture, light] = parts.try_into().expect("two parts");
        let convolved = |layers: &[LeakyConv], x| layers.iter().fold(x, |x, conv| conv.forward(x));
        let x = convolved(&self.coarse, picture.reshape([batch, COLOURS, SMALL, SMALL]));
        let x = convolved(&self.middle, self.to_middle.forward(x));
        let x = conv_leaky(self.to_fine.forward(x), self.last_weight.val(), self.last_bias.val(), 1, 1.0);
        let values = softmax(x.reshape([batch, COLOURS, PROXY_GRID * PROXY_GRID]), 2);
        PredictedPsfs {
            values: values.reshape([batch, COLOURS, PROXY_GRID, PROXY_GRID]),
            illumination: softplus(light + UNIT, 1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{module::conv_transpose2d, ops::ConvTransposeOptions};

    use super::*;
    use crate::weight_file::Weights;

    fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
        tensor.into_data().try_to_vec().unwrap()
    }

    #[test]
    fn doubling_is_the_frameworks_transposed_convolution() {
        let device = Device::flex();
        let doubling = Doubling::new(3, &mut Initializer::new(5, &device));
        let values: Vec<f32> = (0..3 * 4 * 5).map(|i| (0.7 * i as f32).sin()).collect();
        let x = Tensor::<4>::from_data(TensorData::new(values, [1, 3, 4, 5]), &device);
        // Ours is [output, row, column, input]; the framework's is [input, output, row, column].
        let weight = doubling.weight.val().reshape([3, 2, 2, 3]).permute([3, 0, 1, 2]);
        let options = ConvTransposeOptions::new([2, 2], [0, 0], [0, 0], [1, 1], 1);
        let expected = host(conv_transpose2d(x.clone(), weight, None, options));
        let found = host(doubling.forward(x));
        assert_eq!(found.len(), expected.len());
        assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn psfs_have_unit_sum_and_a_gradient_by_every_input() {
        let device = Device::flex().autodiff();
        let network = OpticsProxyConfig { inputs: 4, hidden: 16, channels: 8 }.init(3, &device).unwrap();
        let values = vec![0.3_f32, -1.0, 0.5, 0.1, -0.2, 0.8, 0.0, 1.5];
        let input = Tensor::<2>::from_data(TensorData::new(values, [2, 4]), &device).require_grad();
        let psfs = network.forward(input.clone());
        for psf in host(psfs.values.clone()).chunks(PROXY_GRID * PROXY_GRID) {
            assert!((psf.iter().sum::<f32>() - 1.0).abs() < 1e-4);
            assert!(psf.iter().all(|v| *v >= 0.0));
        }
        assert!(host(psfs.illumination.clone()).iter().all(|v| *v > 0.0));
        let loss = psfs.values.square().sum() + psfs.illumination.sum();
        let slopes = host(input.grad(&loss.backward()).unwrap());
        assert!(slopes.iter().all(|s| s.abs() > 1e-6), "{slopes:?}");
    }

    #[test]
    fn weights_come_back_from_their_bytes_and_sizes_are_checked() {
        let device = Device::flex();
        let config = OpticsProxyConfig { inputs: 3, hidden: 8, channels: 8 };
        let [one, other] = [1, 2].map(|seed| config.init(seed, &device).unwrap());
        let input = Tensor::<2>::from_data([[0.1_f32, 0.2, 0.3]], &device);
        let wanted = host(one.forward(input.clone()).values);
        assert!(wanted != host(other.forward(input.clone()).values));
        let loaded = other.load_bytes(one.to_bytes().unwrap()).unwrap();
        assert_eq!(wanted, host(loaded.forward(input).values));
        assert!(OpticsProxyConfig { hidden: 0, ..config }.init(1, &device).is_err());
        let wider = OpticsProxyConfig { hidden: 16, ..config }.init(1, &device).unwrap();
        assert!(wider.load_bytes(one.to_bytes().unwrap()).is_err());
    }
}
