//! What a camera is for: a network behind the development, its loss, and how it learns.
//!
//! The design loop knows a task only by this interface, so that another task needs no change there.

mod image_quality;

pub use image_quality::ImageQualityTask;

use std::path::{Path, PathBuf};

use burn::prelude::*;

use crate::loss::LossError;
use crate::network::NetworkError;

/// A loss with its graph, and its parts by name.
pub struct TaskLoss {
    /// The loss, one value, with its graph.
    pub total: Tensor<1>,
    /// The loss and what it is made of, by name.
    pub parts: Vec<(&'static str, f64)>,
}

/// Why a task could not be made, or its state not kept.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// The network could not be made or restored.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The loss could not be made or computed.
    #[error(transparent)]
    Loss(#[from] LossError),
    /// A file of its state could not be read or written.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// The state of the network is damaged, or that of another network.
    #[error("{}: {error}", path.display())]
    Weights {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: NetworkError,
    },
    /// The state of the optimiser is damaged.
    #[error("{}: not the state of this optimiser: {problem}", path.display())]
    Optimizer {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

/// A network with its loss and its optimiser. Pictures are `[batch, 3, height, width]`, sRGB-encoded.
pub trait Task {
    /// The loss of developed pictures against the truth, with a graph to the network's weights.
    fn learning_loss(&self, developed: Tensor<4>, truth: Tensor<4>) -> Result<TaskLoss, TaskError>;

    /// The same loss with the network held: the graph leads to the developed pictures alone.
    fn held_loss(&self, developed: Tensor<4>, truth: Tensor<4>) -> Result<TaskLoss, TaskError>;

    /// One step of the optimiser down the gradient of a [`learning_loss`](Self::learning_loss).
    fn learn(&mut self, loss: TaskLoss, learning_rate: f64);

    /// The finished pictures.
    fn picture(&self, developed: Tensor<4>) -> Tensor<4>;

    /// Writes the network and its optimiser into a folder, exact to the bit.
    fn save(&self, folder: &Path) -> Result<(), TaskError>;

    /// Takes over what [`save`](Self::save) wrote.
    fn load(&mut self, folder: &Path) -> Result<(), TaskError>;
}
