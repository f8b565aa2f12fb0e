//! 3x3 convolution on the CPU, forward and backward, on plain arrays.
//!
//! The loops keep a small block of the result in vector registers: eight output channels by two rows in the forward pass,
//! eight output channels by three kernel columns for the weight gradient. Each value is summed in a fixed order, so the
//! result does not depend on the number of threads.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::planes::{PlaneShape, Planes};

/// Output channels computed together.
const BLOCK: usize = 8;

/// Pixels whose weight gradient is summed in registers before the sums are stored. Eight channels of them fit in a 48 KiB
/// first-level cache.
const BAND: usize = 1024;

/// Input channels per task of the weight gradient.
const INPUTS_PER_TASK: usize = 16;

/// `y = leaky(b + sum over ci, i, j of w[co, ci, i, j] x[ci, r + i - 1, c + j - 1])`, zeros outside the picture.
///
/// `x`: `[batch, inputs, height, width]`; `weight`: `[outputs, inputs, 3, 3]`; `bias`: `[outputs]`;
/// `leaky(v) = v` for `v >= 0`, else `slope * v`. Returns `[batch, outputs, height, width]`.
pub(crate) fn forward(
    x: &[f32],
    weight: &[f32],
    bias: &[f32],
    inputs: usize,
    shape: PlaneShape,
    slope: f32,
) -> Vec<f32> {
    let padded = Planes::copy(x, inputs, inputs, shape, |v, _| v);
    let outputs = bias.len();
    let packed = pack(outputs, inputs, |output, input, tap| weight[(output * inputs + input) * 9 + tap]);
    correlate(&padded, &packed, bias, slope)
}

/// Gradients of [`forward`] with respect to `x`, `weight` and `bias`, from the cotangent `gradient` of its result `y`.
///
/// The sign of `y` shows which branch of the leaky rectifier was taken, because `slope` is positive. The gradient of `x` is
/// empty unless `wants_input`; those of `weight` and `bias` are empty unless `wants_weight`.
pub(crate) fn backward(
    x: &[f32],
    weight: &[f32],
    y: &[f32],
    gradient: &[f32],
    [outputs, inputs]: [usize; 2],
    shape: PlaneShape,
    slope: f32,
    [wants_input, wants_weight]: [bool; 2],
) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
    // Pull the cotangent back through the rectifier.
    let blocks = outputs.div_ceil(BLOCK);
    let masked =
        Planes::copy(
            gradient,
            outputs,
            blocks * BLOCK,
            shape,
            |g, i| if y[i] >= 0.0 { g } else { slope * g },
        );

    // The gradient of the input is a convolution with the kernel rotated by 180 degrees and inputs and outputs exchanged.
    let for_input = if wants_input {
        let packed = pack(inputs, masked.channels, |input, output, tap| {
            if output < outputs { weight[(output * inputs + input) * 9 + 8 - tap] } else { 0.0 }
        });
        correlate(&masked, &packed, &vec![0.0; inputs], 1.0)
    } else {
        Vec::new()
    };
    if !wants_weight {
        return (for_input, Vec::new(), Vec::new());
    }
    let padded = Planes::copy(x, inputs, inputs, shape, |v, _| v);
    (for_input, weight_gradient(&padded, &masked, outputs), bias_gradient(&masked, outputs))
}

/// Orders the weights for the forward loop: `[output block, input, column, row, output in block]`.
fn pack(outputs: usize, inputs: usize, weight: impl Fn(usize, usize, usize) -> f32) -> Vec<f32> {
    let mut packed = Vec::with_capacity(outputs.next_multiple_of(BLOCK) * inputs * 9);
    for block in 0..outputs.div_ceil(BLOCK) {
        for input in 0..inputs {
            for column in 0..3 {
                for row in 0..3 {
                    for output in block * BLOCK..(block + 1) * BLOCK {
                        packed.push(if output < outputs {
                            weight(output, input, row * 3 + column)
                        } else {
                            0.0
                        });
                    }
                }
            }
        }
    }
    packed
}

