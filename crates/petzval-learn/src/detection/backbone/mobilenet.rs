//! MobileNetV2 (Sandler 2018) with frozen batch normalisation.

use burn::module::Module;
use burn::prelude::*;

use crate::detection::layers::{ConvShape, NormalizedConv};
use crate::detection::parameters::Parameters;
use crate::network::NetworkError;

/// Blocks of the network: factor by which the channels grow inside, channels behind, number of blocks, step of the first.
const BLOCKS: [(usize, usize, usize, usize); 7] = [
    (1, 16, 1, 1),
    (6, 24, 2, 2),
    (6, 32, 3, 2),
    (6, 64, 4, 2),
    (6, 96, 3, 1),
    (6, 160, 3, 2),
    (6, 320, 1, 1),
];

/// Channels of the first and the last convolution.
const ENDS: [usize; 2] = [32, 1280];

/// Numbers of the layers, counted from the first convolution, behind which features are taken.
const TAKEN_BEHIND: [usize; 4] = [3, 6, 13, 18];

/// Channels grow by a 1x1 convolution, each is filtered by a 3x3 kernel of its own, and they shrink again; the input is added where the shape
/// stays.
#[derive(Module, Debug)]
struct InvertedResidual {
    grow: Option<NormalizedConv>,
    filter: NormalizedConv,
    shrink: NormalizedConv,
    #[module(skip)]
    adds_input: bool,
}

impl InvertedResidual {
    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let grown = match &self.grow {
            Some(grow) => rectified(grow, x.clone()),
            None => x.clone(),
        };
        let y = self.shrink.forward(rectified(&self.filter, grown));
        if self.adds_input { x + y } else { y }
    }
}

/// Behind a rectifier that ends at 6.
fn rectified(conv: &NormalizedConv, x: Tensor<4>) -> Tensor<4> {
    conv.forward(x).clamp(0.0, 6.0)
}

/// The network up to its last convolution.
#[derive(Module, Debug)]
pub(crate) struct MobileNetV2 {
    first: NormalizedConv,
    blocks: Vec<InvertedResidual>,
    last: NormalizedConv,
}

impl MobileNetV2 {
    pub fn new(from: &Parameters, name: &str) -> Result<Self, NetworkError> {
        let conv = |at: String, shape: ConvShape| {
            NormalizedConv::new(from, &format!("{name}.{at}.0"), &format!("{name}.{at}.1"), shape)
        };
        let first = conv("0".to_owned(), ConvShape::new(3, ENDS[0], 3).halving())?;
        let (mut blocks, mut inputs) = (Vec::new(), ENDS[0]);
        for (growth, outputs, count, step) in BLOCKS {
            for i in 0..count {
                let (inside, step) = (growth * inputs, if i == 0 { step } else { 1 });
                let at = format!("{}.conv", blocks.len() + 1);
                // A block that does not grow lacks the first convolution, and the numbers of the others move up.
                let grow = if growth > 1 {
                    Some(conv(format!("{at}.0"), ConvShape::new(inputs, inside, 1))?)
                } else {
                    None
                };
                let filter = usize::from(grow.is_some());
                let name = format!("{name}.{at}");
                let shape = ConvShape { step, ..ConvShape::new(inside, inside, 3) };
                let [by, norm] = [0, 1].map(|part| format!("{name}.{filter}.{part}"));
                let filtered = NormalizedConv::depthwise(from, &by, &norm, shape)?;
                let [by, norm] = [1, 2].map(|part| format!("{name}.{}", filter + part));
                let shrink = NormalizedConv::new(from, &by, &norm, ConvShape::new(inside, outputs, 1))?;
                let adds_input = step == 1 && inputs == outputs;
                blocks.push(InvertedResidual { grow, filter: filtered, shrink, adds_input });
                inputs = outputs;
            }
        }
        let last = conv(format!("{}", blocks.len() + 1), ConvShape::new(inputs, ENDS[1], 1))?;
        Ok(Self { first, blocks, last })
    }

    /// Features of a batch of pictures, finest first. Each is computed when it is taken.
    pub fn features(&self, pictures: Tensor<4>) -> impl Iterator<Item = Tensor<4>> {
        let first = Some(rectified(&self.first, pictures));
        let mut blocks = self.blocks.iter();
        (0..TAKEN_BEHIND.len()).scan(first, move |last, level| {
            let before = level.checked_sub(1).map_or(0, |finer| TAKEN_BEHIND[finer]);
            let own = blocks.by_ref().take(TAKEN_BEHIND[level] - before);
            let x = own.fold(last.take()?, |x, block| block.forward(x));
            if level + 1 == TAKEN_BEHIND.len() {
                return Some(rectified(&self.last, x));
            }
            *last = Some(x.clone());
            Some(x)
        })
    }
}
