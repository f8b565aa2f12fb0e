//! The normalisation over the channels of each pixel, and its adjoint.
//!
//! Where a unit can hold the channels of a pixel, each value is read once.

use burn::backend::TensorMetadata;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

use crate::network::pointwise_kernel::VARIANCE_FLOOR;

use super::pixels::{place, units};
use super::{address_type, empty};

/// A unit holds so many values of a pixel in its registers at most.
const HELD: usize = 64;

/// The factor of the normalisation of a pixel whose channels differ from their mean by squares with this sum.
#[cube]
fn scale_of(squares: f32, channels: f32) -> f32 {
    1.0f32 / (squares / channels + VARIANCE_FLOOR).sqrt()
}

/// The mean over the channels of a pixel, and the factor of its normalisation.
#[cube]
fn moments_at(x: &Tensor<f32>, from: usize) -> (f32, f32) {
    let channels = x.shape(1);
    let count = f32::cast_from(channels);
    let mut sum = 0.0f32;
    for c in 0..channels {
        sum += x[from + c * x.stride(1)];
    }
    let mean = sum / count;
    let mut squares = 0.0f32;
    for c in 0..channels {
        let centred = x[from + c * x.stride(1)] - mean;
        squares += centred * centred;
    }
    (mean, scale_of(squares, count))
}

/// `n = (x - mean(x)) / sqrt(mean((x - mean(x))^2) + 1e-6)`, means over the channels of a pixel. A unit computes one pixel.
///
/// `x` may have any strides, `n` is contiguous. `held` is the number of channels if the unit holds them, and 0 if it reads them again.
#[cube(launch, address_type = "dynamic")]
fn normalize(x: &Tensor<f32>, n: &mut Tensor<f32>, #[comptime] held: usize) {
    let (channels, pixels) = (n.shape(1), n.shape(2) * n.shape(3));
    let (item, pixel) = (ABSOLUTE_POS / pixels, ABSOLUTE_POS % pixels);
    if item >= n.shape(0) {
        terminate!();
    }
    let from = place(x, item, pixel);
    let to = item * channels * pixels + pixel;
    if comptime![held > 0] {
        let mut values = Array::<f32>::new(held);
        let count = f32::cast_from(channels);
        let mut sum = 0.0f32;
        #[unroll]
        for c in 0..held {
            values[c] = x[from + c * x.stride(1)];
            sum += values[c];
        }
        let mean = sum / count;
        let mut squares = 0.0f32;
        #[unroll]
        for c in 0..held {
            values[c] -= mean;
            squares += values[c] * values[c];
        }
        let scale = scale_of(squares, count);
        #[unroll]
        for c in 0..held {
            n[to + c * pixels] = values[c] * scale;
        }
    } else {
        let (mean, scale) = moments_at(x, from);
        for c in 0..channels {
            n[to + c * pixels] = (x[from + c * x.stride(1)] - mean) * scale;
        }
    }
}

pub fn normalized(x: CubeTensor) -> CubeTensor {
    let [batch, channels, height, width] = x.shape().dims();
    let n = empty(&x, [batch, channels, height, width]);
    let client = x.client.clone();
    let (dim, cubes) = units(&client, batch * height * width);
    let address = address_type(&[&x, &n]);
    let [x, to] = [x, n.clone()].map(CubeTensor::into_tensor_arg);
    normalize::launch(&client, cubes, dim, address, x, to, held(channels));
    n
}

/// How many channels a unit holds.
fn held(channels: usize) -> usize {
    if channels <= HELD { channels } else { 0 }
}

/// The mean over the channels of every pixel, and the factor of its normalisation: `moments`, `[batch, 2, pixels]`, contiguous.
#[cube(launch, address_type = "dynamic")]
fn find_moments(x: &Tensor<f32>, moments: &mut Tensor<f32>) {
    let pixels = moments.shape(2);
    let (item, pixel) = (ABSOLUTE_POS / pixels, ABSOLUTE_POS % pixels);
    if item >= moments.shape(0) {
        terminate!();
    }
    let (mean, scale) = moments_at(x, place(x, item, pixel));
    moments[item * 2 * pixels + pixel] = mean;
    moments[(item * 2 + 1) * pixels + pixel] = scale;
}

/// The mean over the channels of every pixel and the factor of its normalisation, `[batch, 2, pixels]`.
pub fn moments_of(x: CubeTensor) -> CubeTensor {
    let [batch, _, height, width] = x.shape().dims();
    let moments = empty(&x, [batch, 2, height * width]);
    let client = x.client.clone();
    let (dim, cubes) = units(&client, batch * height * width);
    let address = address_type(&[&x, &moments]);
    let [x, to] = [x, moments.clone()].map(CubeTensor::into_tensor_arg);
    find_moments::launch(&client, cubes, dim, address, x, to);
    moments
}

/// `dx = scale (dn - mean(dn) - n mean(n dn))`, the adjoint of the normalisation. A unit computes one pixel.
///
/// `x` may have any strides; `for_n`, `[batch, channels, ...]`, and `for_x` are contiguous.
#[cube(launch, address_type = "dynamic")]
fn denormalize(
    x: &Tensor<f32>,
    moments: &Tensor<f32>,
    for_n: &Tensor<f32>,
    for_x: &mut Tensor<f32>,
    #[comptime] held: usize,
) {
    let (channels, pixels) = (for_x.shape(1), for_x.shape(2) * for_x.shape(3));
    let (item, pixel) = (ABSOLUTE_POS / pixels, ABSOLUTE_POS % pixels);
    if item >= for_x.shape(0) {
        terminate!();
    }
    let from = place(x, item, pixel);
    let to = item * channels * pixels + pixel;
    let mean = moments[item * 2 * pixels + pixel];
    let scale = moments[(item * 2 + 1) * pixels + pixel];
    let count = f32::cast_from(channels);
    let mut sum = 0.0f32;
    let mut along = 0.0f32;
    if comptime![held > 0] {
        let mut n = Array::<f32>::new(held);
        let mut pulled = Array::<f32>::new(held);
        #[unroll]
        for c in 0..held {
            n[c] = (x[from + c * x.stride(1)] - mean) * scale;
            pulled[c] = for_n[to + c * pixels];
            sum += pulled[c];
            along += n[c] * pulled[c];
        }
        #[unroll]
        for c in 0..held {
            for_x[to + c * pixels] = scale * (pulled[c] - (sum + n[c] * along) / count);
        }
    } else {
        for c in 0..channels {
            let pulled = for_n[to + c * pixels];
            sum += pulled;
            along += (x[from + c * x.stride(1)] - mean) * scale * pulled;
        }
        for c in 0..channels {
            let n = (x[from + c * x.stride(1)] - mean) * scale;
            for_x[to + c * pixels] = scale * (for_n[to + c * pixels] - (sum + n * along) / count);
        }
    }
}

pub fn denormalized(x: CubeTensor, moments: CubeTensor, for_n: CubeTensor) -> CubeTensor {
    let [batch, channels, height, width] = x.shape().dims();
    let for_x = empty(&x, [batch, channels, height, width]);
    let for_n = into_contiguous(for_n);
    let client = x.client.clone();
    let (dim, cubes) = units(&client, batch * height * width);
    let address = address_type(&[&x, &for_n, &for_x]);
    // Two values of every channel are held here.
    let held = held(2 * channels) / 2;
    let [x, moments, for_n, to] = [x, moments, for_n, for_x.clone()].map(CubeTensor::into_tensor_arg);
    denormalize::launch(&client, cubes, dim, address, x, moments, for_n, to, held);
    for_x
}