/// Convolves padded planes with packed weights: one task per picture and block of output channels.
fn correlate(x: &Planes, packed: &[f32], bias: &[f32], slope: f32) -> Vec<f32> {
    let shape = x.shape;
    let batch = x.data.len() / (x.channels * shape.stored());
    let mut out = vec![0.0; batch * bias.len() * shape.pixels()];
    out.par_chunks_mut(bias.len() * shape.pixels()).enumerate().for_each(|(item, picture)| {
        picture.par_chunks_mut(BLOCK * shape.pixels()).enumerate().for_each(|(block, out)| {
            let weights = &packed[block * x.channels * 9 * BLOCK..][..x.channels * 9 * BLOCK];
            let bias = &bias[block * BLOCK..];
            Arch::new().dispatch(CorrelateBlock { x: x.item(item), shape, weights, bias, slope, out });
        });
    });
    out
}

/// The convolution for up to eight output planes of one picture.
struct CorrelateBlock<'a> {
    x: &'a [f32],
    shape: PlaneShape,
    weights: &'a [f32],
    bias: &'a [f32],
    slope: f32,
    out: &'a mut [f32],
}

impl WithSimd for CorrelateBlock<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { x, shape, weights, bias, slope, out } = self;
        let (lanes, stride) = (S::F32_LANES, shape.stride());
        for row in (0..shape.height).step_by(2) {
            for column in (0..shape.width).step_by(lanes) {
                // Sum over input channels and kernel taps, for two rows of eight output channels at once.
                let mut sums = [[simd.splat_f32s(0.0); BLOCK]; 2];
                for (plane, weights) in x.chunks_exact(shape.stored()).zip(weights.chunks_exact(9 * BLOCK)) {
                    let rows: [&[f32]; 4] =
                        std::array::from_fn(|r| &plane[(row + r) * stride + column..][..lanes + 2]);
                    for (shift, weights) in weights.chunks_exact(3 * BLOCK).enumerate() {
                        let values: [S::f32s; 4] =
                            std::array::from_fn(|r| S::as_simd_f32s(&rows[r][shift..]).0[0]);
                        for (tap, weights) in weights.chunks_exact(BLOCK).enumerate() {
                            for channel in 0..BLOCK {
                                let weight = simd.splat_f32s(weights[channel]);
                                for r in 0..2 {
                                    sums[r][channel] =
                                        simd.mul_add_e_f32s(weight, values[tap + r], sums[r][channel]);
                                }
                            }
                        }
                    }
                }

                // Add the bias, rectify, and store the pixels inside the picture.
                let kept = lanes.min(shape.width - column);
                for r in 0..2.min(shape.height - row) {
                    for (channel, plane) in out.chunks_exact_mut(shape.pixels()).enumerate() {
                        let sum = simd.add_f32s(sums[r][channel], simd.splat_f32s(bias[channel]));
                        let low = simd.mul_f32s(sum, simd.splat_f32s(slope));
                        let negative = simd.less_than_f32s(sum, simd.splat_f32s(0.0));
                        let value = simd.select_f32s(negative, low, sum);
                        let line = &mut plane[(row + r) * shape.width + column..][..kept];
                        simd.partial_store_f32s(line, value);
                    }
                }
            }
        }
    }
}

/// `dw[co, ci, i, j] = sum over pictures and pixels of g[co, r, c] x[ci, r + i - 1, c + j - 1]`.
fn weight_gradient(x: &Planes, gradient: &Planes, outputs: usize) -> Vec<f32> {
    let inputs = x.channels;
    let mut out = vec![0.0; outputs * inputs * 9];
    out.par_chunks_mut(BLOCK * inputs * 9).enumerate().for_each(|(block, out)| {
        // Split the inputs too, so that narrow layers occupy every thread.
        let parts: Vec<(usize, Vec<f32>)> = (0..inputs)
            .into_par_iter()
            .step_by(INPUTS_PER_TASK)
            .map(|first| {
                let count = INPUTS_PER_TASK.min(inputs - first);
                (first, Arch::new().dispatch(WeightBlock { x, gradient, block, first, count }))
            })
            .collect();
        for (first, part) in parts {
            let count = part.len() / (BLOCK * 9);
            for (channel, out) in out.chunks_exact_mut(inputs * 9).enumerate() {
                out[first * 9..(first + count) * 9]
                    .copy_from_slice(&part[channel * count * 9..][..count * 9]);
            }
        }
    });
    out
}

