//! Weights of safetensors files.

use burn::module::{Module, ModuleVisitor, Param};
use burn::prelude::*;
use half::f16;
use safetensors::{Dtype, SafeTensors, tensor::TensorView};

use crate::network::NetworkError;

/// Values of a tensor of f16 or f32. The error says what is there in place of a tensor of this shape.
pub(crate) fn read_weights(file: &SafeTensors, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
    let view = file.tensor(name).map_err(|_| "missing".to_owned())?;
    if view.shape() != shape {
        return Err(format!("of shape {:?}", view.shape()));
    }
    match view.dtype() {
        Dtype::F16 => {
            Ok(view.data().chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()).collect())
        }
        Dtype::F32 => {
            Ok(view.data().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
        }
        other => Err(format!("{other:?}")),
    }
}

/// All weights of a network as a safetensors file: 32-bit floats, row-major, under the path of fields and of places in lists, as
/// `encoder.0.weight`. The values are those of the network to the bit.
pub(crate) fn weights_file<M: Module>(network: &M) -> Result<Vec<u8>, NetworkError> {
    let not_stored = |error: &dyn std::fmt::Display| NetworkError::NotStored(error.to_string());
    let mut found = NamedWeights::default();
    network.visit(&mut found);
    let tensors: Vec<(String, Vec<usize>, Vec<u8>)> = found
        .tensors
        .into_iter()
        .map(|(name, shape, data)| {
            let values =
                data.try_to_vec::<f32>().map_err(|e| NetworkError::NotStored(format!("{name}: {e:?}")))?;
            Ok((name, shape, values.iter().flat_map(|v| v.to_le_bytes()).collect()))
        })
        .collect::<Result<_, NetworkError>>()?;
    let views: Vec<(&str, TensorView)> = tensors
        .iter()
        .map(|(name, shape, bytes)| Ok((name.as_str(), TensorView::new(Dtype::F32, shape.clone(), bytes)?)))
        .collect::<Result<_, safetensors::SafeTensorError>>()
        .map_err(|error| not_stored(&error))?;
    safetensors::serialize(views, None).map_err(|error| not_stored(&error))
}

/// Collects the weights of a network with their paths.
#[derive(Default)]
struct NamedWeights {
    path: Vec<String>,
    tensors: Vec<(String, Vec<usize>, TensorData)>,
}

impl NamedWeights {
    /// The variant of an enum is no part of a path: a network has only one.
    fn is_part(container: &str) -> bool {
        !container.starts_with("Enum:")
    }
}

impl ModuleVisitor for NamedWeights {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let weights = param.val().detach();
        self.tensors.push((self.path.join("."), weights.dims().to_vec(), weights.into_data()));
    }

    fn enter_module(&mut self, name: &str, container: &str) {
        if Self::is_part(container) {
            self.path.push(name.to_owned());
        }
    }

    fn exit_module(&mut self, _name: &str, container: &str) {
        if Self::is_part(container) {
            self.path.pop();
        }
    }
}
