//! 1x1 convolution on the CPU with a normalisation or a gate in front of it, forward and backward, on plain arrays.
//!
//! A 1x1 convolution does little arithmetic per value, so its time is the time of reading and writing pictures. The loops
//! therefore work on strips of pixels that stay in the cache, and what precedes the convolution happens in the strip: the
//! picture between the two is never stored. Sums run over fixed spans of pixels, so the result does not depend on the number
//! of threads.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::planes::zeros;

/// Pixels of a strip.
const STRIP: usize = 256;

/// Values from one channel of a strip to the next. An odd number of cache lines, so that the channels of a pixel occupy
/// different sets of the cache.
const STRIDE: usize = STRIP + 16;

/// Pixels per task.
const SPAN: usize = 8 * STRIP;

/// Output channels computed together, and inputs whose weight gradient is summed in registers together.
const BLOCK: usize = 8;
const INPUTS: usize = 3;

/// Added to the variance over channels before the square root.
pub(crate) const VARIANCE_FLOOR: f32 = 1e-6;

/// What happens to the input of a 1x1 convolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Prologue {
    /// Nothing.
    Plain,
    /// `n = (x - mean(x)) / sqrt(mean((x - mean(x))^2) + 1e-6)`, means over the channels of a pixel.
    Normalize,
    /// `n[c] = x[c] x[c + inputs]`: the product of the two halves of the channels.
    Gate,
}

/// Sizes of a 1x1 convolution.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PointwiseShape {
    pub prologue: Prologue,
    /// Input channels of the convolution, behind the prologue.
    pub inputs: usize,
    pub outputs: usize,
    /// Pixels of one picture.
    pub pixels: usize,
}

impl PointwiseShape {
    /// Channels of the picture in front of the prologue.
    pub fn picture_channels(self) -> usize {
        if self.prologue == Prologue::Gate { 2 * self.inputs } else { self.inputs }
    }

    /// Spans of one picture.
    fn spans(self) -> usize {
        self.pixels.div_ceil(SPAN)
    }

    /// The picture of a task, and its first pixel.
    fn place(self, x: &[f32], task: usize) -> (&[f32], usize) {
        let length = self.picture_channels() * self.pixels;
        (&x[task / self.spans() * length..][..length], task % self.spans() * SPAN)
    }
}

/// `y[co, p] = b[co] + sum over ci of w[co, ci] n[ci, p]`, where `n` is the input behind the prologue.
///
/// `x`: `[batch, picture_channels, pixels]`; `weight`: `[outputs, inputs]`; `bias`: `[outputs]`. Returns
/// `[batch, outputs, pixels]`.
pub(crate) fn forward(shape: PointwiseShape, x: &[f32], weight: &[f32], bias: &[f32]) -> Vec<f32> {
    let PointwiseShape { inputs, outputs, pixels, .. } = shape;
    let packed = pack(outputs, inputs, |output, input| weight[output * inputs + input]);
    let batch = x.len() / (shape.picture_channels() * pixels);
    let mut y = zeros(batch * outputs * pixels);
    tasks(&mut y, outputs, pixels).into_par_iter().enumerate().for_each(|(task, out)| {
        let (picture, first) = shape.place(x, task);
        Arch::new().dispatch(ForwardSpan { shape, picture, first, packed: &packed, bias, out });
    });
    y
}

/// Gradients of [`forward`] with respect to `x`, `weight` and `bias`, from the cotangent `gradient` of its result. Without `wants_input`
/// that of `x` is zero; without `wants_weight` those of `weight` and `bias` are.
pub(crate) fn backward(
    shape: PointwiseShape,
    x: &[f32],
    weight: &[f32],
    gradient: &[f32],
    wanted: [bool; 2],
) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
    let PointwiseShape { inputs, outputs, pixels, .. } = shape;
    let transposed = pack(inputs, outputs, |input, output| weight[output * inputs + input]);
    let mut for_x = zeros(x.len());
    let parts: Vec<(Vec<f32>, Vec<f32>)> = tasks(&mut for_x, shape.picture_channels(), pixels)
        .into_par_iter()
        .enumerate()
        .map(|(task, out)| {
            let (picture, first) = shape.place(x, task);
            let length = outputs * pixels;
            let gradient = &gradient[task / shape.spans() * length..][..length];
            let packed = &transposed;
            Arch::new().dispatch(BackwardSpan { shape, picture, gradient, first, packed, wanted, out })
        })
        .collect();

    // Add the spans in their order.
    let (mut for_weight, mut for_bias) = (vec![0.0; outputs * inputs], vec![0.0; outputs]);
    for (weight, bias) in &parts {
        for_weight.iter_mut().zip(weight).for_each(|(sum, v)| *sum += v);
        for_bias.iter_mut().zip(bias).for_each(|(sum, v)| *sum += v);
    }
    (for_x, for_weight, for_bias)
}

