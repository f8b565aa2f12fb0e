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

use burn::backend::tensor::FloatTensor;
use burn::backend::{BackendTensor, Cube, DispatchKindConversion, DispatchTensor, TensorMetadata};
use burn::prelude::*;
use burn::tensor::DType;
use burn_cubecl::cubecl::prelude::AddressType;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;

/// True for 32-bit floats on a device of CubeCL.
fn serves(input: &DispatchTensor) -> bool {
    input.dtype() == DType::F32 && concrete(input).is_some()
}

/// The tensor of the back end; none on other devices.
fn concrete(tensor: &DispatchTensor) -> Option<FloatTensor<Cube>> {
    <DispatchTensor as DispatchKindConversion<Cube>>::try_into_backend(tensor.clone()).ok().map(|t| t.float())
}

/// The tensors of the back end.
///
/// # Panics
/// Panics if one is on another device or carries a tape: the first input of a form that serves has neither.
fn tensors<const N: usize>(all: [&DispatchTensor; N]) -> [CubeTensor; N] {
    all.map(|tensor| concrete(tensor).expect("all tensors of a kernel are on one device, without a tape"))
}

/// The reverse of [`concrete`].
fn erased(tensor: CubeTensor) -> DispatchTensor {
    <DispatchTensor as DispatchKindConversion<Cube>>::from_backend(BackendTensor::Float(tensor))
}

/// A contiguous tensor of this shape, on the device of `like`. Its values are not set.
fn empty<const D: usize>(shape: [usize; D], like: &CubeTensor) -> CubeTensor {
    empty_device_contiguous_dtype(like.client.clone(), like.device.clone(), Shape::from(shape), DType::F32)
}

/// The address type that reaches every value of these tensors.
fn address_type(all: &[&CubeTensor]) -> AddressType {
    all.iter().map(|tensor| tensor.required_address_type()).max().unwrap_or_default()
}

#[cfg(test)]
mod tests;
