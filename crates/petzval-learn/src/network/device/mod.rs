//! Kernels of the networks on a GPU: the device forms of our own layers, from one source for every back end of CubeCL.
//!
//! A form serves pictures of 32-bit floats. Inputs may have any strides: a transposed picture or one with padded rows is read where it is.
//! Results are contiguous. Sums over pixels run in an order that the shapes alone fix, without atomic operations: the same inputs give the
//! same bits on every run of a device.

mod conv;
mod depthwise;
mod gate;
mod normalization;
mod pixels;
mod pointwise;
mod products;
mod sums;

use burn::backend::DispatchTensor;
use burn_cubecl::cubecl::prelude::AddressType;
use burn_cubecl::tensor::CubeTensor;
use petzval_camera::tape::device::{empty, given, tensor_of};

/// The tensors of the back end.
///
/// # Panics
/// Panics if one is on another device or carries a tape: the first input of a form that serves has neither.
fn tensors<const N: usize>(all: [&DispatchTensor; N]) -> [CubeTensor; N] {
    all.map(|tensor| tensor_of(tensor).expect("all tensors of a kernel are on one device, without a tape"))
}

/// The address type that reaches every value of these tensors.
fn address_type(all: &[&CubeTensor]) -> AddressType {
    all.iter().map(|tensor| tensor.required_address_type()).max().unwrap_or_default()
}

#[cfg(test)]
mod tests;
