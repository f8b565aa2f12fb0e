//! Objects to be found: streets or labelled pictures, a detector with its own loss, and average precision. Its classes come from the experiment.

pub mod boxes;
mod judge;
mod network;
pub mod seen_windows;
mod view;

use burn::prelude::*;
use petzval_base::{Cancel, FileError};
use petzval_camera::image::LinearImage;
use petzval_camera::tape::Frames;
use petzval_learn::dataset::{Classes, LabelledPictures, RepeatedClaim};
use petzval_learn::detection::{Truth, detect_in};
use petzval_learn::loss::NamedLoss;
use petzval_learn::score::object_scores;

use super::{
    Drawn, Judge, Objective, PicturePlan, PreparedTask, SceneLabels, Scenes, Task, TaskReport, WindowPlan,
    Windows, WindowsOf,
};
use crate::assets::Assets;
use crate::block::NetworkBlock;
use crate::camera::{Camera, Labels, Shot};
use crate::cameras::Cameras;
use crate::error::{DesignError, Result};
use crate::experiment::{Experiment, NetworkRole, PicturesKey, TaskFacts};
use crate::run::{Metrics, RunFolder, write_file};

pub use network::{DetectorNetwork, Finder, Finding, detector_of, untrained};

use judge::ObjectJudge;

/// Objects in streets or in pictures of one's own, found by a detector in the finished picture.
pub struct Objects;

impl Task for Objects {
    fn facts(&self) -> TaskFacts {
        TaskFacts {
            name: "objects",
            network: NetworkRole::Reads,
            network_name: "detector",
            has_detector: true,
            has_python_class: false,
            pictures: PicturesKey::Data,
            has_classes: true,
            default_scores: Some(&["ap50", "ap", "ap75"]),
            class_score: Some("ap50"),
            scored: "objects",
        }
    }

    fn check(&self, experiment: &Experiment, text: &str) -> Result<(), FileError> {
        check_has_boxes(&experiment.classes(), text)?;
        check_names(&experiment.classes(), text)
    }

    fn check_new(&self, experiment: &Experiment, text: &str) -> Result<(), FileError> {
        check_claims(&experiment.classes(), text)
    }

    fn scores(&self, experiment: &Experiment) -> Vec<String> {
        let scores = object_scores(&experiment.classes().names());
        scores.into_iter().map(|score| score.about.name).collect()
    }

    fn prepare(&self, experiment: &Experiment, _: &Assets, _: &Device) -> Result<Box<dyn PreparedTask>> {
        let given_weights = network::given_weights(experiment)?;
        Ok(Box::new(PreparedObjects { given_weights }))
    }
}

/// Refuses classes of pixels, which have no boxes.
fn check_has_boxes(classes: &Classes, text: &str) -> Result<(), FileError> {
    for (i, class) in classes.iter().enumerate() {
        let surface = class.street.iter().position(|thing| thing.objects().is_empty());
        let wrong = match surface {
            Some(k) => {
                Some(("street", format!("`{}` is a surface, which has no box", class.street[k].name())))
            }
            None if class.ignored => Some(("ignored", "boxes of no class are left out".to_owned())),
            None if !class.values.is_empty() => Some(("values", "boxes have no values of pixels".to_owned())),
            None if class.weight.is_some() => Some(("weight", "all boxes count alike in a loss".to_owned())),
            None => None,
        };
        if let Some((key, message)) = wrong {
            let error = FileError::at_key(text, &["class", &i.to_string(), key], message);
            return Err(error.hint("leave it out, or write \"segments\" for the task"));
        }
    }
    Ok(())
}

/// Refuses classes of which one never has what it names: a category is of the first class that takes it.
fn check_claims(classes: &Classes, text: &str) -> Result<(), FileError> {
    let Some(RepeatedClaim { first, second, key, what }) = classes.repeated_claim() else { return Ok(()) };
    let message = format!("{what} is of the class `{}`, too", classes[first].name);
    let error = FileError::at_key(text, &["class", &second.to_string(), key], message);
    Err(error.hint("a category is of the first class that takes it: leave it out of one of them"))
}

