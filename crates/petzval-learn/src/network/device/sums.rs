//! The last step of sums over pixels: adds the parts, always in the same order.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::calculate_cube_count_elemwise;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

use super::{address_type, empty};

/// Units of a cube: neighbouring ones take neighbouring sums, and each sum is that of several units.
const LANES: usize = 32;
const ROWS: usize = 8;

/// `total[i] = sum over part of parts[part, i]`: unit `r` of a sum takes the parts `r`, `r + ROWS` and so on.
#[cube(launch, address_type = "dynamic")]
fn add_parts(parts: &Tensor<f32>, total: &mut Tensor<f32>) {
    let count = total.len();
    let (lane, row) = (UNIT_POS_X as usize, UNIT_POS_Y as usize);
    let place = CUBE_POS * LANES + lane;
    let mut sum = 0.0f32;
    if place < count {
        let mut part = row;
        while part < parts.shape(0) {
            sum += parts[part * count + place];
            part += ROWS;
        }
    }
    let mut shared = Shared::<[f32]>::new_slice(comptime![LANES * ROWS]);
    shared[row * LANES + lane] = sum;
    sync_cube();
    if row == 0 && place < count {
        let mut sum = 0.0f32;
        #[unroll]
        for r in 0..ROWS {
            sum += shared[r * LANES + lane];
        }
        total[place] = sum;
    }
}

/// The sums of contiguous `parts`, `[part, ...]`, in this shape.
pub fn sum_of_parts<const D: usize>(parts: CubeTensor, shape: [usize; D]) -> CubeTensor {
    let total = empty(&parts, shape);
    let client = parts.client.clone();
    let dim = CubeDim::new_2d(LANES as u32, ROWS as u32);
    let count = shape.iter().product::<usize>().div_ceil(LANES) * LANES * ROWS;
    let cubes = calculate_cube_count_elemwise(&client, count, dim);
    let address = address_type(&[&parts, &total]);
    add_parts::launch(&client, cubes, dim, address, parts.into_tensor_arg(), total.clone().into_tensor_arg());
    total
}