/// Splits pictures `[batch, channels, pixels]` into the spans that tasks write: the slices of all channels of each span.
fn tasks(values: &mut [f32], channels: usize, pixels: usize) -> Vec<Vec<&mut [f32]>> {
    let mut tasks = Vec::new();
    for picture in values.chunks_mut(channels * pixels) {
        let first = tasks.len();
        tasks.extend((0..pixels.div_ceil(SPAN)).map(|_| Vec::with_capacity(channels)));
        for plane in picture.chunks_mut(pixels) {
            for (span, slice) in plane.chunks_mut(SPAN).enumerate() {
                tasks[first + span].push(slice);
            }
        }
    }
    tasks
}

/// Orders weights for [`mix`]: `[output block, input, output in block]`.
fn pack(outputs: usize, inputs: usize, weight: impl Fn(usize, usize) -> f32) -> Vec<f32> {
    let mut packed = Vec::with_capacity(outputs.next_multiple_of(BLOCK) * inputs);
    for first in (0..outputs).step_by(BLOCK) {
        for input in 0..inputs {
            let block = first..first + BLOCK;
            packed.extend(block.map(|output| if output < outputs { weight(output, input) } else { 0.0 }));
        }
    }
    packed
}

/// A strip with `channels` channels, rounded up to whole blocks and whole triples of inputs.
fn strip(channels: usize) -> Vec<f32> {
    vec![0.0; channels.next_multiple_of(BLOCK * INPUTS) * STRIDE]
}

/// `to[co, p] = sum over ci of packed[co, ci] from[ci, p]` for the first `count` pixels of two strips.
#[inline(always)]
fn mix<S: Simd>(simd: S, from: &[f32], inputs: usize, packed: &[f32], count: usize, to: &mut [f32]) {
    let lanes = S::F32_LANES;
    for pixel in (0..count).step_by(2 * lanes) {
        for (block, weights) in packed.chunks_exact(inputs * BLOCK).enumerate() {
            let mut sums = [[simd.splat_f32s(0.0); BLOCK]; 2];
            for (line, weights) in from.chunks_exact(STRIDE).zip(weights.chunks_exact(BLOCK)) {
                let near = &line[pixel..][..2 * lanes];
                let values = [&near[..lanes], &near[lanes..]].map(|v| S::as_simd_f32s(v).0[0]);
                for channel in 0..BLOCK {
                    let weight = simd.splat_f32s(weights[channel]);
                    for half in 0..2 {
                        sums[half][channel] = simd.mul_add_e_f32s(weight, values[half], sums[half][channel]);
                    }
                }
            }
            for (channel, line) in
                to[block * BLOCK * STRIDE..].chunks_exact_mut(STRIDE).take(BLOCK).enumerate()
            {
                let out = S::as_mut_simd_f32s(&mut line[pixel..][..2 * lanes]).0;
                (out[0], out[1]) = (sums[0][channel], sums[1][channel]);
            }
        }
    }
}

/// `sum += a b` and `sum += a`, pixel by pixel.
#[inline(always)]
fn add_product(sum: &mut [f32], a: &[f32], b: &[f32]) {
    sum.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
}

#[inline(always)]
fn add(sum: &mut [f32], a: &[f32]) {
    sum.iter_mut().zip(a).for_each(|(sum, a)| *sum += a);
}

