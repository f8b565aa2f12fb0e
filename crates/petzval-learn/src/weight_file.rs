//! Weights of safetensors files.

use half::f16;
use safetensors::{Dtype, SafeTensors};

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
