//! Objects to be found: streets or labelled pictures, a detector with its own loss, and average precision. Its classes come from the experiment.

pub mod boxes;
mod judge;
mod network;
mod scenes;
pub mod seen_windows;
mod view;

use burn::prelude::Device;
use petzval_camera::image::LinearImage;
use petzval_camera::tape::Frames;
use petzval_learn::detection::{Truth, detect_in};
use petzval_learn::loss::NamedLoss;
use petzval_learn::score::object_scores;
use sha2::{Digest, Sha256};

use super::{Judge, Objective, PreparedTask, Remark, Task, TaskReport, WindowInputs, WindowPlan, Windows};
use crate::assets::Assets;
use crate::block::NetworkBlock;
use crate::camera::{Camera, Shot};
use crate::cameras::Cameras;
use crate::error::DesignError;
use crate::experiment::{Experiment, NetworkRole, PicturesKey, TaskFacts};
use crate::run::input_list::Pictures;
use crate::run::{Metrics, RunFolder, hex, write_file};

pub use network::{DetectorNetwork, Finder, Finding, detector_of, untrained};
pub use scenes::Scenes;

use judge::ObjectJudge;

/// Objects in streets or in pictures of one's own, found by a detector in the finished picture.
pub struct Objects;

impl Task for Objects {
    fn facts(&self) -> TaskFacts {
        TaskFacts {
            name: "objects",
            network: NetworkRole::Reads,
            network_name: "detector",
            pictures: PicturesKey::Data,
            has_classes: true,
            default_scores: Some(&["ap50", "ap", "ap75"]),
            scored: "objects",
        }
    }

    fn scores(&self, experiment: &Experiment) -> Vec<String> {
        let scores = object_scores(&experiment.classes().names());
        scores.into_iter().map(|score| score.about.name).collect()
    }

    fn prepare(
        &self,
        experiment: &Experiment,
        _: &Assets,
        _: &Device,
    ) -> Result<Box<dyn PreparedTask>, DesignError> {
        let given_weights = network::given_weights(experiment)?;
        Ok(Box::new(PreparedObjects { given_weights, scenes: None }))
    }
}

/// The task at work on an experiment.
struct PreparedObjects {
    given_weights: Option<Vec<u8>>,
    scenes: Option<Scenes>,
}

impl PreparedObjects {
    fn scenes(&self) -> Result<&Scenes, DesignError> {
        self.scenes.as_ref().ok_or(DesignError::NoWindows)
    }
}

impl PreparedTask for PreparedObjects {
    fn load_windows(&mut self, plan: &WindowPlan) -> Result<(), DesignError> {
        self.scenes = Some(Scenes::new(plan)?);
        Ok(())
    }

    fn windows(&self) -> Result<&dyn Windows, DesignError> {
        self.scenes().map(|scenes| scenes as _)
    }

    fn network(&self, cameras: &Cameras) -> Result<NetworkBlock, DesignError> {
        network::block(&cameras.experiment, self.given_weights.as_deref(), &cameras.body.device)
    }

    fn objective(&self, _: &Cameras) -> Result<Box<dyn Objective>, DesignError> {
        Ok(Box::new(FindObjects))
    }

    fn judge(&self, cameras: &Cameras) -> Result<Box<dyn Judge>, DesignError> {
        Ok(Box::new(ObjectJudge::new(cameras)?))
    }

    fn given_weights(&self) -> Option<&[u8]> {
        self.given_weights.as_deref()
    }

    fn keep_weights(&self, run: &RunFolder, kept: &mut Experiment) -> Result<(), DesignError> {
        let Some(weights) = &self.given_weights else { return Ok(()) };
        let ending = if kept.detector.safetensors().is_some() { "safetensors" } else { "bin" };
        let name = format!("detector-weights.{ending}");
        write_file(&run.input(&name), weights)?;
        kept.detector.weights = Some(format!("inputs/{name}"));
        Ok(())
    }

    fn inputs(&self, experiment: &Experiment, hash: &mut Sha256) -> Result<WindowInputs, DesignError> {
        let Some((files, known, labels)) = self.scenes()?.pictures()? else {
            return Ok(WindowInputs::default());
        };
        hash.update(known);
        let place = std::path::Path::new(&experiment.data);
        let place = std::fs::canonicalize(place).map_err(DesignError::io(place))?;
        let labels = Some(hex(Sha256::new_with_prefix(labels)));
        Ok(WindowInputs { pictures: Some(Pictures { place, labels, files }), ..WindowInputs::default() })
    }

    fn remarks(&self) -> Vec<Remark> {
        let Some(scenes) = &self.scenes else { return Vec::new() };
        let notes = scenes.notes.iter().map(|note| Remark::Warning(note.clone()));
        [Remark::Note(scenes.in_words())].into_iter().chain(notes).collect()
    }

    fn drawn(&self, camera: &Camera, picture: LinearImage) -> Result<LinearImage, DesignError> {
        let finder = camera.reader::<Finder>().ok_or(DesignError::OtherTask)?;
        let found = detect_in(finder.detector.as_ref(), &picture, &camera.body().device)?;
        Ok(boxes::with_sure(&picture, &found, &finder.classes.names()))
    }

    fn report(
        &self,
        cameras: &Cameras,
        run: &RunFolder,
        metrics: &Metrics,
    ) -> Result<TaskReport, DesignError> {
        view::report(cameras, run, metrics)
    }
}

/// The loss of the camera's own detector. Whatever moves, the lens, the ISP or the detector, moves so that the detector finds more.
struct FindObjects;

impl Objective for FindObjects {
    fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss, DesignError> {
        let finder = camera.reader::<Finder>().ok_or(DesignError::OtherTask)?;
        let truth = |shot: &Shot| shot.labels.of::<Truth>().cloned().ok_or(DesignError::OtherTask);
        let truths = shots.iter().map(truth).collect::<Result<Vec<_>, _>>()?;
        // The same batch draws the same, whichever block moves.
        let seed = shots.first().map_or(0, |shot| shot.frame);
        Ok(finder.detector.loss(frames.finished.clone(), &truths, seed)?)
    }
}
