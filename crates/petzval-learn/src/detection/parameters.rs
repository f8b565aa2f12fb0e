//! Where the weights of a detector come from: drawn from a seed, or read from a file with the names of torchvision, all or those of its
//! backbone.

use std::cell::RefCell;

use burn::module::{Param, ParamId};
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
    Read { file: &'a SafeTensors<'a>, outputs: Option<Outputs>, drawn: RefCell<Initializer> },
    /// Zeros, and the name of each by its number.
    Listed { names: RefCell<Vec<(ParamId, String)>>, drawn: RefCell<Initializer> },
    /// Reads those of the backbone from a file of a classifier, and draws the others.
    ReadBackbone { file: &'a SafeTensors<'a>, drawn: RefCell<Initializer> },
}

/// Which outputs of the detector in a file become those of this one, where the file knows other classes.
#[derive(Clone, Debug)]
pub(crate) struct Outputs {
    /// Outputs in the file: the background and its classes.
    pub of: usize,
    /// The number there of each output of this detector, the background first.
    pub taken: Vec<usize>,
}

/// The layers of the backbone.
const OF_BACKBONE: &str = "backbone.body.";

/// The layers that have outputs for each class: under this name, one or four rows of an output after another.
const OF_CLASSES: &str = "roi_heads.box_predictor.";

impl<'a> Parameters<'a> {
    /// Weights from a seed.
    pub fn drawn(seed: u64, device: &Device) -> Self {
        Self::Drawn(RefCell::new(Initializer::new(seed, device)))
    }

    /// Zeros whose names are listed.
    pub fn listed(device: &Device) -> Self {
        Self::Listed { names: RefCell::default(), drawn: RefCell::new(Initializer::new(0, device)) }
    }

    /// The names that were listed, by the numbers of their weights.
    pub fn names(self) -> Vec<(ParamId, String)> {
        match self {
            Self::Listed { names, .. } => names.into_inner(),
            _ => Vec::new(),
        }
    }

    /// Weights of a file; their numbers for optimisers derive from the seed.
    pub fn read(file: &'a SafeTensors<'a>, seed: u64, device: &Device) -> Self {
        Self::Read { file, outputs: None, drawn: RefCell::new(Initializer::new(seed, device)) }
    }

    /// Weights of the backbone from a file of a classifier on the same backbone; the others are drawn from the seed.
    pub fn read_backbone(file: &'a SafeTensors<'a>, seed: u64, device: &Device) -> Self {
        Self::ReadBackbone { file, drawn: RefCell::new(Initializer::new(seed, device)) }
    }

    /// The same for a file of a detector with other classes; other weights stay.
    pub fn taking(mut self, taken: Outputs) -> Self {
        if let Self::Read { outputs, .. } = &mut self {
            *outputs = Some(taken);
        }
        self
    }

    /// A weight that is trained.
    pub fn trained<const D: usize>(
        &self,
        name: &str,
        shape: [usize; D],
        start: Start,
    ) -> Result<Param<Tensor<D>>, NetworkError> {
        let (values, drawn) = match self {
            Self::Drawn(drawn) => (None, drawn),
            Self::Listed { names, drawn } => {
                let zeros = drawn.borrow_mut().zeros(shape);
                names.borrow_mut().push((zeros.id, name.to_owned()));
                return Ok(zeros);
            }
            Self::ReadBackbone { file, drawn } => {
                let name = name.strip_prefix(OF_BACKBONE).map(name_in_classifier);
                (name.map(|name| values(file, &name, &shape)).transpose()?, drawn)
            }
            Self::Read { file, outputs, drawn } => {
                let values = match outputs.as_ref().filter(|_| name.starts_with(OF_CLASSES)) {
                    Some(outputs) => values_of_outputs(file, name, &shape, outputs)?,
                    None => values(file, name, &shape)?,
                };
                (Some(values), drawn)
            }
        };
        let mut drawn = drawn.borrow_mut();
        Ok(match (values, start) {
            (Some(values), _) => drawn.parameter(values, shape),
            (None, Start::Normal(deviation)) => drawn.normal(shape, deviation),
            (None, Start::Constant(value)) => drawn.constant(shape, value),
        })
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

/// The name in a classifier of torchvision of what a detector has in its backbone: the same, but those layers of MobileNetV2 that have numbers
/// are its features.
fn name_in_classifier(in_backbone: &str) -> String {
    let prefix = if in_backbone.starts_with(|c: char| c.is_ascii_digit()) { "features." } else { "" };
    format!("{prefix}{in_backbone}")
}

/// Values of a tensor of the file, f32 or f16.
fn values(file: &SafeTensors, name: &str, shape: &[usize]) -> Result<Vec<f32>, NetworkError> {
    let refuse = |found: String| {
        NetworkError::BadWeights(format!("`{name}` is {found}, expected F32 or F16 of shape {shape:?}"))
    };
    read_weights(file, name, shape).map_err(refuse)
}

/// The same of a tensor whose rows belong to outputs, in the order of this detector's outputs.
fn values_of_outputs(
    file: &SafeTensors,
    name: &str,
    shape: &[usize],
    Outputs { of, taken }: &Outputs,
) -> Result<Vec<f32>, NetworkError> {
    let mut theirs = shape.to_vec();
    theirs[0] = shape[0] / taken.len() * of;
    let all = values(file, name, &theirs)?;
    let size = all.len() / of;
    Ok(taken.iter().flat_map(|output| &all[output * size..(output + 1) * size]).copied().collect())
}

/// A tensor of values on a device, without a gradient.
pub(crate) fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, shape), device)
}
