//! A backbone that trains on two processor cores.

use burn::module::Module;
use burn::prelude::*;

use crate::detection::layers::{Conv, ConvShape};
use crate::detection::parameters::{Parameters, Start};
use crate::network::NetworkError;

/// Channels at a quarter of the resolution, an eighth, and so on.
pub(super) const WIDTHS: [usize; 4] = [32, 64, 64, 96];

/// Channels at half the resolution.
const STEM: usize = 16;

/// Slope of the rectifiers for negative values.
const SLOPE: f32 = 0.1;

/// A convolution that halves the picture, then a residual block: `x + conv(leaky(conv(x)))`, rectified.
#[derive(Module, Debug)]
struct Stage {
    down: Conv,
    first: Conv,
    second: Conv,
}

/// Four stages behind a stem. There is no normalisation: the second convolution of a residual block starts at 0, so that each stage starts
/// as its first convolution.
#[derive(Module, Debug)]
pub(crate) struct Small {
    stem: Conv,
    stages: Vec<Stage>,
}

impl Small {
    pub fn new(from: &Parameters, name: &str) -> Result<Self, NetworkError> {
        let conv = |part: &str, shape: ConvShape, start: Start| {
            Conv::new(from, &format!("{name}.{part}"), shape, start, 0.0)
        };
        let stem = ConvShape::new(3, STEM, 3).halving();
        let mut stages = Vec::new();
        for (i, width) in WIDTHS.into_iter().enumerate() {
            let inputs = if i == 0 { STEM } else { WIDTHS[i - 1] };
            let down = ConvShape::new(inputs, width, 3).halving();
            let same = ConvShape::new(width, width, 3);
            stages.push(Stage {
                down: conv(&format!("stages.{i}.down"), down, down.rectified())?,
                first: conv(&format!("stages.{i}.first"), same, same.rectified())?,
                second: conv(&format!("stages.{i}.second"), same, Start::Constant(0.0))?,
            });
        }
        Ok(Self { stem: conv("stem", stem, stem.rectified())?, stages })
    }

    pub fn features(&self, pictures: Tensor<4>) -> Vec<Tensor<4>> {
        let mut x = self.stem.leaky(pictures, SLOPE);
        let mut features = Vec::new();
        for stage in &self.stages {
            x = stage.down.leaky(x, SLOPE);
            x = x.clone() + stage.second.forward(stage.first.leaky(x, SLOPE));
            features.push(x.clone());
        }
        features
    }
}
