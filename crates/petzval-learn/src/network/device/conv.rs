//! The device form of the convolution with a leaky rectifier.
//!
//! The convolution, with its bias, and its adjoints are the framework's. Ours are the rectifier, in the memory of the convolution's result, and
//! one kernel that takes a cotangent through the rectifier and sums it for the bias on the way. A slope of 1 is no rectifier and takes no time.

use burn::backend::{DispatchTensor, TensorMetadata};
use burn::tensor::ops::ConvOptions;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::calculate_cube_count_elemwise;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::conv::{conv_data_backward, conv_forward, conv_weight_backward};
use burn_cubecl::ops::permute_nhwc_to_nchw;
use burn_cubecl::tensor::CubeTensor;
use petzval_camera::tape::{BackwardPass, DeviceForm};

use crate::network::conv::ConvLeaky;

use super::sums::sum_of_parts;
use super::{address_type, empty, given, tensors};

/// Units of a cube that takes cotangents back.
const UNITS: usize = 256;

/// Neighbouring units take the channels of a pixel, up to this number of them.
const MOST_LANES: usize = 32;

/// Values of a channel that one unit sums.
const VALUES_OF_A_UNIT: usize = 128;

/// Why the framework's convolutions cannot fail.
const COMPARED: &str = "the layer has compared the shapes";

impl DeviceForm for ConvLeaky {
    fn forward(&self, inputs: &[DispatchTensor], _: &[bool]) -> DispatchTensor {
        let [x, weight, bias] = inputs else { unreachable!("three inputs") };
        let [x, weight, bias] = tensors([x, weight, bias]);
        let options = options(self.step, &weight);
        let y = conv_forward::<2>(x, weight, Some(bias), options, Default::default()).expect(COMPARED);
        given(if self.slope < 1.0 { rectified(y, self.slope) } else { y })
    }

    fn backward(&self, inputs: &[DispatchTensor], at: BackwardPass<'_>) -> Vec<Option<DispatchTensor>> {
        let BackwardPass { output, gradient, wanted } = at;
        let ([x, weight, _], Some(output)) = (inputs, output) else {
            unreachable!("three inputs and the value")
        };
        let [x, weight, y, gradient] = tensors([x, weight, output, gradient]);
        let (pulled, for_bias) = if self.slope < 1.0 {
            let (pulled, sums) = pulled_back(gradient, y, self.slope);
            (pulled, wanted[2].then_some(sums))
        } else {
            let sums = wanted[2].then(|| sums_of(gradient.clone()));
            (gradient, sums)
        };
        let options = || options(self.step, &weight);
        let for_x = wanted[0].then(|| {
            let pulled = pulled.clone();
            let found =
                conv_data_backward::<2>(pulled, weight.clone(), x.shape(), options(), Default::default());
            given(found.expect(COMPARED))
        });
        let for_weight = wanted[1].then(|| {
            let (x, pulled) = (x.clone(), pulled.clone());
            let found = conv_weight_backward::<2>(x, pulled, weight.shape(), options(), Default::default());
            given(found.expect(COMPARED))
        });
        vec![for_x, for_weight, for_bias.map(given)]
    }
}

/// A border of zeros by half the kernel.
fn options(step: usize, weight: &CubeTensor) -> ConvOptions<2> {
    let border = weight.shape()[2] / 2;
    ConvOptions::new([step; 2], [border; 2], [1; 2], 1)
}

/// `v = slope v` where `v` is below 0, for every value in the memory of a tensor of any strides.
#[cube(launch, address_type = "dynamic")]
fn rectify(v: &mut Tensor<f32>, slope: f32) {
    if ABSOLUTE_POS < v.buffer_len() {
        let value = v[ABSOLUTE_POS];
        v[ABSOLUTE_POS] = select(value < 0.0f32, slope * value, value);
    }
}

/// The rectified values, in the memory of `v`, which must have no other owner.
fn rectified(v: CubeTensor, slope: f32) -> CubeTensor {
    let client = v.client.clone();
    let count = v.handle.size() as usize / v.elem_size();
    let dim = CubeDim::new(&client, count);
    let cubes = calculate_cube_count_elemwise(&client, count, dim);
    rectify::launch(&client, cubes, dim, address_type(&[&v]), v.clone().into_tensor_arg(), slope);
    v
}

