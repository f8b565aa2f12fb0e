//! Convolutions as values: which kind, of which shape. The networks and losses name each one that they compute, so that a device can be checked
//! with exactly those that a training needs.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use burn::prelude::*;
use burn::tensor::module::conv2d;
use burn::tensor::ops::ConvOptions;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A convolution of planes `[batch, inputs, height, width]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Convolution {
    /// Its kind.
    pub kind: ConvolutionKind,
    /// Shape of its input: batch, channels, height, width.
    pub input: [usize; 4],
    /// Channels of its result.
    pub outputs: usize,
    /// Rows and columns of its kernel.
    pub kernel: [usize; 2],
    /// Pixels from one result to the next.
    pub step: usize,
    /// Rows and columns of zeros around the input.
    pub border: usize,
}

/// A kind of convolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ConvolutionKind {
    /// Every output sees all inputs.
    Full,
    /// Every channel has a kernel of its own.
    Depthwise,
    /// 1x1.
    Pointwise,
    /// 1x1 behind a normalisation over the channels.
    Normalized,
    /// 1x1 behind the product of the two halves of the channels.
    Gated,
    /// Of a loss: by the tensor framework on every device.
    Loss,
}

impl Convolution {
    /// The same of another number of pictures.
    pub fn with_batch(self, batch: usize) -> Self {
        let [_, channels, height, width] = self.input;
        Self { input: [batch, channels, height, width], ..self }
    }

    /// Shape of its result.
    pub fn output(&self) -> [usize; 4] {
        let [batch, _, height, width] = self.input;
        let side = |n: usize, kernel: usize| (n + 2 * self.border - kernel) / self.step + 1;
        [batch, self.outputs, side(height, self.kernel[0]), side(width, self.kernel[1])]
    }

    /// Multiplications of the forward pass.
    pub fn products(&self) -> f64 {
        let [batch, channels, height, width] = self.input.map(|n| n as f64);
        let pixels = batch * height * width / (self.step * self.step) as f64;
        let seen = match self.kind {
            ConvolutionKind::Depthwise => 1.0,
            ConvolutionKind::Gated => channels / 2.0,
            _ => channels,
        };
        pixels * seen * (self.outputs * self.kernel[0] * self.kernel[1]) as f64
    }
}

impl std::fmt::Display for Convolution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            kind,
            input: [batch, channels, height, width],
            outputs,
            kernel: [rows, columns],
            step,
            ..
        } = self;
        let kind = match kind {
            ConvolutionKind::Full => "full",
            ConvolutionKind::Depthwise => "depthwise",
            ConvolutionKind::Pointwise => "pointwise",
            ConvolutionKind::Normalized => "normalized",
            ConvolutionKind::Gated => "gated",
            ConvolutionKind::Loss => "loss",
        };
        write!(f, "{kind} {rows}x{columns}")?;
        if *step > 1 {
            write!(f, " step {step}")?;
        }
        write!(f, ", {batch} x {channels} x {height} x {width} to {outputs}")
    }
}

/// Whether someone collects convolutions; the collection itself is behind a lock.
static IS_COLLECTED: AtomicBool = AtomicBool::new(false);
static COLLECTED: Mutex<BTreeSet<Convolution>> = Mutex::new(BTreeSet::new());
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Notes a convolution that is about to be computed.
pub(crate) fn note(convolution: Convolution) {
    if IS_COLLECTED.load(Ordering::Relaxed) {
        COLLECTED.lock().unwrap_or_else(PoisonError::into_inner).insert(convolution);
    }
}

/// Does some work, and collects every convolution that networks and losses compute meanwhile, in this thread or another.
///
/// Work of others in the same process may add convolutions of its own.
pub fn collect<R>(work: impl FnOnce() -> R) -> (R, BTreeSet<Convolution>) {
    /// Ends the collection, also where the work panics.
    struct Collection;

    impl Drop for Collection {
        fn drop(&mut self) {
            IS_COLLECTED.store(false, Ordering::Relaxed);
        }
    }

    let _one = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    COLLECTED.lock().unwrap_or_else(PoisonError::into_inner).clear();
    IS_COLLECTED.store(true, Ordering::Relaxed);
    let collection = Collection;
    let found = work();
    drop(collection);
    (found, std::mem::take(&mut COLLECTED.lock().unwrap_or_else(PoisonError::into_inner)))
}

/// A convolution of a loss, whose kernel `[outputs, inputs, rows, columns]` is held: by the tensor framework on every device.
pub(crate) fn of_loss(
    x: Tensor<4>,
    weight: Tensor<4>,
    bias: Option<Tensor<1>>,
    step: usize,
    border: usize,
) -> Tensor<4> {
    let [outputs, _, rows, columns] = weight.dims();
    let kind = ConvolutionKind::Loss;
    note(Convolution { kind, input: x.dims(), outputs, kernel: [rows, columns], step, border });
    conv2d(x, weight, bias, ConvOptions::new([step; 2], [border; 2], [1; 2], 1))
}
