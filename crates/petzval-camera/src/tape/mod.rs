//! The camera on the tape of the tensor framework: PSF values are leaf tensors, and every stage after them is
//! differentiable.
//!
//! ```text
//! psf_values [F,3,G,G] --render_op--> [B,3,H,W] --( * illumination_op )--> irradiance
//!            --expose_op--> raw [B,1,H,W] --linear_isp_op--> linear RGB [B,3,H,W]
//!            --restore_op (with psf_values again)--> linear RGB [B,3,H,W] --> network
//! ```
//!
//! The numeric work is the plain Rust of [`mod@crate::render`], [`crate::sensor`] and [`mod@crate::develop`]. A
//! [`Kernel`] makes it, with its hand-written adjoint, an operation of the framework on any device. On a GPU the forms of `device` take its place.

mod develop_op;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
pub mod device;
mod expose_op;
mod frames;
mod kernel;
mod linear_isp_op;
mod render_op;
mod restore_op;
mod srgb_op;

pub use develop_op::develop_op;
pub use expose_op::expose_op;
pub use frames::Frames;
pub use kernel::{BackwardPass, DeviceForm, Kernel, View, apply, computes_in_place, is_on_host, is_served};
pub use linear_isp_op::{linear_isp_op, linear_isp_pull_back};
pub use render_op::{PlacedScene, field_map, illumination_op, render_op};
pub use restore_op::{Restoration, restore_op};
pub use srgb_op::srgb_encode_op;

use burn::prelude::*;
use burn::tensor::TensorData;

use crate::image::LinearImage;

/// A picture on the device, `[1, channels, height, width]`.
pub fn on_device(picture: &LinearImage, device: &Device) -> Tensor<4> {
    let shape = [1, picture.channels, picture.height, picture.width];
    Tensor::from_data(TensorData::new(picture.data.clone(), shape), device)
}

/// The pictures of a batch behind each other; a single one is handed on as it is.
fn joined(mut pictures: Vec<Vec<f32>>) -> Vec<f32> {
    match pictures.len() {
        1 => pictures.pop().unwrap_or_default(),
        _ => pictures.concat(),
    }
}

/// Picture `index` of a batch of pictures with `channels` planes.
fn picture(batch: &[f32], index: usize, channels: usize, height: usize, width: usize) -> LinearImage {
    let n = channels * height * width;
    LinearImage { channels, height, width, data: batch[index * n..(index + 1) * n].to_vec() }
}

#[cfg(test)]
mod exposure_tests;
#[cfg(test)]
mod kernel_tests;
#[cfg(test)]
mod restore_tests;
#[cfg(test)]
mod tests;
