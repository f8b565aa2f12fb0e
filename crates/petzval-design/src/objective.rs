//! What cameras are optimised for: the loss of what a camera took.

use burn::prelude::*;
use petzval_camera::tape::Frames;
use petzval_learn::loss::NamedLoss;

use crate::camera::{Camera, Shot};
use crate::error::{DesignError, Result};

/// The loss of what a camera took.
///
/// A function of these arguments is an objective that looks at a batch as a whole.
pub trait Objective: Send + Sync {
    /// The mean over the pictures of a batch. Its graph leads to whatever the graphs of the frames and of the camera's network lead to.
    fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss>;

    /// How windows go into it, which decides how they are taken on all threads.
    fn windows(&self) -> WindowsOf {
        WindowsOf::Whole
    }

    /// With [`WindowsOf::Apart`], the share of each window in the loss of all.
    fn shares(&self, shots: &[Shot]) -> Result<Vec<f64>> {
        Ok(vec![1.0 / shots.len() as f64; shots.len()])
    }

    /// With [`WindowsOf::Looks`], the layers that see each window alone: tensors of which each has the windows along its first dimension.
    fn look(&self, _camera: &Camera, frames: &Frames) -> Result<Vec<Tensor<4>>> {
        Ok(vec![frames.finished.clone()])
    }

    /// With [`WindowsOf::Looks`], the loss of finished pictures with this height and width from what [`look`](Self::look) gives of all of them.
    fn loss_of_look(
        &self,
        _camera: &Camera,
        _look: Vec<Tensor<4>>,
        _picture: [usize; 2],
        _shots: &[Shot],
    ) -> Result<NamedLoss> {
        Err(DesignError::OtherTask)
    }
}

/// How the windows of a batch go into an [`Objective`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WindowsOf {
    /// In any way: they are taken together.
    Whole,
    /// One by one: the loss and each of its parts are sums over the windows, share times the loss of the window alone.
    Apart,
    /// Through layers that see each window alone and do nearly all of the work. The loss is one of what they give of all windows.
    Looks,
}

impl<F> Objective for F
where
    F: Fn(&Camera, &Frames, &[Shot]) -> Result<NamedLoss> + Send + Sync,
{
    fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss> {
        self(camera, frames, shots)
    }
}
