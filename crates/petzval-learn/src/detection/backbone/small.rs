//! A backbone that trains on two processor cores.

use burn::module::{Module, Param};
use burn::prelude::*;

use crate::detection::layers::{Conv, ConvShape};
use crate::detection::parameters::{Parameters, Start};
use crate::network::{NetworkError, depthwise, gated_pointwise, normalized_pointwise};

/// Channels at a quarter of the resolution, an eighth, and so on.
pub(super) const WIDTHS: [usize; 4] = [32, 64, 96, 128];

/// Blocks at each of them.
const BLOCKS: [usize; 4] = [1, 2, 2, 2];

/// Channels at half the resolution.
const STEM: usize = 24;

/// Side of the kernels that look around.
const KERNEL: usize = 5;

/// Slope of the rectifiers for negative values.
const SLOPE: f32 = 0.1;

/// `x + mix(gate(spread(normalised(around(x)))))`: a kernel per channel looks around, two 1x1 convolutions mix the channels. The
/// normalisation keeps the training stable without the statistics of a batch.
#[derive(Module, Debug)]
struct Block {
    around: Param<Tensor<3>>,
    around_bias: Param<Tensor<1>>,
    spread: Param<Tensor<2>>,
    spread_bias: Param<Tensor<1>>,
    mix: Param<Tensor<2>>,
    mix_bias: Param<Tensor<1>>,
}

impl Block {
    fn new(from: &Parameters, name: &str, width: usize) -> Result<Self, NetworkError> {
        let deviation = |inputs: usize| Start::Normal((1.0 / inputs as f32).sqrt());
        let bias = |part: &str, count: usize| {
            from.trained(&format!("{name}.{part}.bias"), [count], Start::Constant(0.0))
        };
        let matrix = |part: &str, shape: [usize; 2], start: Start| {
            from.trained(&format!("{name}.{part}.weight"), shape, start)
        };
        let around = format!("{name}.around.weight");
        Ok(Self {
            around: from.trained(&around, [width, KERNEL, KERNEL], deviation(KERNEL * KERNEL))?,
            around_bias: bias("around", width)?,
            spread: matrix("spread", [4 * width, width], deviation(width))?,
            spread_bias: bias("spread", 4 * width)?,
            // A block starts as the identity.
            mix: matrix("mix", [width, 2 * width], Start::Constant(0.0))?,
            mix_bias: bias("mix", width)?,
        })
    }

    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let y = depthwise(x.clone(), self.around.val(), self.around_bias.val());
        let y = normalized_pointwise(y, self.spread.val(), self.spread_bias.val());
        x + gated_pointwise(y, self.mix.val(), self.mix_bias.val())
    }
}

/// A convolution that halves the picture, then blocks. What a detector sees of it is normalised over the channels of each pixel: without that,
/// and without weights trained on millions of pictures, small objects are learnt several times more slowly.
#[derive(Module, Debug)]
struct Stage {
    down: Conv,
    blocks: Vec<Block>,
    shown: Param<Tensor<2>>,
    shown_bias: Param<Tensor<1>>,
}

impl Stage {
    /// Stage `i` behind features of `inputs` channels.
    fn new(from: &Parameters, name: &str, i: usize, inputs: usize) -> Result<Self, NetworkError> {
        let (name, width) = (format!("{name}.stages.{i}"), WIDTHS[i]);
        let down = ConvShape::new(inputs, width, 3).halving();
        let block = |k: usize| Block::new(from, &format!("{name}.blocks.{k}"), width);
        let shown = Start::Normal((1.0 / width as f32).sqrt());
        Ok(Self {
            down: Conv::new(from, &format!("{name}.down"), down, down.rectified(), 0.0)?,
            blocks: (0..BLOCKS[i]).map(block).collect::<Result<_, _>>()?,
            shown: from.trained(&format!("{name}.shown.weight"), [width, width], shown)?,
            shown_bias: from.trained(&format!("{name}.shown.bias"), [width], Start::Constant(0.0))?,
        })
    }

    /// What goes on to the next stage.
    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let x = self.down.leaky(x, SLOPE);
        self.blocks.iter().fold(x, |x, block| block.forward(x))
    }

    /// What a detector sees of it.
    fn show(&self, x: Tensor<4>) -> Tensor<4> {
        normalized_pointwise(x, self.shown.val(), self.shown_bias.val())
    }
}

/// Four stages behind a stem.
#[derive(Module, Debug)]
pub(crate) struct Small {
    stem: Conv,
    stages: Vec<Stage>,
}

impl Small {
    pub fn new(from: &Parameters, name: &str) -> Result<Self, NetworkError> {
        let stem = ConvShape::new(3, STEM, 3).halving();
        let inputs = |i: usize| if i == 0 { STEM } else { WIDTHS[i - 1] };
        let stages = (0..WIDTHS.len()).map(|i| Stage::new(from, name, i, inputs(i)));
        Ok(Self {
            stem: Conv::new(from, &format!("{name}.stem"), stem, stem.rectified(), 0.0)?,
            stages: stages.collect::<Result<_, _>>()?,
        })
    }

    /// Features of a batch of pictures, finest first. Each is computed when it is taken.
    pub fn features(&self, pictures: Tensor<4>) -> impl Iterator<Item = Tensor<4>> {
        // Each stage takes the last map out, so that its memory is free once it is used.
        let stem = Some(self.stem.leaky(pictures, SLOPE));
        self.stages.iter().scan(stem, |last, stage| {
            let x = stage.forward(last.take()?);
            *last = Some(x.clone());
            Some(stage.show(x))
        })
    }
}