/// The weight gradient of eight outputs and some inputs; returns `[output in block, input, 3, 3]`.
struct WeightBlock<'a> {
    x: &'a Planes,
    gradient: &'a Planes,
    block: usize,
    first: usize,
    count: usize,
}

impl WithSimd for WeightBlock<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
        let Self { x, gradient, block, first, count } = self;
        let shape = x.shape;
        let (lanes, stride, stored) = (S::F32_LANES, shape.stride(), shape.stored());
        let zero = simd.splat_f32s(0.0);
        let mut sums = vec![[[zero; 3]; BLOCK]; count * 3];
        let mut beside: Vec<[S::f32s; BLOCK]> = Vec::with_capacity(BAND / lanes);
        let batch = x.data.len() / (x.channels * stored);
        for item in 0..batch {
            let gradient = &gradient.item(item)[block * BLOCK * stored..][..BLOCK * stored];
            let x = &x.item(item)[first * stored..][..count * stored];

            // Treat the stored rows as one long line; the cotangent is 0 between rows, so the gaps add nothing. Process
            // the line in bands that stay in the cache while all inputs are correlated with them.
            let length = (shape.height * stride).next_multiple_of(lanes);
            for start in (0..length).step_by(BAND) {
                // Interleave the band of all eight channels, so that loads are aligned.
                let vectors = BAND.min(length - start) / lanes;
                let lines: [&[S::f32s]; BLOCK] = std::array::from_fn(|channel| {
                    &S::as_simd_f32s(&gradient[channel * stored..][..stored][start + stride + 1..]).0
                        [..vectors]
                });
                beside.clear();
                beside.extend((0..vectors).map(|i| lines.map(|line| line[i])));
                // Correlate the band with every input plane, one kernel row at a time.
                for (input, plane) in x.chunks_exact(stored).enumerate() {
                    for tap in 0..3 {
                        let near: [&[S::f32s]; 3] = std::array::from_fn(|shift| {
                            &S::as_simd_f32s(&plane[start + tap * stride + shift..]).0[..vectors]
                        });
                        let mut local = sums[input * 3 + tap];
                        for (i, gradients) in beside.iter().enumerate() {
                            let values = near.map(|line| line[i]);
                            for channel in 0..BLOCK {
                                let g = gradients[channel];
                                for shift in 0..3 {
                                    local[channel][shift] =
                                        simd.mul_add_e_f32s(g, values[shift], local[channel][shift]);
                                }
                            }
                        }
                        sums[input * 3 + tap] = local;
                    }
                }
            }
        }
        // Add the lanes of each sum.
        let mut out = Vec::with_capacity(BLOCK * count * 9);
        for channel in 0..BLOCK {
            for place in &sums {
                out.extend(place[channel].map(|sum| simd.reduce_sum_f32s(sum)));
            }
        }
        out
    }
}

/// `db[co] = sum over pictures and pixels of g[co, r, c]`, row sums in f32, then f64.
fn bias_gradient(gradient: &Planes, outputs: usize) -> Vec<f32> {
    let shape = gradient.shape;
    let batch = gradient.data.len() / (gradient.channels * shape.stored());
    (0..outputs)
        .into_par_iter()
        .map(|channel| {
            let total: f64 = (0..batch)
                .flat_map(|item| {
                    gradient.item(item)[channel * shape.stored()..][..shape.stored()].chunks(shape.stride())
                })
                .map(|row| f64::from(Arch::new().dispatch(Sum(row))))
                .sum();
            total as f32
        })
        .collect()
}

struct Sum<'a>(&'a [f32]);

impl WithSimd for Sum<'_> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f32 {
        let (body, rest) = S::as_simd_f32s(self.0);
        let sum = body.iter().fold(simd.splat_f32s(0.0), |sum, v| simd.add_f32s(sum, *v));
        simd.reduce_sum_f32s(sum) + rest.iter().sum::<f32>()
    }
}
