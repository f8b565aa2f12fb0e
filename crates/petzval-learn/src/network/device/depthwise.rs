//! The device form of the convolution of each channel with a kernel of its own.
//!
//! A unit computes a column of a few pixels, so that neighbouring units read neighbouring values and each value is read once per column of
//! the kernel. The gradient of the weights is a sum over all pixels: a cube of units sums some lines of a channel, and the sums of the cubes
//! are added afterwards.

use burn::backend::{DispatchTensor, TensorMetadata};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::calculate_cube_count_elemwise;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use petzval_camera::tape::{BackwardPass, DeviceForm};

use crate::network::depthwise::Depthwise;

use super::pixels::units;
use super::sums::sum_of_parts;
use super::{address_type, empty, given, tensors};

/// Kernels up to this size have their loops written out.
const WRITTEN_OUT: usize = 7;

/// Pixels of one column that a unit computes together, where the loops are written out.
const ROWS: usize = 4;

/// Columns and lines of the units that sum products of pixels.
const UNITS: [usize; 2] = [32, 8];

/// Pixels that one cube sums, about.
const PIXELS_OF_A_PART: usize = 8192;

impl DeviceForm for Depthwise {
    fn forward(&self, inputs: &[DispatchTensor], _: &[bool]) -> DispatchTensor {
        let [x, weight, bias] = inputs else { unreachable!("three inputs") };
        let [x, weight, bias] = tensors([x, weight, bias]);
        given(correlated(x, weight, Some(bias)))
    }

    fn backward(&self, inputs: &[DispatchTensor], at: BackwardPass<'_>) -> Vec<Option<DispatchTensor>> {
        let BackwardPass { gradient, wanted, .. } = at;
        let [x, weight, _] = inputs else { unreachable!("three inputs") };
        let [x, weight, gradient] = tensors([x, weight, gradient]);
        let size = weight.shape()[1];
        let for_x = wanted[0].then(|| given(correlated(gradient.clone(), weight, None)));
        let (for_weight, for_bias) = if wanted[1] || wanted[2] {
            let (for_weight, for_bias) = sums_of_products(x, gradient, size);
            (wanted[1].then(|| given(for_weight)), wanted[2].then(|| given(for_bias)))
        } else {
            (None, None)
        };
        vec![for_x, for_weight, for_bias]
    }
}

/// The value of a picture at `row - border` and `column - border`; 0 outside.
#[cube]
fn value_at(x: &Tensor<f32>, picture: usize, row: usize, column: usize, #[comptime] border: usize) -> f32 {
    let mut value = 0.0f32;
    if row >= border && row < x.shape(2) + border && column >= border && column < x.shape(3) + border {
        value = x[picture + (row - border) * x.stride(2) + (column - border) * x.stride(3)];
    }
    value
}

/// `y[c, r, s] = bias[c] + sum over i, j of weight[c, i, j] x[c, r + i - k, s + j - k]`, zeros outside, `k = size / 2`. Without a bias the
/// adjoint of that: the convolution with the kernel rotated by 180 degrees.
///
/// A unit computes `rows` pixels of one column of `y`. `x` may have any strides; `weight`, `[channels, size, size]`, and `y` are contiguous.
#[cube(launch, address_type = "dynamic")]
fn correlate(
    x: &Tensor<f32>,
    weight: &Tensor<f32>,
    bias: ComptimeOption<&[f32]>,
    y: &mut Tensor<f32>,
    #[comptime] size: usize,
    #[comptime] rows: usize,
) {
    let (channels, height, width) = (y.shape(1), y.shape(2), y.shape(3));
    let blocks = height.div_ceil(rows);
    let column = ABSOLUTE_POS % width;
    let block = ABSOLUTE_POS / width % blocks;
    let plane = ABSOLUTE_POS / width / blocks;
    if plane >= y.shape(0) * channels {
        terminate!();
    }
    let channel = plane % channels;
    let first_row = block * rows;
    let border = comptime![size / 2];
    let taps = comptime![size * size];
    let picture = plane / channels * x.stride(0) + channel * x.stride(1);
    let is_adjoint = comptime![bias.is_none()];

    let mut sums = Array::<f32>::new(rows);
    #[comptime]
    if let ComptimeOption::Some(bias) = bias {
        #[unroll]
        for r in 0..rows {
            sums[r] = bias[channel];
        }
    }

    if comptime![size <= WRITTEN_OUT] {
        let mut kernel = Array::<f32>::new(taps);
        #[unroll]
        for t in 0..taps {
            kernel[t] = weight[channel * taps + comptime![if is_adjoint { taps - 1 - t } else { t }]];
        }
        // Read each value of the column's neighbourhood once, and add it to every pixel whose kernel covers it.
        #[unroll]
        for near in 0..comptime![rows + size - 1] {
            #[unroll]
            for j in 0..size {
                let value = value_at(x, picture, first_row + near, column + j, border);
                #[unroll]
                for r in 0..rows {
                    if comptime![near >= r && near < r + size] {
                        sums[r] += kernel[comptime![(near - r) * size + j]] * value;
                    }
                }
            }
        }
    } else {
        for i in 0..size {
            for j in 0..size {
                let tap = i * size + j;
                let tap = if comptime![is_adjoint] { taps - 1 - tap } else { tap };
                let value = value_at(x, picture, first_row + i, column + j, border);
                sums[0] += weight[channel * taps + tap] * value;
            }
        }
    }

    #[unroll]
    for r in 0..rows {
        if first_row + r < height {
            y[(plane * height + first_row + r) * width + column] = sums[r];
        }
    }
}