/// Refuses names by which a score of a class would be that of a group of objects, too: `ap50_small`.
fn check_names(classes: &Classes, text: &str) -> Result<(), FileError> {
    let scores = object_scores(&classes.names());
    for (i, class) in classes.iter().enumerate() {
        let name = format!("ap50_{}", class.name);
        if scores.iter().filter(|score| score.about.name == name).count() > 1 {
            let message = format!("`{name}` is the score of a group of objects, too");
            let error = FileError::at_key(text, &["class", &i.to_string(), "name"], message);
            return Err(error.hint("give the class another name"));
        }
    }
    Ok(())
}

/// The task at work on an experiment.
struct PreparedObjects {
    given_weights: Option<Vec<u8>>,
}

impl PreparedTask for PreparedObjects {
    fn windows(&self, plan: &WindowPlan) -> Result<Box<dyn Windows>> {
        let labels = SceneLabels {
            classes: plan.experiment.classes(),
            surfaces: None,
            pictures: |plan| {
                let PicturePlan { folder, classes, crop, least_side_px, purpose, cancel } = *plan;
                LabelledPictures::load(folder, classes, crop, least_side_px, purpose, cancel)
            },
            of_window: |window| Labels::new(window.truth.clone()),
        };
        Ok(Box::new(Scenes::new(plan, labels)?))
    }

    fn network(&self, cameras: &Cameras) -> Result<NetworkBlock> {
        network::block(&cameras.experiment, self.given_weights.as_deref(), &cameras.body.device)
    }

    fn objective(&self, _: &Cameras) -> Result<Box<dyn Objective>> {
        Ok(Box::new(FindObjects))
    }

    fn judge(&self, cameras: &Cameras) -> Result<Box<dyn Judge>> {
        Ok(Box::new(ObjectJudge::new(cameras)?))
    }

    fn given_weights(&self) -> Option<&[u8]> {
        self.given_weights.as_deref()
    }

    fn keep_weights(&self, run: &RunFolder, kept: &mut Experiment) -> Result<()> {
        let Some(weights) = &self.given_weights else { return Ok(()) };
        let ending = if kept.detector.safetensors().is_some() { "safetensors" } else { "bin" };
        let name = format!("detector-weights.{ending}");
        write_file(&run.input(&name), weights)?;
        kept.detector.weights = Some(format!("inputs/{name}"));
        Ok(())
    }

    fn drawn(&self, camera: &Camera, picture: LinearImage) -> Result<Drawn> {
        let finder = camera.reader::<Finder>().ok_or(DesignError::OtherTask)?;
        let found = detect_in(finder.detector.as_ref(), &picture, &camera.body().device, &Cancel::default())?;
        Ok(Drawn::alone(boxes::with_sure(&picture, &found, &finder.classes.names())))
    }

    fn report(&self, cameras: &Cameras, run: &RunFolder, metrics: &Metrics) -> Result<TaskReport> {
        view::report(cameras, run, metrics)
    }
}

/// What is known of windows.
fn truths(shots: &[Shot]) -> Result<Vec<Truth>> {
    let truth = |shot: &Shot| shot.labels.of::<Truth>().cloned().ok_or(DesignError::OtherTask);
    shots.iter().map(truth).collect()
}

/// The same batch draws the same boxes, whichever block moves.
fn seed(shots: &[Shot]) -> u64 {
    shots.first().map_or(0, |shot| shot.frame)
}

/// The loss of the camera's own detector. Whatever moves, the lens, the ISP or the detector, moves so that the detector finds more.
struct FindObjects;

impl Objective for FindObjects {
    fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss> {
        let finder = camera.reader::<Finder>().ok_or(DesignError::OtherTask)?;
        Ok(finder.detector.loss(frames.finished.clone(), &truths(shots)?, seed(shots))?)
    }

    /// The boxes of which the loss is computed are drawn from those of all windows.
    fn windows(&self) -> WindowsOf {
        WindowsOf::Looks
    }

    fn look(&self, camera: &Camera, frames: &Frames) -> Result<Vec<Tensor<4>>> {
        let finder = camera.reader::<Finder>().ok_or(DesignError::OtherTask)?;
        Ok(finder.detector.look(frames.finished.clone()))
    }

    fn loss_of_look(
        &self,
        camera: &Camera,
        look: Vec<Tensor<4>>,
        picture: [usize; 2],
        shots: &[Shot],
    ) -> Result<NamedLoss> {
        let finder = camera.reader::<Finder>().ok_or(DesignError::OtherTask)?;
        Ok(finder.detector.loss_of_look(look, picture, &truths(shots)?, seed(shots))?)
    }
}
