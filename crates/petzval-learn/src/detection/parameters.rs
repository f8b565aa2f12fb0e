//! Where the weights of a detector come from: drawn from a seed, or read from a file with the names of torchvision.

use std::cell::RefCell;

use burn::module::Param;
use burn::prelude::*;
use burn::tensor::TensorData;
use safetensors::SafeTensors;

use crate::network::{Initializer, NetworkError};
use crate::weight_file::read_weights;

/// How a weight starts that is not read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Start {
    /// Normal, with this standard deviation.
    Normal(f32),
    /// All the same.
    Constant(f32),
}

/// Gives the weights of a detector by name while it is built.
pub(crate) enum Parameters<'a> {
    /// Draws them.
    Drawn(RefCell<Initializer>),
    /// Reads them.
    Read { file: &'a SafeTensors<'a>, drawn: RefCell<Initializer> },
}

impl<'a> Parameters<'a> {
    /// Weights from a seed.
    pub fn drawn(seed: u64, device: &Device) -> Self {
        Self::Drawn(RefCell::new(Initializer::new(seed, device)))
    }

    /// Weights of a file; their numbers for optimisers derive from the seed.
    pub fn read(file: &'a SafeTensors<'a>, seed: u64, device: &Device) -> Self {
        Self::Read { file, drawn: RefCell::new(Initializer::new(seed, device)) }
    }

    /// A weight that is trained.
    pub fn trained<const D: usize>(
        &self,
        name: &str,
        shape: [usize; D],
        start: Start,
    ) -> Result<Param<Tensor<D>>, NetworkError> {
        match self {
            Self::Drawn(drawn) => {
                let mut drawn = drawn.borrow_mut();
                Ok(match start {
                    Start::Normal(deviation) => drawn.normal(shape, deviation),
                    Start::Constant(value) => drawn.constant(shape, value),
                })
            }
            Self::Read { file, drawn } => {
                let values = values(file, name, &shape)?;
                Ok(drawn.borrow_mut().parameter(values, shape))
            }
        }
    }

    /// A weight that never moves, such as the statistics of a frozen batch normalisation.
    pub fn frozen<const D: usize>(
        &self,
        name: &str,
        shape: [usize; D],
        value: f32,
    ) -> Result<Param<Tensor<D>>, NetworkError> {
        Ok(self.trained(name, shape, Start::Constant(value))?.set_require_grad(false))
    }
}

/// Values of a tensor of the file, f32 or f16.
fn values(file: &SafeTensors, name: &str, shape: &[usize]) -> Result<Vec<f32>, NetworkError> {
    let refuse = |found: String| {
        NetworkError::BadWeights(format!("`{name}` is {found}, expected F32 or F16 of shape {shape:?}"))
    };
    let values = read_weights(file, name, shape).map_err(refuse)?;
    match values.iter().all(|v| v.is_finite()) {
        true => Ok(values),
        false => Err(refuse("not finite everywhere".to_owned())),
    }
}

/// A tensor of values on a device, without a gradient.
pub(crate) fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, shape), device)
}
