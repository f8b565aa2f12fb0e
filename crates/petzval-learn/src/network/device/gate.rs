//! The product of the two halves of the channels, and its adjoint.

use burn::backend::TensorMetadata;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

use super::pixels::{place, units};
use super::{address_type, empty};

/// Channels that one unit takes: it finds its pixel once for them.
const CHANNELS: usize = 8;

/// `n[c] = x[c] x[c + inputs]`: the product of the two halves of the channels. A unit computes some channels of one pixel.
///
/// `x` may have any strides, `n` is contiguous.
#[cube(launch, address_type = "dynamic")]
fn gate(x: &Tensor<f32>, n: &mut Tensor<f32>) {
    let (inputs, pixels) = (n.shape(1), n.shape(2) * n.shape(3));
    let blocks = inputs.div_ceil(CHANNELS);
    let (pixel, block) = (ABSOLUTE_POS % pixels, ABSOLUTE_POS / pixels % blocks);
    let item = ABSOLUTE_POS / pixels / blocks;
    if item >= n.shape(0) {
        terminate!();
    }
    let from = place(x, item, pixel);
    let other = from + inputs * x.stride(1);
    for c in block * CHANNELS..clamp_max((block + 1) * CHANNELS, inputs) {
        n[(item * inputs + c) * pixels + pixel] = x[from + c * x.stride(1)] * x[other + c * x.stride(1)];
    }
}

/// The product of the two halves of the channels, contiguous.
pub fn gated(x: CubeTensor) -> CubeTensor {
    let [batch, channels, height, width] = x.shape().dims();
    let n = empty(&x, [batch, channels / 2, height, width]);
    let client = x.client.clone();
    let (dim, cubes) = units(&client, batch * (channels / 2).div_ceil(CHANNELS) * height * width);
    let address = address_type(&[&x, &n]);
    gate::launch(&client, cubes, dim, address, x.into_tensor_arg(), n.clone().into_tensor_arg());
    n
}

/// `dx[c] = dn[c] x[c + inputs]` and `dx[c + inputs] = dn[c] x[c]`, the adjoint of the gate. A unit takes some channels of one pixel.
///
/// `x` may have any strides; `for_n` and `for_x` are contiguous.
#[cube(launch, address_type = "dynamic")]
fn ungate(x: &Tensor<f32>, for_n: &Tensor<f32>, for_x: &mut Tensor<f32>) {
    let (inputs, pixels) = (for_n.shape(1), for_n.shape(2) * for_n.shape(3));
    let blocks = inputs.div_ceil(CHANNELS);
    let (pixel, block) = (ABSOLUTE_POS % pixels, ABSOLUTE_POS / pixels % blocks);
    let item = ABSOLUTE_POS / pixels / blocks;
    if item >= for_n.shape(0) {
        terminate!();
    }
    let from = place(x, item, pixel);
    let other = from + inputs * x.stride(1);
    for c in block * CHANNELS..clamp_max((block + 1) * CHANNELS, inputs) {
        let pulled = for_n[(item * inputs + c) * pixels + pixel];
        let to = (item * 2 * inputs + c) * pixels + pixel;
        for_x[to] = pulled * x[other + c * x.stride(1)];
        for_x[to + inputs * pixels] = pulled * x[from + c * x.stride(1)];
    }
}

/// The cotangent of the gate's input, contiguous, from that of its value.
pub fn ungated(x: CubeTensor, for_n: CubeTensor) -> CubeTensor {
    let [batch, channels, height, width] = x.shape().dims();
    let for_x = empty(&x, [batch, channels, height, width]);
    let for_n = into_contiguous(for_n);
    let client = x.client.clone();
    let (dim, cubes) = units(&client, batch * (channels / 2).div_ceil(CHANNELS) * height * width);
    let address = address_type(&[&x, &for_n, &for_x]);
    let [x, for_n] = [x, for_n].map(CubeTensor::into_tensor_arg);
    ungate::launch(&client, cubes, dim, address, x, for_n, for_x.clone().into_tensor_arg());
    for_x
}
