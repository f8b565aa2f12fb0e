//! Operations of the camera on the device of their tensors, as kernels in CubeCL: one source for every GPU back end.
//!
//! Each file here gives the kernel of one operation its [`DeviceForm`](super::DeviceForm). A form computes what the kernel computes on the
//! host, in 32 bits. Only PSFs, numbers of captures and data of new scenes cross between host and device.

mod bordered;
mod convolve;
mod develop;
mod develop_back;
mod draws;
mod expose;
mod render;
mod restore;

use burn::backend::{BackendTensor, Cube, DispatchKindConversion, DispatchTensor, TensorMetadata};
use burn::tensor::{DType, Shape};
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;

/// The tensor of a device as it lies in memory; none of other devices, or with a tape.
pub fn tensor_of(tensor: &DispatchTensor) -> Option<CubeTensor> {
    <DispatchTensor as DispatchKindConversion<Cube>>::try_into_backend(tensor.clone()).ok().map(|t| t.float())
}

/// The tensor of a device, its values row by row in memory.
fn taken(tensor: &DispatchTensor) -> CubeTensor {
    into_contiguous(tensor_of(tensor).expect("forms serve tensors of devices"))
}

/// The reverse of [`tensor_of`].
pub fn given(tensor: CubeTensor) -> DispatchTensor {
    <DispatchTensor as DispatchKindConversion<Cube>>::from_backend(BackendTensor::Float(tensor))
}

/// Contiguous memory for values on the device of a tensor. They are not set.
pub fn empty(like: &CubeTensor, shape: impl Into<Shape>) -> CubeTensor {
    empty_device_contiguous_dtype(like.client.clone(), like.device.clone(), shape.into(), DType::F32)
}

/// Tensors as arguments of a kernel.
fn buffers<const N: usize>(all: [&CubeTensor; N]) -> [BufferArg; N] {
    all.map(|tensor| tensor.clone().into_buffer_arg())
}

/// Numbers on the device of a tensor. An empty list becomes one zero: devices have no empty buffers.
fn numbers(like: &CubeTensor, values: &[f32]) -> CubeTensor {
    uploaded(like, f32::as_bytes(if values.is_empty() { &[0.0] } else { values }), DType::F32)
}

/// Words on the device of a tensor.
fn words(like: &CubeTensor, values: &[u32]) -> CubeTensor {
    uploaded(like, u32::as_bytes(if values.is_empty() { &[0] } else { values }), DType::U32)
}

fn uploaded(like: &CubeTensor, bytes: &[u8], dtype: DType) -> CubeTensor {
    let handle = like.client.create_from_slice(bytes);
    let shape = Shape::from([bytes.len() / size_of::<f32>()]);
    CubeTensor::new_contiguous(like.client.clone(), like.device.clone(), shape, handle, dtype)
}

/// The values of a tensor on the host: of a few numbers, such as PSFs.
fn read(tensor: &CubeTensor) -> Vec<f32> {
    let bytes = tensor.client.read_one_unchecked(tensor.handle.clone());
    f32::from_bytes(&bytes)[..tensor.shape().num_elements()].to_vec()
}

/// The same values in another shape.
fn shaped(tensor: CubeTensor, shape: Shape) -> CubeTensor {
    CubeTensor::new_contiguous(tensor.client, tensor.device, shape, tensor.handle, tensor.dtype)
}

/// Units of a group that runs together.
const GROUP: u32 = 128;

/// Groups for one unit of each of `count` results.
fn groups(like: &CubeTensor, count: usize) -> (CubeCount, CubeDim) {
    let group = CubeDim::new_1d(GROUP);
    (burn_cubecl::cubecl::calculate_cube_count_elemwise(&like.client, count, group), group)
}
