//! Pictures for people to look at: photographs, a loss of pictures against the truth, and scores of single pictures.

mod judge;
mod network;
mod photographs;
mod windows;

use std::collections::BTreeMap;

use burn::prelude::Device;
use petzval_camera::tape::Frames;
use petzval_learn::loss::{ImageLoss, Lpips, NamedLoss};
use petzval_learn::score::{STANDARD_SCORES, standard_scores};
use sha2::{Digest, Sha256};

use super::{Judge, Objective, PreparedTask, Remark, Task, WindowInputs, WindowPlan, Windows};
use crate::assets::Assets;
use crate::block::NetworkBlock;
use crate::camera::{Camera, Shot};
use crate::cameras::Cameras;
use crate::error::DesignError;
use crate::experiment::{BUILT_IN_PHOTOS, Experiment, NetworkRole, PicturesKey, TaskFacts};
use crate::run::input_list::BUILT_IN;
use crate::run::{RunFolder, hex, write_file};

pub use judge::PictureJudge;
pub use network::Finishing;
pub use photographs::Photographs;

/// A picture for people to look at, made by a network from the developed raw frame.
pub struct Pictures;

impl Task for Pictures {
    fn facts(&self) -> TaskFacts {
        TaskFacts {
            name: "image-quality",
            network: NetworkRole::Finishes,
            network_name: "network",
            pictures: PicturesKey::Photos,
            has_classes: false,
            default_scores: None,
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
    ) -> Result<Box<dyn PreparedTask>, DesignError> {
        let given_weights = network::given_weights(experiment, assets, device)?;
        Ok(Box::new(PreparedPictures { given_weights, photographs: None }))
    }
}

/// The task at work on an experiment.
struct PreparedPictures {
    given_weights: Option<Vec<u8>>,
    photographs: Option<Photographs>,
}

impl PreparedTask for PreparedPictures {
    fn load_windows(&mut self, plan: &WindowPlan) -> Result<(), DesignError> {
        self.photographs = Some(Photographs::load(plan)?);
        Ok(())
    }

    fn windows(&self) -> Result<&dyn Windows, DesignError> {
        self.photographs.as_ref().map(|photographs| photographs as _).ok_or(DesignError::NoWindows)
    }

    fn network(&self, cameras: &Cameras) -> Result<NetworkBlock, DesignError> {
        network::block(cameras, self.given_weights.as_deref())
    }

    fn objective(&self, cameras: &Cameras) -> Result<Box<dyn Objective>, DesignError> {
        Ok(Box::new(ImageQuality::new(cameras.experiment.loss.clone(), cameras.lpips()?)?))
    }

    fn judge(&self, cameras: &Cameras) -> Result<Box<dyn Judge>, DesignError> {
        let known = standard_scores(&cameras.lpips()?);
        Ok(Box::new(PictureJudge::new(&cameras.experiment, known)?))
    }

    fn given_weights(&self) -> Option<&[u8]> {
        self.given_weights.as_deref()
    }

    fn keep_weights(&self, run: &RunFolder, kept: &mut Experiment) -> Result<(), DesignError> {
        // The built-in ones are known by their fingerprint, as the built-in photographs are.
        let given = self.given_weights.as_ref().filter(|_| !kept.network.has_built_in_weights());
        if let Some(weights) = given {
            write_file(&run.input("network.safetensors"), weights)?;
            kept.network.weights = "inputs/network.safetensors".to_owned();
        }
        Ok(())
    }

    fn inputs(&self, experiment: &Experiment, hash: &mut Sha256) -> Result<WindowInputs, DesignError> {
        let photographs = self.photographs.as_ref().ok_or(DesignError::NoWindows)?;
        photographs.add_to(hash);
        if experiment.photos != BUILT_IN_PHOTOS {
            let pictures = Some(photographs.files(&experiment.photos)?);
            return Ok(WindowInputs { pictures, ..WindowInputs::default() });
        }
        let mut own = Sha256::new();
        photographs.add_to(&mut own);
        let parts = BTreeMap::from([(BUILT_IN.to_owned(), hex(own))]);
        Ok(WindowInputs { parts, pictures: None })
    }

    fn remarks(&self) -> Vec<Remark> {
        self.photographs.as_ref().map_or_else(Vec::new, Photographs::remarks)
    }
}

/// The weighted sum of L1, L2, `1 - SSIM` and LPIPS of finished picture and truth, see [`ImageLoss`].
struct ImageQuality {
    loss: ImageLoss,
    lpips: Lpips,
}

impl ImageQuality {
    /// Refuses weights that are negative or not finite.
    fn new(loss: ImageLoss, lpips: Lpips) -> Result<Self, DesignError> {
        loss.check()?;
        Ok(Self { loss, lpips })
    }
}

impl Objective for ImageQuality {
    fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss, DesignError> {
        let target = self.loss.target(&self.lpips, camera.truths(shots)?)?;
        let parts = self.loss.evaluate(&self.lpips, frames.finished.clone(), &target)?;
        let weighted = parts.parts.iter().map(|part| f64::from(part.weight) * f64::from(part.value));
        let total = weighted.sum::<f64>();
        let mut named: Vec<(&'static str, f64)> =
            parts.parts.iter().map(|part| (part.name, f64::from(part.value))).collect();
        named.push(("total", total));
        Ok(NamedLoss { total: parts.total, parts: named })
    }
}
