//! Tasks: what cameras are designed for. A task is a folder here and one row of [`Tasks::built_in`]. The rest of the program uses the traits below.
//!
//! | part | holds |
//! |---|---|
//! | [`Task`], [`PreparedTask`] | what a task states, and what it does for one experiment |
//! | [`Windows`] | the windows of scenes that cameras take, with what the task knows of them |
//! | [`Objective`] | the loss of what a camera took |
//! | [`Judge`] | the scores of a camera |
//! | [`Tasks`] | all tasks, by name |
//! | [`pictures`] | pictures for people to look at |
//! | [`python`] | pictures for a loss and scores of a user |
//! | [`Scenes`] | labelled windows of streets, or of pictures of one's own |
//! | [`objects`] | objects to be found, in classes of one's own |
//! | [`segments`] | a class for every pixel |

mod judge;
pub mod objects;
pub mod pictures;
pub mod python;
mod registry;
mod scenes;
pub mod segments;
mod windows;

use burn::prelude::Device;
use petzval_base::FileError;
use petzval_camera::image::LinearImage;
use petzval_report::design_report::TaskPart;

use crate::assets::Assets;
use crate::block::NetworkBlock;
use crate::camera::Camera;
use crate::cameras::Cameras;
use crate::error::Result;
use crate::experiment::{Experiment, TaskFacts};
use crate::run::{Metrics, RunFolder};

pub use crate::objective::{Objective, WindowsOf};
pub use judge::{Depth, Findings, Judge, ScoredPicture, Taken, named_scores};
pub use registry::Tasks;
pub use scenes::{PicturePlan, ReadPictures, SceneLabels, Scenes};
pub(crate) use windows::enlarged_by;
pub use windows::{
    Content, HeldOut, PhotosLook, Purpose, Remark, SceneView, WindowInputs, WindowPlan, Windows, in_batches,
    relative_field,
};

/// What cameras are designed for.
pub trait Task: Send + Sync {
    /// What it decides of its experiments.
    fn facts(&self) -> TaskFacts;

    /// Checks the keys of an experiment that this task alone needs, such as its classes.
    fn check(&self, _experiment: &Experiment, _text: &str) -> Result<(), FileError> {
        Ok(())
    }

    /// Checks what runs of earlier versions may have, and new experiments may not.
    fn check_new(&self, _experiment: &Experiment, _text: &str) -> Result<(), FileError> {
        Ok(())
    }

    /// The names of all scores that it can compute.
    fn scores(&self, experiment: &Experiment) -> Vec<String>;

    /// Makes it ready for an experiment, without windows. Fails if given weights do not fit.
    fn prepare(
        &self,
        experiment: &Experiment,
        assets: &Assets,
        device: &Device,
    ) -> Result<Box<dyn PreparedTask>>;
}

/// A task at work on an experiment.
pub trait PreparedTask: Send + Sync {
    /// Reads or plans its windows.
    fn windows(&self, plan: &WindowPlan) -> Result<Box<dyn Windows>>;

    /// The network of a camera at the start, the same bits for every variant of a run.
    fn network(&self, cameras: &Cameras) -> Result<NetworkBlock>;

    /// What its cameras are optimised for.
    fn objective(&self, cameras: &Cameras) -> Result<Box<dyn Objective>>;

    /// What scores its cameras by the scores that the experiment names.
    fn judge(&self, cameras: &Cameras) -> Result<Box<dyn Judge>>;

    /// Weights that the experiment names for its network; none for those drawn from the seed.
    fn given_weights(&self) -> Option<&[u8]> {
        None
    }

    /// Keeps the given weights in a new run folder, and names them so in its experiment.
    fn keep_weights(&self, _run: &RunFolder, _kept: &mut Experiment) -> Result<()> {
        Ok(())
    }

    /// A picture with what the network of the camera reads in it, for people to look at, and the files of [`Self::read_files`].
    fn drawn(&self, _camera: &Camera, picture: LinearImage) -> Result<Drawn> {
        Ok(Drawn::alone(picture))
    }

    /// Names of the files that say what the network reads in a picture, for other programs: `classes.png`.
    fn read_files(&self) -> &'static [&'static str] {
        &[]
    }

    /// What the report of a run shows besides.
    fn report(&self, _cameras: &Cameras, _run: &RunFolder, _metrics: &Metrics) -> Result<TaskReport> {
        Ok(TaskReport::default())
    }
}

/// A picture with what is read in it.
pub struct Drawn {
    /// For people to look at, sRGB-encoded.
    pub shown: LinearImage,
    /// The content of each of [`PreparedTask::read_files`].
    pub files: Vec<Vec<u8>>,
}

impl Drawn {
    /// A picture without files.
    pub fn alone(shown: LinearImage) -> Self {
        Self { shown, files: Vec::new() }
    }
}

/// What the report of a run shows of a task.
#[derive(Default)]
pub struct TaskReport {
    /// What stands on its page.
    pub part: TaskPart,
    /// What is found in each held-out window, as [`TaskPart::counted`] says, by camera.
    pub found: Vec<Vec<usize>>,
    /// The place of each held-out window that a reader should see, x and y as shares of its side.
    pub focus: Vec<Option<[f64; 2]>>,
}
