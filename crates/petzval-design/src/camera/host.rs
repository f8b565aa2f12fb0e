//! Tensors brought back from their device.

use burn::prelude::*;
use petzval_camera::image::LinearImage;

use crate::error::DesignError;

/// The values of a tensor on the host.
pub fn to_host<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, DesignError> {
    tensor.detach().into_data().try_to_vec::<f32>().map_err(|e| DesignError::Device(format!("{e:?}")))
}

/// The first picture of a batch `[1, channels, height, width]` on the host.
pub fn host_image(tensor: Tensor<4>) -> Result<LinearImage, DesignError> {
    let [_, channels, height, width] = tensor.dims();
    Ok(LinearImage { channels, height, width, data: to_host(tensor)? })
}