/// Copies a strip of the picture into `to` through the prologue; pixels beyond `count` become 0. `scale` receives the
/// factor of the normalisation of each pixel.
#[inline(always)]
fn load(
    shape: PointwiseShape,
    picture: &[f32],
    pixel: usize,
    count: usize,
    to: &mut [f32],
    scale: &mut [f32; STRIP],
) {
    let channel = |c: usize| &picture[c * shape.pixels + pixel..][..count];
    for (c, line) in to.chunks_exact_mut(STRIDE).take(shape.inputs).enumerate() {
        line[count..].fill(0.0);
        if shape.prologue == Prologue::Gate {
            let halves = channel(c).iter().zip(channel(c + shape.inputs));
            line.iter_mut().zip(halves).for_each(|(n, (a, b))| *n = a * b);
        } else {
            line[..count].copy_from_slice(channel(c));
        }
    }
    if shape.prologue == Prologue::Normalize {
        // Subtract the mean over the channels, then divide by the standard deviation.
        let share = 1.0 / shape.inputs as f32;
        let (mut mean, mut variance) = ([0.0; STRIP], [0.0; STRIP]);
        let lines = || 0..shape.inputs;
        for c in lines() {
            add(&mut mean, &to[c * STRIDE..][..STRIP]);
        }
        mean.iter_mut().for_each(|m| *m *= share);
        for c in lines() {
            let line = &mut to[c * STRIDE..][..STRIP];
            line.iter_mut().zip(&mean).for_each(|(v, m)| *v -= m);
            add_product(&mut variance, line, line);
        }
        scale.iter_mut().zip(&variance).for_each(|(s, v)| *s = 1.0 / (v * share + VARIANCE_FLOOR).sqrt());
        for c in lines() {
            to[c * STRIDE..][..STRIP].iter_mut().zip(scale.iter()).for_each(|(v, s)| *v *= s);
        }
    }
}

/// The forward pass of one span; `out` holds its pixels of every output channel.
struct ForwardSpan<'a> {
    shape: PointwiseShape,
    picture: &'a [f32],
    first: usize,
    packed: &'a [f32],
    bias: &'a [f32],
    out: Vec<&'a mut [f32]>,
}

impl WithSimd for ForwardSpan<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { shape, picture, first, packed, bias, mut out } = self;
        let (mut from, mut to, mut scale) = (strip(shape.inputs), strip(shape.outputs), [0.0; STRIP]);
        let length = out.first().map_or(0, |out| out.len());
        for start in (0..length).step_by(STRIP) {
            let count = STRIP.min(length - start);
            load(shape, picture, first + start, count, &mut from, &mut scale);
            mix(simd, &from, shape.inputs, packed, count, &mut to);
            for ((out, line), bias) in out.iter_mut().zip(to.chunks_exact(STRIDE)).zip(bias) {
                out[start..][..count].iter_mut().zip(line).for_each(|(y, v)| *y = v + bias);
            }
        }
    }
}

/// The backward pass of one span; `out` holds its pixels of the gradient of every channel of the picture. Returns the
/// span's gradients of the weight and the bias.
struct BackwardSpan<'a> {
    shape: PointwiseShape,
    picture: &'a [f32],
    gradient: &'a [f32],
    first: usize,
    packed: &'a [f32],
    /// Whether the gradient of the picture is wanted, and that of weight and bias.
    wanted: [bool; 2],
    out: Vec<&'a mut [f32]>,
}

