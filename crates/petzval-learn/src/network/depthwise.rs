//! A convolution of each channel with a kernel of its own, as one differentiable operation.
//!
//! Every plane is a task: it is copied into a zero-bordered plane that stays in the cache, and convolved there.
//! Measured against the framework, CPU time, batch 4, 32 channels, 96 x 96, forward and backward: 3x3 7 against 26 ms, 7x7 15
//! against 84 ms.

use std::sync::Arc;

use burn::{
    prelude::*,
    tensor::{module::conv2d, ops::ConvOptions},
};
#[cfg(any(feature = "wgpu", feature = "cuda"))]
use petzval_camera::tape::DeviceForm;
use petzval_camera::tape::{Kernel, View, apply, computes_in_place};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::convolution::{self, Convolution, ConvolutionKind};

use super::planes::PlaneShape;

/// `y[c, r, s] = bias[c] + sum over i, j of weight[c, i, j] x[c, r + i - k, s + j - k]`, zeros outside, `k = kernel / 2`.
///
/// Shapes: `x` and the result `[batch, channels, height, width]`, `weight` `[channels, kernel, kernel]` with an odd `kernel` of
/// at most 15, `bias` `[channels]`. Numbers other than f32 use the framework's own operations.
///
/// # Panics
/// Panics if the shapes disagree, as every tensor operation does, or if `kernel` is out of range.
pub fn depthwise(x: Tensor<4>, weight: Tensor<3>, bias: Tensor<1>) -> Tensor<4> {
    let ([_, channels, _, _], [kernels, rows, columns]) = (x.dims(), weight.dims());
    assert_eq!([channels, rows], [kernels, columns], "depthwise: kernel does not fit the input");
    assert_eq!([channels], bias.dims(), "depthwise: one bias per channel");
    assert!(rows % 2 == 1 && rows <= 15, "depthwise: kernel {rows} is not odd or above 15");
    let (kind, kernel) = (ConvolutionKind::Depthwise, [rows, columns]);
    convolution::note(Convolution {
        kind,
        input: x.dims(),
        outputs: channels,
        kernel,
        step: 1,
        border: rows / 2,
    });
    if computes_in_place(&Depthwise, &x) {
        return apply(Arc::new(Depthwise), [x.into_dispatch(), weight.into_dispatch(), bias.into_dispatch()]);
    }
    depthwise_by_framework(x, weight, bias)
}

/// [`depthwise`] by the framework on any device.
pub(crate) fn depthwise_by_framework(x: Tensor<4>, weight: Tensor<3>, bias: Tensor<1>) -> Tensor<4> {
    let [channels, rows, _] = weight.dims();
    let options = ConvOptions::new([1; 2], [rows / 2; 2], [1; 2], channels);
    conv2d(x, weight.unsqueeze_dim::<4>(1), Some(bias), options)
}

#[derive(Debug)]
pub(super) struct Depthwise;

impl Kernel for Depthwise {
    fn forward(&self, inputs: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let [x, weight, bias] = inputs else { unreachable!("three inputs") };
        let [_, channels, height, width] = x.dims();
        let [_, kernel, _] = weight.dims();
        let shape = PlaneShape { height, width, border: kernel / 2 };
        let lines = lines(shape, kernel);
        let mut y = vec![0.0; x.values.len()];
        let planes = y.par_chunks_mut(shape.pixels()).zip(x.values.par_chunks(shape.pixels())).enumerate();
        planes.for_each_init(
            || vec![0.0; shape.stored()],
            |padded, (plane, (out, x))| {
                let channel = plane % channels;
                let weights = &weight.values[channel * lines.len()..][..lines.len()];
                fill(padded, x, shape);
                let bias = bias.values[channel];
                Arch::new().dispatch(CorrelatePlane { x: padded, shape, lines: &lines, weights, bias, out });
            },
        );
        (y, x.shape.clone())
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], wanted: &[bool]) -> Vec<Vec<f32>> {
        let [x, weight, _] = inputs else { unreachable!("three inputs") };
        let [_, channels, height, width] = x.dims();
        let [_, kernel, _] = weight.dims();
        let shape = PlaneShape { height, width, border: kernel / 2 };
        let lines = lines(shape, kernel);
        let taps = lines.len();
        let (wants_x, wants_weight) = (wanted[0], wanted[1] || wanted[2]);
        let mut for_x = vec![0.0; x.values.len()];
        // The gradients of the kernel and of the bias, one part per plane.
        let parts: Vec<Vec<f32>> = for_x
            .par_chunks_mut(shape.pixels())
            .zip(x.values.par_chunks(shape.pixels()))
            .zip(gradient.par_chunks(shape.pixels()))
            .enumerate()
            .map_init(
                || [vec![0.0; shape.stored()], vec![0.0; shape.stored()]],
                |[padded, pulled], (plane, ((out, x), g))| {
                    fill(pulled, g, shape);
                    let lines = &lines[..];
                    if wants_x {
                        // The gradient of the input is a convolution with the kernel rotated by 180 degrees.
                        let weights = &weight.values[plane % channels * taps..][..taps];
                        let rotated: Vec<f32> = weights.iter().rev().copied().collect();
                        let weights = &rotated[..];
                        let plane = CorrelatePlane { x: pulled, shape, lines, weights, bias: 0.0, out };
                        Arch::new().dispatch(plane);
                    }
                    if !wants_weight {
                        return Vec::new();
                    }
                    fill(padded, x, shape);
                    Arch::new().dispatch(WeightPlane { x: padded, gradient: pulled, shape, lines })
                },
            )
            .collect();
        if !wants_weight {
            return vec![for_x, Vec::new(), Vec::new()];
        }

        // Add the pictures of the batch in their order.
        let (mut for_weight, mut for_bias) = (vec![0.0; channels * taps], vec![0.0; channels]);
        for (plane, part) in parts.iter().enumerate() {
            let channel = plane % channels;
            let sums = &mut for_weight[channel * taps..][..taps];
            sums.iter_mut().zip(part).for_each(|(sum, v)| *sum += v);
            for_bias[channel] += part[taps];
        }
        vec![for_x, for_weight, for_bias]
    }

    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    fn device_form(&self) -> Option<&dyn DeviceForm> {
        Some(self)
    }
}

