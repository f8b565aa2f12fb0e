//! Convolution on the CPU, forward and backward, on plain arrays.
//!
//! Every tap of the kernel and every input channel is one "line": the same padded planes, read from another place. A result
//! is a sum over lines, so the size of the kernel appears only in the list of lines. A convolution that keeps every second
//! pixel first sorts the picture into four quarters by the parity of row and column; within a quarter its lines are dense.
//!
//! The loops keep a small block of the result in vector registers: eight output channels by two rows in the forward pass,
//! eight output channels by three lines for the weight gradient. Each value is summed in a fixed order, so the result does
//! not depend on the number of threads.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::planes::{PlaneShape, Planes, zeros};

/// Output channels computed together.
const BLOCK: usize = 8;

/// Pixels whose weight gradient is summed in registers before the sums are stored. Eight channels of them fit in a 48 KiB
/// first-level cache.
const BAND: usize = 1024;

/// Lines whose weight gradient is summed in registers together.
const LINES: usize = 3;

/// Lines per task of the weight gradient: 16 input channels of a 3x3 kernel.
const LINES_PER_TASK: usize = 16 * 9;

/// Sizes of a convolution with a square kernel and zeros outside the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ConvShape {
    pub inputs: usize,
    pub outputs: usize,
    /// Rows and columns of the kernel, odd.
    pub kernel: usize,
    /// Distance between the centres of neighbouring results: 1, or 2 to halve the picture.
    pub step: usize,
    /// Height and width of the input.
    pub size: [usize; 2],
}

impl ConvShape {
    /// Planes of the result, `ceil(size / step)`, with the border of the kernel.
    pub fn result(self) -> PlaneShape {
        let [height, width] = self.size.map(|n| n.div_ceil(self.step));
        PlaneShape { height, width, border: self.kernel / 2 }
    }

    /// Weights per pair of channels.
    pub fn taps(self) -> usize {
        self.kernel * self.kernel
    }

    /// The input in planes of the shape of the result.
    fn input(self, x: &[f32]) -> Planes {
        match self.step {
            1 => Planes::copy(x, self.inputs, self.inputs, self.result(), |v, _| v),
            _ => Planes::quarters(x, self.inputs, self.size, self.result()),
        }
    }

    /// Where the taps of all input channels start in the planes of [`input`](Self::input): `[input, row, column]`.
    fn lines(self) -> Vec<usize> {
        let (plane, step) = (self.result(), self.step);
        let tap = |input: usize, i: usize, j: usize| {
            let quarter = (input * step + i % step) * step + j % step;
            quarter * plane.stored() + i / step * plane.stride() + j / step
        };
        (0..self.inputs)
            .flat_map(|input| (0..self.taps()).map(move |t| tap(input, t / self.kernel, t % self.kernel)))
            .collect()
    }
}

/// `y = leaky(b + sum over ci, i, j of w[co, ci, i, j] x[ci, step r + i - k, step c + j - k])`, zeros outside the picture,
/// with `k = kernel / 2`.
///
/// `x`: `[batch, inputs, height, width]`; `weight`: `[outputs, inputs, kernel, kernel]`; `bias`: `[outputs]`;
/// `leaky(v) = v` for `v >= 0`, else `slope * v`. Returns `[batch, outputs, ceil(height / step), ceil(width / step)]`.
pub(crate) fn forward(conv: ConvShape, x: &[f32], weight: &[f32], bias: &[f32], slope: f32) -> Vec<f32> {
    let lines = conv.lines();
    let packed = pack(conv.outputs, lines.len(), |output, line| weight[output * lines.len() + line]);
    correlate(&conv.input(x), &lines, &packed, bias, slope)
}

/// Gradients of [`forward`] with respect to `x`, `weight` and `bias`, from the cotangent `gradient` of its result `y`.
///
/// The sign of `y` shows which branch of the leaky rectifier was taken, because `slope` is positive. The gradient of `x` is
/// empty unless `wants_input`; those of `weight` and `bias` are empty unless `wants_weight`.
pub(crate) fn backward(
    conv: ConvShape,
    x: &[f32],
    weight: &[f32],
    y: &[f32],
    gradient: &[f32],
    slope: f32,
    [wants_input, wants_weight]: [bool; 2],
) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
    // Pull the cotangent back through the rectifier.
    let stored_channels = conv.outputs.next_multiple_of(BLOCK);
    let rectified = |g: f32, i: usize| if y[i] >= 0.0 { g } else { slope * g };
    let masked = Planes::copy(gradient, conv.outputs, stored_channels, conv.result(), rectified);

    let for_input = if wants_input { input_gradient(conv, weight, &masked) } else { Vec::new() };
    if !wants_weight {
        return (for_input, Vec::new(), Vec::new());
    }
    let for_weight = weight_gradient(&conv.input(x), &conv.lines(), &masked, conv.outputs);
    (for_input, for_weight, bias_gradient(&masked, conv.outputs))
}

