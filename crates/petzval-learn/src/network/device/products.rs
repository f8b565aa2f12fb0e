//! The gradients of the weights and the bias of a 1x1 convolution: sums of products over all pixels.
//!
//! Few channels and very many pixels leave a general matrix product with too little to do at once. This kernel divides the pixels into parts. It
//! applies the normalisation or the gate as it reads, so that what lies between them and the convolution is not stored again.

use burn::backend::TensorMetadata;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::calculate_cube_count_elemwise;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

use super::pixels::place;
use super::sums::sum_of_parts;
use super::{address_type, empty};

/// Pixels of a tile of products at most.
const MOST_OF_A_TILE: usize = 64;

/// Values that the units of a cube share at most: every device has 16 KiB for them.
const SHARED: usize = 4096;

/// Units of a cube in each direction, inputs and outputs.
const SIDE: usize = 16;

/// Outputs or inputs of a unit at most.
const MOST_OF_A_UNIT: usize = 4;

/// Cubes, about, and pixels that one of them sums at least.
const CUBES: usize = 1024;
const PIXELS_OF_A_PART: usize = 512;

/// `dw[o, i] = sum over pictures and pixels of g[o, p] n[i, p]` and `db[o] = sum of g[o, p]`, of some pixels of all pictures; `n` is what the
/// prologue makes of `x`.
///
/// A cube sums the products of `SIDE * of_outputs` outputs and `SIDE * of_inputs` inputs over `tiles` tiles of pixels. It copies the values of a
/// tile into the memory that its units share; each unit then multiplies `of_outputs` outputs with `of_inputs` inputs.
///
/// `x` and `gradient` may have any strides; `moments` are those of a normalisation. `for_weight` is `[part, outputs, inputs]` and
/// `for_bias` `[part, outputs]`, both contiguous.
#[cube(launch, address_type = "dynamic")]
fn sum_products(
    x: &Tensor<f32>,
    moments: ComptimeOption<&[f32]>,
    gradient: &Tensor<f32>,
    for_weight: &mut Tensor<f32>,
    for_bias: &mut Tensor<f32>,
    tiles: usize,
    #[comptime] is_gated: bool,
    #[comptime] tile_pixels: usize,
    #[comptime] of_outputs: usize,
    #[comptime] of_inputs: usize,
) {
    let (outputs, inputs) = (for_weight.shape(1), for_weight.shape(2));
    let (batch, pixels) = (x.shape(0), x.shape(2) * x.shape(3));
    let (across_outputs, across_inputs) = comptime![(SIDE * of_outputs, SIDE * of_inputs)];
    // An odd step from pixel to pixel, so that neighbouring units write to different banks.
    let (output_step, input_step) = comptime![(SIDE * of_outputs + 1, SIDE * of_inputs + 1)];
    let units = comptime![SIDE * SIDE];
    let mut pulled = Shared::<[f32]>::new_slice(comptime![tile_pixels * (SIDE * of_outputs + 1)]);
    let mut near = Shared::<[f32]>::new_slice(comptime![tile_pixels * (SIDE * of_inputs + 1)]);

    // Which outputs, inputs and tiles this cube sums.
    let (output_blocks, input_blocks) = (outputs.div_ceil(across_outputs), inputs.div_ceil(across_inputs));
    let first_output = CUBE_POS % output_blocks * across_outputs;
    let input_block = CUBE_POS / output_blocks % input_blocks;
    let first_input = input_block * across_inputs;
    let part = CUBE_POS / output_blocks / input_blocks;
    if part >= for_bias.shape(0) {
        terminate!();
    }
    let tiles_of_a_picture = pixels.div_ceil(tile_pixels);
    let last = clamp_max((part + 1) * tiles, batch * tiles_of_a_picture);
    let (unit, output, input) = (UNIT_POS as usize, UNIT_POS_Y as usize, UNIT_POS_X as usize);
    let sums_bias = input_block == 0 && input == 0;

    let mut sums = Array::<f32>::new(comptime![of_outputs * of_inputs]);
    let mut bias_sums = Array::<f32>::new(of_outputs);
    let mut outer = Array::<f32>::new(of_outputs);
    for tile in part * tiles..last {
        let item = tile / tiles_of_a_picture;
        let first_pixel = tile % tiles_of_a_picture * tile_pixels;

        // Copy the tile, with zeros beyond the picture and its channels.
        #[unroll]
        for step in 0..comptime![tile_pixels * of_outputs / SIDE] {
            let value = unit + step * units;
            let (pixel, channel) = (value % tile_pixels, value / tile_pixels);
            let mut copied = 0.0f32;
            if first_pixel + pixel < pixels && first_output + channel < outputs {
                let from = place(gradient, item, first_pixel + pixel);
                copied = gradient[from + (first_output + channel) * gradient.stride(1)];
            }
            pulled[pixel * output_step + channel] = copied;
        }
        #[unroll]
        for step in 0..comptime![tile_pixels * of_inputs / SIDE] {
            let value = unit + step * units;
            let (pixel, channel) = (value % tile_pixels, value / tile_pixels);
            let mut copied = 0.0f32;
            if first_pixel + pixel < pixels && first_input + channel < inputs {
                let from = place(x, item, first_pixel + pixel) + (first_input + channel) * x.stride(1);
                copied = x[from];
                if comptime![is_gated] {
                    copied *= x[from + inputs * x.stride(1)];
                }
                #[comptime]
                if let ComptimeOption::Some(moments) = moments {
                    let of_pixel = item * 2 * pixels + first_pixel + pixel;
                    copied = (copied - moments[of_pixel]) * moments[of_pixel + pixels];
                }
            }
            near[pixel * input_step + channel] = copied;
        }
        sync_cube();

        // Multiply every output of the unit with every input, pixel by pixel.
        for pixel in 0..tile_pixels {
            #[unroll]
            for o in 0..of_outputs {
                outer[o] = pulled[pixel * output_step + output + o * SIDE];
            }
            #[unroll]
            for i in 0..of_inputs {
                let inner = near[pixel * input_step + input + i * SIDE];
                #[unroll]
                for o in 0..of_outputs {
                    sums[o * of_inputs + i] += outer[o] * inner;
                }
            }
            if sums_bias {
                #[unroll]
                for o in 0..of_outputs {
                    bias_sums[o] += outer[o];
                }
            }
        }
        sync_cube();
    }

    #[unroll]
    for o in 0..of_outputs {
        let to = first_output + output + o * SIDE;
        if to < outputs {
            #[unroll]
            for i in 0..of_inputs {
                let by = first_input + input + i * SIDE;
                if by < inputs {
                    for_weight[(part * outputs + to) * inputs + by] = sums[o * of_inputs + i];
                }
            }
            if sums_bias {
                for_bias[part * outputs + to] = bias_sums[o];
            }
        }
    }
}