fn correlated(x: CubeTensor, weight: CubeTensor, bias: Option<CubeTensor>) -> CubeTensor {
    let [batch, channels, height, width] = x.shape().dims();
    let size = weight.shape()[1];
    let y = empty(&x, [batch, channels, height, width]);
    let weight = into_contiguous(weight);
    let bias = bias.map(|bias| into_contiguous(bias).into_buffer_arg()).into();

    let rows = if size <= WRITTEN_OUT { ROWS } else { 1 };
    let client = x.client.clone();
    let (dim, cubes) = units(&client, batch * channels * height.div_ceil(rows) * width);
    let address = address_type(&[&x, &weight, &y]);
    let [x, weight] = [x, weight].map(CubeTensor::into_tensor_arg);
    let to = y.clone().into_tensor_arg();
    correlate::launch(&client, cubes, dim, address, x, weight, bias, to, size, rows);
    y
}

/// `dw[c, i, j] = sum over pictures, r, s of g[c, r, s] x[c, r + i - k, s + j - k]` and `db[c] = sum of g[c]`, of some lines of all pictures.
///
/// A cube sums `lines` lines of one channel for `kernel_rows` rows of the kernel: the cubes of a channel and part are neighbours. `x` and
/// `gradient` may have any strides. `for_weight` is `[part, channels, size, size]` and `for_bias` `[part, channels]`, both contiguous.
#[cube(launch, address_type = "dynamic")]
fn sum_products(
    x: &Tensor<f32>,
    gradient: &Tensor<f32>,
    for_weight: &mut Tensor<f32>,
    for_bias: &mut Tensor<f32>,
    lines: usize,
    #[comptime] size: usize,
    #[comptime] kernel_rows: usize,
) {
    let (channels, height, width) = (x.shape(1), x.shape(2), x.shape(3));
    let border = comptime![size / 2];
    let groups = comptime![size / kernel_rows];
    let taps = comptime![kernel_rows * size];
    let units = comptime![UNITS[0] * UNITS[1]];
    let cube = CUBE_POS;
    let first_tap_row = cube % groups * kernel_rows;
    let channel = cube / groups % channels;
    let part = cube / groups / channels;
    if part >= for_bias.shape(0) {
        terminate!();
    }

    // Each unit sums the pixels of its columns and lines: a sum for each tap, and one of the cotangent alone.
    let mut sums = Array::<f32>::new(taps + 1);
    let last = clamp_max((part + 1) * lines, x.shape(0) * height);
    let mut line = part * lines + UNIT_POS_Y as usize;
    while line < last {
        let (item, row) = (line / height, line % height);
        let picture = item * x.stride(0) + channel * x.stride(1);
        let pulled = item * gradient.stride(0) + channel * gradient.stride(1) + row * gradient.stride(2);
        let mut column = UNIT_POS_X as usize;
        while column < width {
            let g = gradient[pulled + column * gradient.stride(3)];
            #[unroll]
            for i in 0..kernel_rows {
                let near = row + first_tap_row + i;
                if near >= border && near < height + border {
                    let start = picture + (near - border) * x.stride(2);
                    #[unroll]
                    for j in 0..size {
                        let from = column + j;
                        if from >= border && from < width + border {
                            sums[i * size + j] += g * x[start + (from - border) * x.stride(3)];
                        }
                    }
                }
            }
            sums[taps] += g;
            column += comptime![UNITS[0]];
        }
        line += comptime![UNITS[1]];
    }

    // Add the units of the cube in pairs, always the same ones.
    let mut shared = Shared::<[f32]>::new_slice(comptime![units * (taps + 1)]);
    let unit = UNIT_POS as usize;
    #[unroll]
    for t in 0..comptime![taps + 1] {
        shared[t * units + unit] = sums[t];
    }
    sync_cube();
    let mut half = comptime![units / 2].runtime();
    while half > 0 {
        if unit < half {
            #[unroll]
            for t in 0..comptime![taps + 1] {
                shared[t * units + unit] += shared[t * units + unit + half];
            }
        }
        sync_cube();
        half /= 2;
    }
    if unit < taps {
        let place = (part * channels + channel) * comptime![size * size] + first_tap_row * size + unit;
        for_weight[place] = shared[unit * units];
    }
    if unit == taps && first_tap_row == 0 {
        for_bias[part * channels + channel] = shared[taps * units];
    }
}

/// The gradients of the weight, `[channels, size, size]`, and of the bias.
fn sums_of_products(x: CubeTensor, gradient: CubeTensor, size: usize) -> (CubeTensor, CubeTensor) {
    let [batch, channels, height, width] = x.shape().dims();
    // As many lines to a part as keep every unit busy for a while; from the shape alone, because the order of the sum follows from it.
    let lines = PIXELS_OF_A_PART.div_ceil(width).next_multiple_of(UNITS[1]);
    let parts = (batch * height).div_ceil(lines);
    // All sums of a small kernel fit into the registers of a unit; those of a larger one are taken row by row.
    let kernel_rows = if size <= 3 { size } else { 1 };
    let for_weight = empty(&x, [parts, channels, size, size]);
    let for_bias = empty(&x, [parts, channels]);

    let client = x.client.clone();
    let dim = CubeDim::new_2d(UNITS[0] as u32, UNITS[1] as u32);
    let count = parts * channels * (size / kernel_rows) * UNITS[0] * UNITS[1];
    let cubes = calculate_cube_count_elemwise(&client, count, dim);
    let address = address_type(&[&x, &gradient, &for_weight]);
    let [x, gradient] = [x, gradient].map(CubeTensor::into_tensor_arg);
    let [weight, bias] = [&for_weight, &for_bias].map(|sums| sums.clone().into_tensor_arg());
    sum_products::launch(&client, cubes, dim, address, x, gradient, weight, bias, lines, size, kernel_rows);
    (sum_of_parts(for_weight, [channels, size, size]), sum_of_parts(for_bias, [channels]))
}