/// `dx[ci, u, v] = sum over co, i, j of w[co, ci, i, j] g[co, (u + k - i) / step, (v + k - j) / step]`, where both divisions
/// leave no remainder: a convolution of the cotangent with some of the taps for each parity of `u` and `v`.
fn input_gradient(conv: ConvShape, weight: &[f32], gradient: &Planes) -> Vec<f32> {
    let ConvShape { inputs, outputs, kernel, step, size: [height, width] } = conv;
    let plane = conv.result();
    let quarter = |parity: [usize; 2]| {
        // The taps that reach pixels of this parity, and the row or column of the cotangent that each reads.
        let reach = |parity: usize| {
            let shifted = parity + plane.border;
            (0..kernel)
                .filter(move |i| i % step == shifted % step)
                .map(move |i| (i, shifted / step + plane.border - i / step))
        };
        let taps: Vec<(usize, usize)> = reach(parity[0])
            .flat_map(|(i, row)| {
                reach(parity[1]).map(move |(j, column)| (i * kernel + j, row * plane.stride() + column))
            })
            .collect();
        let lines: Vec<usize> = (0..outputs)
            .flat_map(|output| taps.iter().map(move |(_, place)| output * plane.stored() + place))
            .collect();
        let packed = pack(inputs, lines.len(), |input, line| {
            let (output, tap) = (line / taps.len(), taps[line % taps.len()].0);
            weight[(output * inputs + input) * conv.taps() + tap]
        });
        correlate(gradient, &lines, &packed, &vec![0.0; inputs], 1.0)
    };
    if step == 1 {
        return quarter([0, 0]);
    }

    // Sort the four quarters back into one picture.
    let quarters = [quarter([0, 0]), quarter([0, 1]), quarter([1, 0]), quarter([1, 1])];
    let mut out = zeros(gradient.batch() * inputs * height * width);
    out.par_chunks_mut(height * width).enumerate().for_each(|(channel, picture)| {
        for (row, line) in picture.chunks_exact_mut(width).enumerate() {
            let start = channel * plane.pixels() + row / 2 * plane.width;
            let [even, odd] = [0, 1].map(|j| &quarters[row % 2 * 2 + j][start..][..plane.width]);
            for (pair, (even, odd)) in line.chunks_mut(2).zip(even.iter().zip(odd)) {
                pair[0] = *even;
                if let Some(last) = pair.get_mut(1) {
                    *last = *odd;
                }
            }
        }
    });
    out
}

/// Orders the weights for the forward loop: `[output block, line, output in block]`.
fn pack(outputs: usize, lines: usize, weight: impl Fn(usize, usize) -> f32) -> Vec<f32> {
    let mut packed = Vec::with_capacity(outputs.next_multiple_of(BLOCK) * lines);
    for block in 0..outputs.div_ceil(BLOCK) {
        for line in 0..lines {
            packed.extend(
                (block * BLOCK..(block + 1) * BLOCK)
                    .map(|output| if output < outputs { weight(output, line) } else { 0.0 }),
            );
        }
    }
    packed
}

/// Convolves padded planes with packed weights: one task per picture and block of output channels.
fn correlate(x: &Planes, lines: &[usize], packed: &[f32], bias: &[f32], slope: f32) -> Vec<f32> {
    let shape = x.shape;
    let mut out = zeros(x.batch() * bias.len() * shape.pixels());
    out.par_chunks_mut(bias.len() * shape.pixels()).enumerate().for_each(|(item, picture)| {
        picture.par_chunks_mut(BLOCK * shape.pixels()).enumerate().for_each(|(block, out)| {
            let weights = &packed[block * lines.len() * BLOCK..][..lines.len() * BLOCK];
            let bias = &bias[block * BLOCK..];
            Arch::new().dispatch(CorrelateBlock { x: x.item(item), shape, lines, weights, bias, slope, out });
        });
    });
    out
}

/// The convolution for up to eight output planes of one picture.
struct CorrelateBlock<'a> {
    x: &'a [f32],
    shape: PlaneShape,
    lines: &'a [usize],
    weights: &'a [f32],
    bias: &'a [f32],
    slope: f32,
    out: &'a mut [f32],
}