/// The gradients of the weight, `[outputs, inputs]`, and of the bias.
pub fn sums_of_products(
    is_gated: bool,
    x: CubeTensor,
    moments: Option<CubeTensor>,
    gradient: CubeTensor,
) -> (CubeTensor, CubeTensor) {
    let ([batch, channels, height, width], [_, outputs, _, _]) =
        (x.shape().dims(), gradient.shape().dims::<4>());
    let inputs = if is_gated { channels / 2 } else { channels };
    let [of_outputs, of_inputs] = [outputs, inputs].map(|n| n.div_ceil(SIDE).min(MOST_OF_A_UNIT));
    let blocks = outputs.div_ceil(SIDE * of_outputs) * inputs.div_ceil(SIDE * of_inputs);
    // As large tiles as fit, so that units wait for each other as seldom as possible.
    let step = SIDE * (of_outputs + of_inputs) + 2;
    let tile_pixels = 1 << (SHARED / step).min(MOST_OF_A_TILE).ilog2();
    // As many parts as keep the device busy; from the shapes alone, because the order of the sum follows from them.
    let all_tiles = batch * (height * width).div_ceil(tile_pixels);
    let tiles = all_tiles.div_ceil(CUBES.div_ceil(blocks)).max(PIXELS_OF_A_PART / tile_pixels);
    let parts = all_tiles.div_ceil(tiles);
    let for_weight = empty(&x, [parts, outputs, inputs]);
    let for_bias = empty(&x, [parts, outputs]);

    let client = x.client.clone();
    let dim = CubeDim::new_2d(SIDE as u32, SIDE as u32);
    let cubes = calculate_cube_count_elemwise(&client, parts * blocks * SIDE * SIDE, dim);
    let address = address_type(&[&x, &gradient, &for_weight]);
    let moments = moments.map(CubeTensor::into_buffer_arg).into();
    let [x, gradient] = [x, gradient].map(CubeTensor::into_tensor_arg);
    let [weight, bias] = [&for_weight, &for_bias].map(|sums| sums.clone().into_tensor_arg());
    sum_products::launch(
        &client,
        cubes,
        dim,
        address,
        x,
        moments,
        gradient,
        weight,
        bias,
        tiles,
        is_gated,
        tile_pixels,
        of_outputs,
        of_inputs,
    );
    (sum_of_parts(for_weight, [outputs, inputs]), sum_of_parts(for_bias, [outputs]))
}
