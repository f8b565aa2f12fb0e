//! Pictures for people to look at: photographs, a loss of pictures against the truth, and scores of single pictures.

mod ahead;
mod judge;
mod network;
mod photographs;
mod windows;

use std::sync::Arc;

use burn::prelude::Device;
use petzval_camera::tape::Frames;
use petzval_learn::guest::Host;
use petzval_learn::loss::{ImageLoss, Lpips, NamedLoss};
use petzval_learn::score::{STANDARD_SCORES, standard_scores};

use super::{Judge, Objective, PreparedTask, Task, WindowPlan, Windows, WindowsOf};
use crate::assets::Assets;
use crate::block::NetworkBlock;
use crate::camera::{Camera, Shot};
use crate::cameras::Cameras;
use crate::error::Result;
use crate::experiment::{Experiment, NetworkRole, PicturesKey, TaskFacts};
use crate::run::{RunFolder, write_file};

pub use judge::PictureJudge;
pub use network::Finishing;
pub use photographs::Photographs;
pub(crate) use photographs::built_in_photos;

/// A picture for people to look at, made by a network from the developed raw frame.
pub struct Pictures;

impl Task for Pictures {
    fn facts(&self) -> TaskFacts {
        TaskFacts {
            name: "image-quality",
            network: NetworkRole::Finishes,
            network_name: "network",
            has_detector: false,
            has_python_class: false,
            pictures: PicturesKey::Photos,
            has_classes: false,
            default_scores: None,
            class_score: None,
            scored: "pictures",
        }
    }

    fn scores(&self, _: &Experiment) -> Vec<String> {
        STANDARD_SCORES.map(str::to_owned).to_vec()
    }

    fn prepare(
        &self,
        experiment: &Experiment,
        assets: &Assets,
        device: &Device,
    ) -> Result<Box<dyn PreparedTask>> {
        Ok(Box::new(PreparedPictures::new(experiment, assets, device)?))
    }
}

/// The task at work on an experiment.
pub(super) struct PreparedPictures {
    given_weights: Option<Vec<u8>>,
    /// Where classes in Python live, if the experiment names some.
    pub host: Option<Arc<dyn Host>>,
}

impl PreparedPictures {
    /// Reads given weights.
    pub fn new(experiment: &Experiment, assets: &Assets, device: &Device) -> Result<Self> {
        let host =
            experiment.python.as_ref().map(|python| assets.guest_host(python.timeout_s)).transpose()?;
        let given_weights = network::given_weights(experiment, assets, device)?;
        Ok(Self { given_weights, host })
    }
}

impl PreparedTask for PreparedPictures {
    fn windows(&self, plan: &WindowPlan) -> Result<Box<dyn Windows>> {
        Ok(Box::new(Photographs::load(plan)?))
    }

    fn network(&self, cameras: &Cameras) -> Result<NetworkBlock> {
        network::block(cameras, self.given_weights.as_deref(), self.host.as_deref())
    }

    fn objective(&self, cameras: &Cameras) -> Result<Box<dyn Objective>> {
        Ok(Box::new(ImageQuality::new(cameras.experiment.loss.clone(), cameras.lpips()?)?))
    }

    fn judge(&self, cameras: &Cameras) -> Result<Box<dyn Judge>> {
        let known = standard_scores(&cameras.lpips()?);
        Ok(Box::new(PictureJudge::new(&cameras.experiment, known)?))
    }

    fn given_weights(&self) -> Option<&[u8]> {
        self.given_weights.as_deref()
    }

    fn keep_weights(&self, run: &RunFolder, kept: &mut Experiment) -> Result<()> {
        // The built-in ones are known by their fingerprint, as the built-in photographs are.
        let given = self.given_weights.as_ref().filter(|_| !kept.network.has_built_in_weights());
        if let Some(weights) = given {
            let file = if kept.network.kind.ours().is_some() { "network.safetensors" } else { "network.bin" };
            write_file(&run.input(file), weights)?;
            kept.network.weights = format!("inputs/{file}");
        }
        Ok(())
    }
}

/// The weighted sum of L1, L2, `1 - SSIM` and LPIPS of finished picture and truth, see [`ImageLoss`].
struct ImageQuality {
    loss: ImageLoss,
    lpips: Lpips,
}

impl ImageQuality {
    /// Refuses weights that are negative or not finite.
    fn new(loss: ImageLoss, lpips: Lpips) -> Result<Self> {
        loss.check()?;
        Ok(Self { loss, lpips })
    }
}

impl Objective for ImageQuality {
    fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss> {
        let target = self.loss.target(&self.lpips, camera.truths(shots)?)?;
        let parts = self.loss.evaluate(&self.lpips, frames.finished.clone(), &target)?;
        let weighted = parts.parts.iter().map(|part| f64::from(part.weight) * f64::from(part.value));
        let total = weighted.sum::<f64>();
        let mut named: Vec<(&'static str, f64)> =
            parts.parts.iter().map(|part| (part.name, f64::from(part.value))).collect();
        named.push(("total", total));
        Ok(NamedLoss { total: parts.total, parts: named })
    }

    /// All parts are means over pictures of one size.
    fn windows(&self) -> WindowsOf {
        WindowsOf::Apart
    }
}
