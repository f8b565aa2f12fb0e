//! Windows of scenes that cameras take, and what is known of the camera that looks.

use std::collections::BTreeMap;

use petzval_camera::sensor::SensorModel;
use petzval_learn::dataset::{CropPlan, FirstReads};
use petzval_optics::lens::Lens;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::Sha256;

use crate::assets::Assets;
use crate::camera::{Camera, Shot};
use crate::cameras::Cameras;
use crate::error::Result;
use crate::experiment::Experiment;
use crate::lens::psf_plan::PsfPlan;
use crate::run::input_list::Pictures;

/// The windows of a task. They depend on the experiment and their numbers alone, and in streets on the lens that looks.
pub trait Windows: Send + Sync {
    /// The training windows of a step.
    fn training(&self, cameras: &Cameras, camera: &Camera, step: u64) -> Result<Vec<Shot>>;

    /// The training windows of a step as a lens would show them whose image is so many times as large; none if that changes nothing.
    fn magnified(
        &self,
        _cameras: &Cameras,
        _camera: &Camera,
        _step: u64,
        _by: f64,
    ) -> Result<Option<Vec<Shot>>> {
        Ok(None)
    }

    /// Whether what a camera sees of the scenes depends on the focal length of its lens.
    fn follow_the_lens(&self) -> bool {
        false
    }

    /// The windows of every validation, in batches.
    fn validation(&self, cameras: &Cameras, camera: &Camera) -> Result<Vec<Vec<Shot>>>;

    /// Those of the held-out windows that are chosen by their number.
    fn held_out(
        &self,
        cameras: &Cameras,
        camera: &Camera,
        is_chosen: &dyn Fn(usize) -> bool,
    ) -> Result<Vec<HeldOut>>;

    /// Held-out pictures, and places of the sensor at which each of them is scored.
    fn held_out_pictures(&self, experiment: &Experiment) -> [usize; 2];

    /// Makes the training windows of a step that are soon needed, where that takes long. An error comes back when they are needed.
    fn make_ahead(&self, _experiment: &Experiment, _view: SceneView, _step: u64) {}

    /// Whether windows take long enough to make that they are made ahead.
    fn are_slow(&self) -> bool {
        false
    }

    /// Refuses a sensor that cannot see what the pictures show.
    fn check_sensor(&self, _experiment: &Experiment, _sensor: &SensorModel) -> Result<()> {
        Ok(())
    }

    /// Photographs against the sensor, for a first look.
    fn photos_look(&self, _cameras: &Cameras) -> Option<PhotosLook> {
        None
    }

    /// What identifies them; adds them to a hash.
    fn inputs(
        &self,
        _experiment: &Experiment,
        _content: Content,
        _hash: &mut Sha256,
    ) -> Result<WindowInputs> {
        Ok(WindowInputs::default())
    }

    /// Digests of picture files from their first read; none where all are read at the start.
    fn first_reads(&self) -> Option<&FirstReads> {
        None
    }

    /// What the pictures are, and what of them cannot be used.
    fn remarks(&self) -> Vec<Remark> {
        Vec::new()
    }
}

/// By how much of their pictures the inputs of a run are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// All of it if the set is read at its start. Else names and sizes; digests follow when files are read first.
    AtStart,
    /// All of it. This reads every file.
    All,
}

/// What identifies the windows of an experiment.
#[derive(Default)]
pub struct WindowInputs {
    /// SHA-256 of those that are built in, by name.
    pub parts: BTreeMap<String, String>,
    /// The user's pictures.
    pub pictures: Option<Pictures>,
}

/// Something that a person should know of the pictures of an experiment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remark {
    /// What they are.
    Note(String),
    /// What of them cannot be used, or is not obeyed.
    Warning(String),
}

