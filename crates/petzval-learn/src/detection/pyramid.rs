//! The feature pyramid (Lin 2017): features of every resolution, each with the meaning of the coarsest.

use burn::module::Module;
use burn::prelude::*;
use burn::tensor::module::interpolate;
use burn::tensor::ops::{InterpolateMode, InterpolateOptions};

use super::layers::{Conv, ConvShape, even_places};
use super::parameters::{Parameters, Start};
use crate::network::NetworkError;

/// 1x1 convolutions to a common number of channels, coarse features added to finer ones, then 3x3 convolutions; as the last level, every
/// second row and column of the coarsest.
#[derive(Module, Debug)]
pub(crate) struct Pyramid {
    lateral: Vec<Conv>,
    smooth: Vec<Conv>,
}

impl Pyramid {
    /// The pyramid under `{name}` over features of these channels, finest first.
    pub fn new(
        from: &Parameters,
        name: &str,
        inputs: &[usize],
        channels: usize,
    ) -> Result<Self, NetworkError> {
        let conv = |kind: &str, level: usize, inputs: usize, kernel: usize| {
            // A variance of 1 stays 1 without a rectifier.
            let start = Start::Normal((1.0 / (kernel * kernel * inputs) as f32).sqrt());
            let shape = ConvShape::new(inputs, channels, kernel);
            Conv::new(from, &format!("{name}.{kind}.{level}.0"), shape, start, 0.0)
        };
        let lateral = inputs.iter().enumerate().map(|(i, inputs)| conv("inner_blocks", i, *inputs, 1));
        let smooth = (0..inputs.len()).map(|i| conv("layer_blocks", i, channels, 3));
        Ok(Self { lateral: lateral.collect::<Result<_, _>>()?, smooth: smooth.collect::<Result<_, _>>()? })
    }

    /// One map per level, finest first, and the additional one.
    pub fn forward(&self, features: Vec<Tensor<4>>) -> Vec<Tensor<4>> {
        let mut maps = Vec::with_capacity(features.len() + 1);
        let mut above: Option<Tensor<4>> = None;
        for ((features, lateral), smooth) in features.into_iter().zip(&self.lateral).zip(&self.smooth).rev() {
            let own = lateral.forward(features);
            let sum = match above {
                Some(above) => {
                    let [_, _, height, width] = own.dims();
                    let options =
                        InterpolateOptions::new(InterpolateMode::Nearest).with_output_size([height, width]);
                    own + interpolate(above, options)
                }
                None => own,
            };
            maps.push(smooth.forward(sum.clone()));
            above = Some(sum);
        }
        maps.reverse();
        if let Some(coarsest) = maps.last() {
            maps.push(even_places(coarsest.clone()));
        }
        maps
    }
}
