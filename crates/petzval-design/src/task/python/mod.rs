//! Pictures judged by a class of the user in Python: its loss and its scores. Windows and network are those of [`pictures`](super::pictures).

mod judge;

use std::sync::{Arc, Mutex, PoisonError};

use burn::prelude::Device;
use petzval_camera::tape::Frames;
use petzval_learn::guest::GuestError;
use petzval_learn::guest_task::GuestTask;
use petzval_learn::loss::NamedLoss;

use super::pictures::{Pictures, PreparedPictures};
use super::{Judge, Objective, PreparedTask, Task, WindowPlan, Windows};
use crate::assets::Assets;
use crate::block::NetworkBlock;
use crate::camera::{Camera, Shot};
use crate::cameras::Cameras;
use crate::error::Result;
use crate::experiment::{Experiment, PYTHON, TaskFacts};
use crate::run::RunFolder;

use judge::OwnJudge;

/// A picture for what a class in Python says. It scores by the class and by the usual scores of pictures.
pub struct PythonTask;

impl Task for PythonTask {
    fn facts(&self) -> TaskFacts {
        TaskFacts { name: PYTHON, has_python_class: true, ..Pictures.facts() }
    }

    /// Those of the class are known when it is made: the judge refuses others.
    fn scores(&self, experiment: &Experiment) -> Vec<String> {
        experiment.scoring.scores.clone()
    }

    /// The class is made when it is first needed: a finished run is reported without it.
    fn prepare(
        &self,
        experiment: &Experiment,
        assets: &Assets,
        device: &Device,
    ) -> Result<Box<dyn PreparedTask>> {
        let pictures = PreparedPictures::new(experiment, assets, device)?;
        Ok(Box::new(PreparedPython { pictures, made: Mutex::default() }))
    }
}

/// The task at work on an experiment.
struct PreparedPython {
    pictures: PreparedPictures,
    made: Mutex<Option<Arc<GuestTask>>>,
}

impl PreparedPython {
    /// The object of the class: one for loss and scores.
    fn own(&self, experiment: &Experiment) -> Result<Arc<GuestTask>> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(own) = &*made {
            return Ok(own.clone());
        }
        let class = experiment.python.as_ref().and_then(|python| python.task.as_ref());
        let (Some(class), Some(host)) = (class, &self.pictures.host) else {
            let message = "the task is \"python\", and python.task names no class".to_owned();
            let hint = "write [python.task] with class = \"my_module:MyClass\"".to_owned();
            return Err(GuestError::Unusable { message, hint }.into());
        };
        let own = Arc::new(GuestTask::new(&**host, class)?);
        Ok(made.insert(own).clone())
    }
}

impl PreparedTask for PreparedPython {
    fn windows(&self, plan: &WindowPlan) -> Result<Box<dyn Windows>> {
        self.pictures.windows(plan)
    }

    fn network(&self, cameras: &Cameras) -> Result<NetworkBlock> {
        self.pictures.network(cameras)
    }

    fn objective(&self, cameras: &Cameras) -> Result<Box<dyn Objective>> {
        Ok(Box::new(OwnLoss(self.own(&cameras.experiment)?)))
    }

    fn judge(&self, cameras: &Cameras) -> Result<Box<dyn Judge>> {
        Ok(Box::new(OwnJudge::new(cameras, self.own(&cameras.experiment)?)?))
    }

    fn given_weights(&self) -> Option<&[u8]> {
        self.pictures.given_weights()
    }

    fn keep_weights(&self, run: &RunFolder, kept: &mut Experiment) -> Result<()> {
        self.pictures.keep_weights(run, kept)
    }
}

/// The loss of a class.
struct OwnLoss(Arc<GuestTask>);

impl Objective for OwnLoss {
    fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss> {
        let loss = self.0.loss(frames.finished.clone(), camera.truths(shots)?)?;
        Ok(NamedLoss::sum(vec![("loss", loss)])?)
    }
}