impl WithSimd for CorrelateBlock<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { x, shape, lines, weights, bias, slope, out } = self;
        let (lanes, stride) = (S::F32_LANES, shape.stride());
        for row in (0..shape.height).step_by(2) {
            for column in (0..shape.width).step_by(lanes) {
                // Sum over all lines, for two rows of eight output channels at once.
                let x = &x[row * stride + column..];
                let mut sums = [[simd.splat_f32s(0.0); BLOCK]; 2];
                for (line, weights) in lines.iter().zip(weights.chunks_exact(BLOCK)) {
                    let near = &x[*line..][..stride + lanes];
                    let values = [&near[..lanes], &near[stride..]].map(|row| S::as_simd_f32s(row).0[0]);
                    for channel in 0..BLOCK {
                        let weight = simd.splat_f32s(weights[channel]);
                        for r in 0..2 {
                            sums[r][channel] = simd.mul_add_e_f32s(weight, values[r], sums[r][channel]);
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

/// `dw[co, line] = sum over pictures and pixels of g[co, r, c] x[line, r, c]`.
fn weight_gradient(x: &Planes, lines: &[usize], gradient: &Planes, outputs: usize) -> Vec<f32> {
    let mut out = vec![0.0; outputs * lines.len()];
    out.par_chunks_mut(BLOCK * lines.len()).enumerate().for_each(|(block, out)| {
        // Split the lines too, so that narrow layers occupy every thread.
        let parts: Vec<Vec<f32>> = lines
            .par_chunks(LINES_PER_TASK)
            .map(|lines| Arch::new().dispatch(WeightBlock { x, lines, gradient, block }))
            .collect();
        for (channel, out) in out.chunks_exact_mut(lines.len()).enumerate() {
            for (part, out) in parts.iter().zip(out.chunks_mut(LINES_PER_TASK)) {
                out.copy_from_slice(&part[channel * out.len()..][..out.len()]);
            }
        }
    });
    out
}

/// The weight gradient of eight outputs and some lines; returns `[output in block, line]`.
struct WeightBlock<'a> {
    x: &'a Planes,
    lines: &'a [usize],
    gradient: &'a Planes,
    block: usize,
}

impl WithSimd for WeightBlock<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
        let Self { x, lines, gradient, block } = self;
        let shape = x.shape;
        let (lanes, stride, stored) = (S::F32_LANES, shape.stride(), shape.stored());
        let zero = simd.splat_f32s(0.0);
        let mut sums = vec![[[zero; LINES]; BLOCK]; lines.len().div_ceil(LINES)];
        let mut beside = vec![[zero; BLOCK]; BAND / lanes];
        for item in 0..x.batch() {
            let gradient = &gradient.item(item)[block * BLOCK * stored..][..BLOCK * stored];
            let x = x.item(item);

            // Treat the stored rows as one long line; the cotangent is 0 between rows, so the gaps add nothing. Process
            // the line in bands that stay in the cache while all inputs are correlated with them.
            let length = (shape.height * stride).next_multiple_of(lanes);
            for start in (0..length).step_by(BAND) {
                // Interleave the band of all eight channels, so that loads are aligned.
                let vectors = BAND.min(length - start) / lanes;
                let planes: [&[S::f32s]; BLOCK] = std::array::from_fn(|channel| {
                    &S::as_simd_f32s(&gradient[channel * stored..][..stored][start + shape.first()..]).0
                        [..vectors]
                });
                for (i, beside) in beside[..vectors].iter_mut().enumerate() {
                    *beside = std::array::from_fn(|channel| planes[channel][i]);
                }
                // Correlate the band with three lines at a time. The last lines repeat if there are fewer.
                for (sums, lines) in sums.iter_mut().zip(lines.chunks(LINES)) {
                    let near: [&[S::f32s]; LINES] = std::array::from_fn(|i| {
                        let line = lines[i.min(lines.len() - 1)];
                        &S::as_simd_f32s(&x[line + start..]).0[..vectors]
                    });
                    let mut local = *sums;
                    for (i, gradients) in beside[..vectors].iter().enumerate() {
                        let values = near.map(|line| line[i]);
                        for channel in 0..BLOCK {
                            let g = gradients[channel];
                            for line in 0..LINES {
                                local[channel][line] =
                                    simd.mul_add_e_f32s(g, values[line], local[channel][line]);
                            }
                        }
                    }
                    *sums = local;
                }
            }
        }
        // Add the lanes of each sum. Loops, because the closure of an iterator is compiled without the vector instructions.
        let mut out = vec![0.0; BLOCK * lines.len()];
        for (channel, out) in out.chunks_exact_mut(lines.len()).enumerate() {
            for (line, out) in out.iter_mut().enumerate() {
                *out = simd.reduce_sum_f32s(sums[line / LINES][channel][line % LINES]);
            }
        }
        out
    }
}

/// `db[co] = sum over pictures and pixels of g[co, r, c]`, row sums in f32, then f64.
fn bias_gradient(gradient: &Planes, outputs: usize) -> Vec<f32> {
    let shape = gradient.shape;
    (0..outputs)
        .into_par_iter()
        .map(|channel| {
            let total: f64 = (0..gradient.batch())
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
        let mut sum = simd.splat_f32s(0.0);
        for v in body {
            sum = simd.add_f32s(sum, *v);
        }
        simd.reduce_sum_f32s(sum) + rest.iter().sum::<f32>()
    }
}
