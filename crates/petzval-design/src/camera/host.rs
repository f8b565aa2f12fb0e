//! Tensors brought back from their device.

use burn::prelude::*;
use petzval_camera::image::LinearImage;

use crate::error::{DesignError, Result};

/// The values of a tensor on the host.
pub fn to_host<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>> {
    tensor.detach().into_data().try_into_vec::<f32>().map_err(|e| DesignError::Device(format!("{e:?}")))
}

/// Finished pictures as they are stored: within 0 to 1. Fails if a value is no finite number, which the limits would hide or a file show as
/// black.
pub fn within_range(finished: Tensor<4>) -> Result<Tensor<4>> {
    if to_host(finished.clone())?.iter().all(|v| v.is_finite()) {
        Ok(finished.clamp(0.0, 1.0))
    } else {
        Err(DesignError::NotFinite("the finished picture".to_owned()))
    }
}

/// The first picture of a batch `[1, channels, height, width]` on the host.
pub fn host_image(tensor: Tensor<4>) -> Result<LinearImage> {
    let [_, channels, height, width] = tensor.dims();
    Ok(LinearImage { channels, height, width, data: to_host(tensor)? })
}