/// Where the taps of the kernel start in a zero-bordered plane, row by row.
fn lines(shape: PlaneShape, kernel: usize) -> Vec<usize> {
    (0..kernel * kernel).map(|t| t / kernel * shape.stride() + t % kernel).collect()
}

/// Copies a picture into a zero-bordered plane; the border is 0 already.
fn fill(padded: &mut [f32], picture: &[f32], shape: PlaneShape) {
    let rows = padded[shape.first()..].chunks_mut(shape.stride());
    for (to, from) in rows.zip(picture.chunks_exact(shape.width)) {
        to[..shape.width].copy_from_slice(from);
    }
}

/// The convolution of one plane.
struct CorrelatePlane<'a> {
    x: &'a [f32],
    shape: PlaneShape,
    lines: &'a [usize],
    weights: &'a [f32],
    bias: f32,
    out: &'a mut [f32],
}

impl WithSimd for CorrelatePlane<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { x, shape, lines, weights, bias, out } = self;
        let (lanes, stride) = (S::F32_LANES, shape.stride());
        for row in (0..shape.height).step_by(2) {
            for column in (0..shape.width).step_by(lanes) {
                let x = &x[row * stride + column..];
                let mut sums = [simd.splat_f32s(bias); 2];
                for (line, weight) in lines.iter().zip(weights) {
                    let weight = simd.splat_f32s(*weight);
                    let near = &x[*line..][..stride + lanes];
                    let values = [&near[..lanes], &near[stride..]].map(|row| S::as_simd_f32s(row).0[0]);
                    for r in 0..2 {
                        sums[r] = simd.mul_add_e_f32s(weight, values[r], sums[r]);
                    }
                }
                let kept = lanes.min(shape.width - column);
                for r in 0..2.min(shape.height - row) {
                    simd.partial_store_f32s(&mut out[(row + r) * shape.width + column..][..kept], sums[r]);
                }
            }
        }
    }
}

/// `dw[i, j] = sum over r, s of g[r, s] x[r + i - k, s + j - k]`, then `db = sum of g`; returns `[taps + 1]`.
struct WeightPlane<'a> {
    x: &'a [f32],
    gradient: &'a [f32],
    shape: PlaneShape,
    lines: &'a [usize],
}

impl WithSimd for WeightPlane<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
        let Self { x, gradient, shape, lines } = self;
        // The stored rows are one long line; the cotangent is 0 between rows, so the gaps add nothing.
        let vectors = (shape.height * shape.stride()).div_ceil(S::F32_LANES);
        let gradient = &S::as_simd_f32s(&gradient[shape.first()..]).0[..vectors];
        let zero = simd.splat_f32s(0.0);
        let mut out = Vec::with_capacity(lines.len() + 1);
        for lines in lines.chunks(3) {
            let near: [&[S::f32s]; 3] =
                std::array::from_fn(|i| &S::as_simd_f32s(&x[lines[i.min(lines.len() - 1)]..]).0[..vectors]);
            // Two sums per tap, for even and odd vectors, so that one addition need not wait for the other.
            let mut sums = [[zero; 3]; 2];
            for (v, g) in gradient.iter().enumerate() {
                for i in 0..3 {
                    sums[v % 2][i] = simd.mul_add_e_f32s(*g, near[i][v], sums[v % 2][i]);
                }
            }
            for i in 0..lines.len() {
                out.push(simd.reduce_sum_f32s(simd.add_f32s(sums[0][i], sums[1][i])));
            }
        }
        let mut sum = zero;
        for g in gradient {
            sum = simd.add_f32s(sum, *g);
        }
        out.push(simd.reduce_sum_f32s(sum));
        out
    }
}
