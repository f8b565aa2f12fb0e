//! Tensors brought back from their device.

use burn::prelude::*;

use crate::error::DesignError;

/// The values of a tensor on the host.
pub fn to_host<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, DesignError> {
    tensor.detach().into_data().try_to_vec::<f32>().map_err(|e| DesignError::Device(format!("{e:?}")))
}
