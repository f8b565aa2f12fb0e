//! ResNet (He 2016) with frozen batch normalisation.

use burn::module::Module;
use burn::prelude::*;
use burn::tensor::activation::relu;
use burn::tensor::module::max_pool2d;
use burn::tensor::ops::MaxPoolOptions;

use crate::detection::layers::{ConvShape, NormalizedConv};
use crate::detection::parameters::Parameters;
use crate::network::NetworkError;

/// `relu(convolutions(x) + x)`; the second `x` goes through a 1x1 convolution where its shape changes.
#[derive(Module, Debug)]
struct Residual {
    convolutions: Vec<NormalizedConv>,
    shortcut: Option<NormalizedConv>,
}

impl Residual {
    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let kept = match &self.shortcut {
            Some(shortcut) => shortcut.forward(x.clone()),
            None => x.clone(),
        };
        let (last, before) = self.convolutions.split_last().expect("a block has convolutions");
        let y = before.iter().fold(x, |x, conv| conv.rectified(x));
        relu(last.forward(y) + kept)
    }
}

/// A 7x7 convolution and four layers of residual blocks.
#[derive(Module, Debug)]
pub(crate) struct ResNet {
    stem: NormalizedConv,
    layers: Vec<Vec<Residual>>,
}

/// Channels inside the blocks of each layer.
const WIDTHS: [usize; 4] = [64, 128, 256, 512];

impl ResNet {
    /// Two 3x3 convolutions in each block.
    pub fn with_basic_blocks(
        from: &Parameters,
        name: &str,
        blocks: [usize; 4],
    ) -> Result<Self, NetworkError> {
        Self::new(from, name, blocks, 1, |inputs, width, step| {
            let first = ConvShape { step, ..ConvShape::new(inputs, width, 3) };
            vec![first, ConvShape::new(width, width, 3)]
        })
    }

    /// 1x1, 3x3 and 1x1 convolutions in each block, the last to four times the channels.
    pub fn with_bottlenecks(from: &Parameters, name: &str, blocks: [usize; 4]) -> Result<Self, NetworkError> {
        Self::new(from, name, blocks, 4, |inputs, width, step| {
            let middle = ConvShape { step, ..ConvShape::new(width, width, 3) };
            vec![ConvShape::new(inputs, width, 1), middle, ConvShape::new(width, 4 * width, 1)]
        })
    }

    fn new(
        from: &Parameters,
        name: &str,
        blocks: [usize; 4],
        expansion: usize,
        shapes: impl Fn(usize, usize, usize) -> Vec<ConvShape>,
    ) -> Result<Self, NetworkError> {
        let stem = ConvShape::new(3, 64, 7).halving();
        let stem = NormalizedConv::new(from, &format!("{name}.conv1"), &format!("{name}.bn1"), stem)?;
        let (mut layers, mut inputs) = (Vec::new(), 64);
        for (layer, (count, width)) in blocks.into_iter().zip(WIDTHS).enumerate() {
            let mut residuals = Vec::new();
            for block in 0..count {
                let step = if layer > 0 && block == 0 { 2 } else { 1 };
                let name = format!("{name}.layer{}.{block}", layer + 1);
                let convolutions = shapes(inputs, width, step).into_iter().enumerate().map(|(i, shape)| {
                    let (conv, norm) = (format!("{name}.conv{}", i + 1), format!("{name}.bn{}", i + 1));
                    NormalizedConv::new(from, &conv, &norm, shape)
                });
                let convolutions = convolutions.collect::<Result<_, _>>()?;
                let outputs = expansion * width;
                let shortcut = ConvShape { step, ..ConvShape::new(inputs, outputs, 1) };
                let shortcut = (step > 1 || inputs != outputs).then(|| {
                    let [conv, norm] = [0, 1].map(|i| format!("{name}.downsample.{i}"));
                    NormalizedConv::new(from, &conv, &norm, shortcut)
                });
                residuals.push(Residual { convolutions, shortcut: shortcut.transpose()? });
                inputs = outputs;
            }
            layers.push(residuals);
        }
        Ok(Self { stem, layers })
    }

    /// Features of a batch of pictures, finest first. Each is computed when it is taken.
    pub fn features(&self, pictures: Tensor<4>) -> impl Iterator<Item = Tensor<4>> {
        let x = self.stem.rectified(pictures);
        let pool = MaxPoolOptions::new([3, 3]).with_stride([2, 2]).with_padding([1, 1]);
        self.layers.iter().scan(Some(max_pool2d(x, pool)), |last, layer| {
            let x = layer.iter().fold(last.take()?, |x, block| block.forward(x));
            *last = Some(x.clone());
            Some(x)
        })
    }
}
