//! The product of the two halves of the channels, and its adjoint.

use burn::backend::TensorMetadata;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

use super::pixels::{place, units};
use super::{address_type, empty};

/// `n[c] = x[c] x[c + inputs]`: the product of the two halves of the channels. A unit computes one value.
///
/// `x` may have any strides, `n` is contiguous.
#[cube(launch, address_type = "dynamic")]
fn gate(x: &Tensor<f32>, n: &mut Tensor<f32>) {
    let (inputs, pixels) = (n.shape(1), n.shape(2) * n.shape(3));
    let plane = ABSOLUTE_POS / pixels;
    if plane >= n.shape(0) * inputs {
        terminate!();
    }
    let from = place(x, plane / inputs, ABSOLUTE_POS % pixels) + plane % inputs * x.stride(1);
    n[ABSOLUTE_POS] = x[from] * x[from + inputs * x.stride(1)];
}

pub fn gated(x: CubeTensor) -> CubeTensor {
    let [batch, channels, height, width] = x.shape().dims();
    let n = empty([batch, channels / 2, height, width], &x);
    let client = x.client.clone();
    let (dim, cubes) = units(&client, batch * channels / 2 * height * width);
    let address = address_type(&[&x, &n]);
    gate::launch(&client, cubes, dim, address, x.into_tensor_arg(), n.clone().into_tensor_arg());
    n
}

/// `dx[c] = dn[c] x[c + inputs]` and `dx[c + inputs] = dn[c] x[c]`, the adjoint of the gate. A unit computes the two.
///
/// `x` may have any strides; `for_n` and `for_x` are contiguous.
#[cube(launch, address_type = "dynamic")]
fn ungate(x: &Tensor<f32>, for_n: &Tensor<f32>, for_x: &mut Tensor<f32>) {
    let (inputs, pixels) = (for_n.shape(1), for_n.shape(2) * for_n.shape(3));
    let plane = ABSOLUTE_POS / pixels;
    if plane >= for_n.shape(0) * inputs {
        terminate!();
    }
    let (item, channel, pixel) = (plane / inputs, plane % inputs, ABSOLUTE_POS % pixels);
    let from = place(x, item, pixel) + channel * x.stride(1);
    let to = (item * 2 * inputs + channel) * pixels + pixel;
    let pulled = for_n[ABSOLUTE_POS];
    for_x[to] = pulled * x[from + inputs * x.stride(1)];
    for_x[to + inputs * pixels] = pulled * x[from];
}

pub fn ungated(x: CubeTensor, for_n: CubeTensor) -> CubeTensor {
    let [batch, channels, height, width] = x.shape().dims();
    let for_x = empty([batch, channels, height, width], &x);
    let for_n = into_contiguous(for_n);
    let client = x.client.clone();
    let (dim, cubes) = units(&client, batch * channels / 2 * height * width);
    let address = address_type(&[&x, &for_n, &for_x]);
    let [x, for_n] = [x, for_n].map(CubeTensor::into_tensor_arg);
    ungate::launch(&client, cubes, dim, address, x, for_n, for_x.clone().into_tensor_arg());
    for_x
}
