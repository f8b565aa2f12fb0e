//! Where pixels lie in pictures of any strides, and a unit for each of them.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::calculate_cube_count_elemwise;
use burn_cubecl::cubecl::prelude::*;

/// Where a pixel of the first channel of a picture lies in a tensor of any strides.
#[cube]
pub fn place(x: &Tensor<f32>, item: usize, pixel: usize) -> usize {
    let width = x.shape(3);
    item * x.stride(0) + pixel / width * x.stride(2) + pixel % width * x.stride(3)
}

/// Cubes for so many units.
pub fn units(client: &Client, count: usize) -> (CubeDim, CubeCount) {
    let dim = CubeDim::new(client, count);
    (dim, calculate_cube_count_elemwise(client, count, dim))
}