/// `pulled = g` where `y` is at least 0 and `slope g` elsewhere; and for each channel the sum of that over some pixels of all pictures.
///
/// In a cube `lanes` neighbouring units take the channels of a pixel, the next ones those of the next pixel, until `pixels` pixels are done.
/// `g` and `y` may have any strides. `pulled` is `[batch, height, width, channels]`, as the framework's adjoints read it, and `sums` is
/// `[part, channels]`, both contiguous. Without a rectifier there is no `pulled`, and the sums are those of `g`.
#[cube(launch, address_type = "dynamic")]
fn pull_back(
    g: &Tensor<f32>,
    y: ComptimeOption<&Tensor<f32>>,
    mut pulled: ComptimeOption<&mut Tensor<f32>>,
    sums: &mut Tensor<f32>,
    slope: f32,
    pixels: usize,
    #[comptime] lanes: usize,
) {
    let (channels, width) = (g.shape(1), g.shape(3));
    let of_a_picture = g.shape(2) * width;
    let rows = comptime![UNITS / lanes];
    let blocks = channels.div_ceil(lanes);
    let unit = UNIT_POS as usize;
    let row = unit / lanes;
    let channel = CUBE_POS % blocks * lanes + unit % lanes;
    let part = CUBE_POS / blocks;
    if part >= sums.shape(0) {
        terminate!();
    }

    let mut sum = 0.0f32;
    if channel < channels {
        let last = clamp_max((part + 1) * pixels, g.shape(0) * of_a_picture);
        let mut pixel = part * pixels + row;
        while pixel < last {
            let (item, place) = (pixel / of_a_picture, pixel % of_a_picture);
            let (line, column) = (place / width, place % width);
            let from = item * g.stride(0) + channel * g.stride(1) + line * g.stride(2) + column * g.stride(3);
            let mut value = g[from];
            #[comptime]
            if let ComptimeOption::Some(y) = &y {
                let from =
                    item * y.stride(0) + channel * y.stride(1) + line * y.stride(2) + column * y.stride(3);
                value = select(y[from] < 0.0f32, slope * value, value);
            }
            #[comptime]
            if let ComptimeOption::Some(pulled) = &mut pulled {
                pulled[pixel * channels + channel] = value;
            }
            sum += value;
            pixel += rows;
        }
    }

    // Add the units of a channel in pairs, always the same ones.
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    shared[unit] = sum;
    sync_cube();
    let mut half = comptime![rows / 2].runtime();
    while half > 0 {
        if row < half {
            shared[unit] += shared[unit + half * lanes];
        }
        sync_cube();
        half /= 2;
    }
    if row == 0 && channel < channels {
        sums[part * channels + channel] = shared[unit];
    }
}

/// The cotangent behind the rectifier, and its sum for each channel.
fn pulled_back(g: CubeTensor, y: CubeTensor, slope: f32) -> (CubeTensor, CubeTensor) {
    let [batch, channels, height, width] = g.shape().dims();
    let pulled = empty(&g, [batch, height, width, channels]);
    let sums = launched(g, Some((y, pulled.clone())), slope);
    (permute_nhwc_to_nchw(pulled), sums)
}

/// The sum of a cotangent for each channel.
fn sums_of(g: CubeTensor) -> CubeTensor {
    launched(g, None, 1.0)
}

fn launched(g: CubeTensor, rectifier: Option<(CubeTensor, CubeTensor)>, slope: f32) -> CubeTensor {
    let [batch, channels, height, width] = g.shape().dims();
    let lanes = channels.next_power_of_two().min(MOST_LANES);
    let pixels = UNITS / lanes * VALUES_OF_A_UNIT;
    let parts = (batch * height * width).div_ceil(pixels);
    let sums = empty(&g, [parts, channels]);
    let client = g.client.clone();
    let dim = CubeDim::new_1d(UNITS as u32);
    let cubes = calculate_cube_count_elemwise(&client, parts * channels.div_ceil(lanes) * UNITS, dim);
    let address = address_type(&[&g, &sums]);
    let (y, pulled) = rectifier.unzip();
    let y = y.map(CubeTensor::into_tensor_arg).into();
    let pulled = pulled.map(CubeTensor::into_tensor_arg).into();
    let [g, to] = [g, sums.clone()].map(CubeTensor::into_tensor_arg);
    pull_back::launch(&client, cubes, dim, address, g, y, pulled, to, slope, pixels, lanes);
    sum_of_parts(sums, [channels])
}
