//! Helpers of the smooth stages: planes on the tape `[1, 1, height, width]`, their neighbours, and parameters as tensors.

use burn::prelude::*;
use burn::tensor::TensorData;
use burn::tensor::ops::PadMode;

use super::fixed::{BORDER, Biweight};
use crate::sensor::{CfaPattern, Colour};

/// A plane with a mirrored border, as [`Grid`](super::fixed::Grid) has it.
pub struct Stencil {
    padded: Tensor<4>,
    height: usize,
    width: usize,
}

impl Stencil {
    pub fn new(plane: &Tensor<4>) -> Self {
        let [_, _, height, width] = plane.dims();
        let padded = plane.clone().pad([(BORDER, BORDER), (BORDER, BORDER)], PadMode::Reflect);
        Self { padded, height, width }
    }

    /// The plane moved so that each pixel holds its neighbour `down` rows below and `right` columns to the right.
    pub fn at(&self, down: isize, right: isize) -> Tensor<4> {
        let (r, c) = (BORDER.wrapping_add_signed(down), BORDER.wrapping_add_signed(right));
        let [batch, channels, _, _] = self.padded.dims();
        self.padded.clone().slice([0..batch, 0..channels, r..r + self.height, c..c + self.width])
    }
}

/// The parameters of an ISP on the tape.
pub struct Theta {
    values: Tensor<1>,
    names: Vec<String>,
}

impl Theta {
    pub fn new(values: Tensor<1>, names: Vec<String>) -> Self {
        assert_eq!(values.dims(), [names.len()], "one value for each parameter");
        Self { values, names }
    }

    /// A parameter as a tensor `[1, 1, 1, 1]`.
    ///
    /// # Panics
    /// Panics if there is none of this name.
    pub fn number(&self, name: &str) -> Tensor<4> {
        let at =
            self.names.iter().position(|n| n == name).unwrap_or_else(|| panic!("no ISP parameter {name}"));
        self.values.clone().narrow(0, at, 1).reshape([1, 1, 1, 1])
    }
}

/// A constant plane or matrix on the device of another tensor.
pub fn constant<const D: usize>(values: Vec<f32>, shape: [usize; D], like: &Tensor<4>) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, shape), &like.device())
}

/// 1 where the array has this colour, else 0.
pub fn colour_mask(cfa: CfaPattern, colour: Colour, like: &Tensor<4>) -> Tensor<4> {
    let [_, _, height, width] = like.dims();
    let values = (0..height * width).map(|i| f32::from(u8::from(cfa.colour(i / width, i % width) == colour)));
    constant(values.collect(), [1, 1, height, width], like)
}

/// The smaller of two tensors.
pub fn least(a: Tensor<4>, b: Tensor<4>) -> Tensor<4> {
    a.min_pair(b)
}

/// The greater of two tensors.
pub fn greatest(a: Tensor<4>, b: Tensor<4>) -> Tensor<4> {
    a.max_pair(b)
}

/// A tensor between two others of any shape that fits: the bounds are tensors because parameters set them.
pub fn between(x: Tensor<4>, low: Tensor<4>, high: Tensor<4>) -> Tensor<4> {
    let dims = x.dims();
    least(greatest(x, low.expand(dims)), high.expand(dims))
}

/// Tukey's influence of differences within a limit; see [`Biweight`].
pub fn influence(difference: Tensor<4>, limit: Tensor<4>) -> Tensor<4> {
    difference.clone() * biweight(difference, limit)
}

/// Tukey's weight of differences within a limit, `(1 - (d / limit)^2)^2`.
pub fn biweight(difference: Tensor<4>, limit: Tensor<4>) -> Tensor<4> {
    let share = difference / limit.clamp_max(Biweight::MOST_LIMIT);
    let rest = (-(share.clone() * share) + 1.0).clamp_min(0.0);
    rest.clone() * rest
}
