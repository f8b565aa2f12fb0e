//! A trainable 3x3 convolution with a leaky rectifier.

use burn::{
    module::{Module, Param},
    prelude::*,
};

use super::{conv_leaky, weights::Initializer};

/// Slope of the rectifier for negative values.
pub(crate) const SLOPE: f32 = 0.2;

/// `leaky(conv3x3(x) + bias)`, zeros outside the picture.
#[derive(Module, Debug)]
pub(crate) struct LeakyConv {
    weight: Param<Tensor<4>>,
    bias: Param<Tensor<1>>,
}

impl LeakyConv {
    /// He-normal weights for the leaky rectifier, standard deviation `sqrt(2 / ((1 + slope^2) 9 inputs))`; zero bias.
    pub fn new(inputs: usize, outputs: usize, initializer: &mut Initializer) -> Self {
        let deviation = (2.0 / ((1.0 + SLOPE * SLOPE) * 9.0 * inputs as f32)).sqrt();
        Self {
            weight: initializer.normal([outputs, inputs, 3, 3], deviation),
            bias: initializer.zeros([outputs]),
        }
    }

    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        conv_leaky(x, self.weight.val(), self.bias.val(), 1, SLOPE)
    }
}
