//! The purpose of a camera as a task: the network after development, its loss and its training step.
//!
//! The design loop uses a task only through this interface, so that another task needs no change there.

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
    /// The values of the loss and its parts, by name.
    pub parts: Vec<(&'static str, f64)>,
}

/// Why a task could not be made, saved or loaded.
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
        /// The error of the system.
        error: std::io::Error,
    },
    /// The stored network is damaged, or belongs to another configuration.
    #[error("{}: {error}", path.display())]
    Weights {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: NetworkError,
    },
    /// The stored optimiser is damaged.
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
    /// The loss of developed pictures against the truth, with a graph to the weights of the network.
    fn learning_loss(&self, developed: Tensor<4>, truth: Tensor<4>) -> Result<TaskLoss, TaskError>;

    /// The same loss with frozen weights: the graph leads only to the developed pictures.
    fn held_loss(&self, developed: Tensor<4>, truth: Tensor<4>) -> Result<TaskLoss, TaskError>;

    /// Takes one step of the optimiser along the negative gradient of a [`learning_loss`](Self::learning_loss).
    fn learn(&mut self, loss: TaskLoss, learning_rate: f64);

    /// The pictures that the network finishes, without a graph to its weights.
    fn picture(&self, developed: Tensor<4>) -> Tensor<4>;

    /// Writes the network and its optimiser into a folder, exact to the bit.
    fn save(&self, folder: &Path) -> Result<(), TaskError>;

    /// Loads the state that [`save`](Self::save) wrote.
    fn load(&mut self, folder: &Path) -> Result<(), TaskError>;
}