/// What windows are needed for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose<'p> {
    /// Training, validation where the experiment has it, and scores.
    Training,
    /// The same with the photographs of a run, wherever they are now: known by the SHA-256 of their files, in the lists and under the names of the
    /// run. Pictures with labels are taken as in [`Purpose::Training`].
    TrainingOf(&'p Pictures),
    /// Scores alone: all pictures of a user are held out.
    Scores,
}

/// What decides how windows are cut.
pub struct WindowPlan<'a> {
    /// The experiment.
    pub experiment: &'a Experiment,
    /// Where built-in pictures are.
    pub assets: &'a Assets,
    /// How training windows are cut.
    pub training_crops: CropPlan,
    /// How held-out windows are cut; in streets behind the experiment's lens.
    pub scoring_crops: CropPlan,
    /// PSFs of a lens at rest, whose last field is the corner of the sensor.
    pub fixed_plan: &'a PsfPlan,
    /// Pixel pitch, um.
    pub pixel_um: f64,
    /// The experiment's lens.
    pub nominal: &'a Lens,
    /// What the windows are for.
    pub purpose: Purpose<'a>,
}

/// A held-out window.
#[derive(Clone, Debug)]
pub struct HeldOut {
    /// Name of its photograph or scene.
    pub name: String,
    /// The film that it is of, if there are others of it.
    pub sequence: Option<String>,
    /// Distance of its middle from the axis, over that of the sensor's corner.
    pub relative_field: f64,
    /// The window.
    pub shot: Shot,
}

/// So many windows in batches of the experiment's size, each by its number.
pub fn in_batches(
    experiment: &Experiment,
    windows: usize,
    shot: impl Fn(usize) -> Result<Shot>,
) -> Result<Vec<Vec<Shot>>> {
    let batch = experiment.training.batch;
    let starts = (0..windows).step_by(batch);
    starts.map(|first| (first..windows.min(first + batch)).map(&shot).collect()).collect()
}

/// Distance of the middle of a shot's window from the axis, over that of the sensor's corner.
pub fn relative_field(cameras: &Cameras, camera: &Camera, shot: &Shot) -> f64 {
    let kept = camera.kept(shot);
    let middle = [kept.placement.row + kept.height / 2, kept.placement.col + kept.width / 2];
    camera.body().geometry.radius_mm(middle[0], middle[1]) / cameras.corner_mm()
}

/// How a camera looks at scenes. Unlike the camera it can be lent to another thread.
#[derive(Clone, Copy, Debug)]
pub struct SceneView<'a> {
    /// Its lens; none if its PSFs were measured.
    pub lens: Option<&'a Lens>,
    /// Brightness of the image, against that of the experiment's lens.
    pub light: f64,
    /// Size of the image, against that of the lens.
    pub magnification: f64,
}

impl<'a> SceneView<'a> {
    /// That of a camera.
    pub fn of(camera: &'a Camera) -> Self {
        Self { lens: camera.psfs().lens(), light: camera.light(), magnification: 1.0 }
    }

    /// The same, with an image that is so many times as large.
    pub fn magnified(self, by: f64) -> Self {
        Self { magnification: by * self.magnification, ..self }
    }
}

/// Photographs of an experiment against its sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PhotosLook {
    /// Photographs for training.
    pub training: usize,
    /// Photographs on which cameras are scored.
    pub held_out: usize,
    /// Pictures that cannot be used.
    pub skipped: usize,
    /// Side of the window of a photograph that a step takes, pixels. Windows are never enlarged.
    pub window: usize,
    /// Photographs that a whole frame of the sensor enlarges.
    pub enlarged: usize,
    /// By how much it enlarges the smallest of them; 1 if none.
    pub most_enlarged: f64,
}

/// How much a whole frame of a sensor enlarges a picture of so many rows and columns.
pub(crate) fn enlarged_by(sensor: &SensorModel, (rows, columns): (usize, usize)) -> f64 {
    (sensor.height as f64 / rows as f64).max(sensor.width as f64 / columns as f64)
}