impl WithSimd for BackwardSpan<'_> {
    type Output = (Vec<f32>, Vec<f32>);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { shape, picture, gradient, first, packed, wanted: [wants_input, wants_weight], mut out } =
            self;
        let PointwiseShape { prologue, inputs, outputs, pixels, .. } = shape;
        let lanes = S::F32_LANES;
        let (mut from, mut pulled, mut to) = (strip(inputs), strip(outputs), strip(inputs));
        let mut scale = [0.0; STRIP];
        let zero = simd.splat_f32s(0.0);
        let (blocks, triples) = (outputs.div_ceil(BLOCK), inputs.div_ceil(INPUTS));
        let mut weight_sums = vec![[[zero; INPUTS]; BLOCK]; blocks * triples];
        let mut bias_sums = vec![zero; outputs];
        let length = out.first().map_or(0, |out| out.len());
        for start in (0..length).step_by(STRIP) {
            let count = STRIP.min(length - start);
            let pixel = first + start;
            load(shape, picture, pixel, count, &mut from, &mut scale);
            for (c, line) in pulled.chunks_exact_mut(STRIDE).take(outputs).enumerate() {
                line[..count].copy_from_slice(&gradient[c * pixels + pixel..][..count]);
                line[count..].fill(0.0);
            }

            // Sum the products of cotangent and input into the weight gradient.
            let blocks = if wants_weight { blocks } else { 0 };
            for (sums, block) in
                weight_sums.chunks_exact_mut(triples).zip(pulled.chunks_exact(BLOCK * STRIDE)).take(blocks)
            {
                for (sums, lines) in sums.iter_mut().zip(from.chunks_exact(INPUTS * STRIDE)) {
                    let mut local = *sums;
                    for pixel in (0..count).step_by(lanes) {
                        let near = &lines[pixel..][..(INPUTS - 1) * STRIDE + lanes];
                        let values: [S::f32s; INPUTS] =
                            std::array::from_fn(|i| S::as_simd_f32s(&near[i * STRIDE..][..lanes]).0[0]);
                        let near = &block[pixel..][..(BLOCK - 1) * STRIDE + lanes];
                        for channel in 0..BLOCK {
                            let g = S::as_simd_f32s(&near[channel * STRIDE..][..lanes]).0[0];
                            for i in 0..INPUTS {
                                local[channel][i] = simd.mul_add_e_f32s(g, values[i], local[channel][i]);
                            }
                        }
                    }
                    *sums = local;
                }
            }
            for (sum, line) in bias_sums.iter_mut().zip(pulled.chunks_exact(STRIDE)) {
                for v in &S::as_simd_f32s(line).0[..count.div_ceil(lanes)] {
                    *sum = simd.add_f32s(*sum, *v);
                }
            }

            if !wants_input {
                continue;
            }
            // Pull the cotangent back through the weights, then through the prologue.
            mix(simd, &pulled, outputs, packed, count, &mut to);
            if prologue == Prologue::Normalize {
                denormalize(inputs, &from, &scale, &mut to);
            }
            for (c, line) in to.chunks_exact(STRIDE).take(inputs).enumerate() {
                if prologue == Prologue::Gate {
                    // Each half receives the cotangent times the other half.
                    for (half, other) in [(c, c + inputs), (c + inputs, c)] {
                        let other = &picture[other * pixels + pixel..][..count];
                        let to = &mut out[half][start..][..count];
                        to.iter_mut().zip(line.iter().zip(other)).for_each(|(to, (g, x))| *to = g * x);
                    }
                } else {
                    out[c][start..][..count].copy_from_slice(&line[..count]);
                }
            }
        }

        // Add the lanes of each sum. Loops, because the closure of an iterator is compiled without the vector instructions.
        let mut for_weight = vec![0.0; outputs * inputs];
        for (output, row) in for_weight.chunks_exact_mut(inputs).enumerate() {
            let sums = &weight_sums[output / BLOCK * triples..][..triples];
            for (input, out) in row.iter_mut().enumerate() {
                *out = simd.reduce_sum_f32s(sums[input / INPUTS][output % BLOCK][input % INPUTS]);
            }
        }
        let mut for_bias = vec![0.0; outputs];
        for (out, sum) in for_bias.iter_mut().zip(&bias_sums) {
            *out = simd.reduce_sum_f32s(*sum);
        }
        (for_weight, for_bias)
    }
}

/// `dx = scale (dn - mean(dn) - n mean(n dn))`: the adjoint of the normalisation, in place. `n` is the normalised strip.
#[inline(always)]
fn denormalize(inputs: usize, n: &[f32], scale: &[f32; STRIP], strip: &mut [f32]) {
    let (mut mean, mut along) = ([0.0; STRIP], [0.0; STRIP]);
    for c in 0..inputs {
        let (line, n) = (&strip[c * STRIDE..][..STRIP], &n[c * STRIDE..][..STRIP]);
        add(&mut mean, line);
        add_product(&mut along, line, n);
    }
    let share = 1.0 / inputs as f32;
    for c in 0..inputs {
        let (line, n) = (&mut strip[c * STRIDE..][..STRIP], &n[c * STRIDE..][..STRIP]);
        for p in 0..STRIP {
            line[p] = scale[p] * (line[p] - share * (mean[p] + n[p] * along[p]));
        }
    }
}
