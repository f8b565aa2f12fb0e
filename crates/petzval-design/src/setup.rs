//! An experiment made ready: its cameras, and its task with its windows.

use std::collections::BTreeSet;
use std::ops::Deref;
use std::sync::Arc;

use burn::prelude::Device;
use petzval_base::Cancel;
use petzval_camera::psf::PsfBank;
use petzval_camera::sensor::Noise;
use petzval_learn::score::standard_scores;

use crate::block::{Blocks, ExposureBlock, ImitationPlan, IspBlock, NetworkBlock, OpticsBlock};
use crate::camera::{Camera, Shot};
use crate::cameras::Cameras;
use crate::error::{DesignError, Result};
use crate::experiment::{Experiment, ExposureSetting, Variant, places_of};
use crate::library::Library;
use crate::study::Study;
use crate::task::{HeldOut, Objective, PreparedTask, Purpose, WindowPlan, Windows};

/// Everything that the design loop needs and that does not change during it.
pub struct Setup {
    /// Which cameras are designed.
    pub cameras: Cameras,
    /// What the cameras are designed for.
    pub task: Box<dyn PreparedTask>,
    windows: Option<Box<dyn Windows>>,
    /// How far differences between cameras scatter with the seed, where that is known of this experiment.
    pub study: Option<Study>,
    /// Stops runs and scoring.
    pub cancel: Cancel,
}

impl Deref for Setup {
    type Target = Cameras;

    fn deref(&self) -> &Cameras {
        &self.cameras
    }
}

impl Setup {
    /// An experiment with the windows for its training and its scores. That of a run is set up by [`setup_of_run`](crate::inputs::setup_of_run).
    pub fn new(experiment: Experiment, library: &Library, device: Device) -> Result<Self> {
        Self::with_psfs(experiment, library, device, None, Purpose::Training)
    }

    /// The same for a purpose, with PSFs in place of those of every lens, if there are any.
    pub(crate) fn with_psfs(
        experiment: Experiment,
        library: &Library,
        device: Device,
        psfs: Option<&Arc<PsfBank>>,
        purpose: Purpose<'_>,
    ) -> Result<Self> {
        let setup = Self::without_windows(experiment, library, device)?;
        let setup = match psfs {
            Some(bank) => setup.having_psfs(bank.clone())?,
            None => setup,
        };
        if purpose != Purpose::Scores {
            // Fails now, while there is no run folder yet, if weights do not fit.
            setup.network()?;
        }
        setup.with_windows(library, purpose)
    }

    /// The same setup, without windows, whose cameras have these PSFs in place of those of their lenses; see [`Cameras::with_psfs`].
    pub fn having_psfs(self, bank: Arc<PsfBank>) -> Result<Self> {
        Ok(Self { cameras: self.cameras.with_psfs(bank)?, windows: None, ..self })
    }

    /// [`Setup::new`] without windows, for what is not done with them.
    pub fn without_windows(experiment: Experiment, library: &Library, device: Device) -> Result<Self> {
        let task = library.tasks().of(&experiment)?;
        let cameras = Cameras::new(experiment, &task.facts(), library, device)?;
        let task = task.prepare(&cameras.experiment, library, &cameras.body.device)?;
        let study = Study::of(&cameras.experiment, library)?;
        Ok(Self { cameras, task, windows: None, study, cancel: library.cancel().clone() })
    }

    fn with_windows(self, library: &Library, purpose: Purpose<'_>) -> Result<Self> {
        let windows = self.task.windows(&WindowPlan {
            experiment: &self.experiment,
            assets: library,
            training_crops: self.training_crops,
            scoring_crops: self.scoring_crops,
            fixed_plan: &self.fixed_plan,
            pixel_um: self.body.sensor.pixel_um,
            nominal: &self.nominal().lens_file.lens,
            purpose,
        })?;
        Ok(Self { windows: Some(windows), ..self })
    }

    /// The windows of the task. Fails for a setup without them.
    pub fn windows(&self) -> Result<&dyn Windows> {
        self.windows.as_deref().ok_or(DesignError::NoWindows)
    }

    /// A network as a variant starts with it, untrained or with given weights: the same bits for every variant of a run.
    pub fn network(&self) -> Result<NetworkBlock> {
        self.task.network(self)
    }

    /// What the cameras are optimised for.
    pub fn objective(&self) -> Result<Box<dyn Objective>> {
        self.task.objective(self)
    }

    /// The noise of a variant's frames.
    pub fn noise(&self, variant: &Variant) -> Noise {
        Noise { mode: variant.noise, seed: self.experiment.seed }
    }

    /// The training windows of a step.
    pub fn training_shots(&self, camera: &Camera, step: u64) -> Result<Vec<Shot>> {
        self.windows()?.training(self, camera, step)
    }

    /// The training windows of a step as a camera would see them if its lens were another one like it, whose image is so many times as large.
    pub fn magnified_shots(&self, camera: &Camera, step: u64, by: f64) -> Result<Vec<Shot>> {
        match self.windows()?.magnified(self, camera, step, by)? {
            Some(magnified) => Ok(magnified),
            None => self.training_shots(camera, step),
        }
    }

    /// The windows of every validation, in batches.
    pub fn validation_shots(&self, camera: &Camera) -> Result<Vec<Vec<Shot>>> {
        self.windows()?.validation(self, camera)
    }

    /// Those of the held-out windows that are chosen by their number.
    pub fn held_out_shots(&self, camera: &Camera, is_chosen: &dyn Fn(usize) -> bool) -> Result<Vec<HeldOut>> {
        self.windows()?.held_out(self, camera, is_chosen)
    }

    /// Held-out pictures, and places of the sensor at which each of them is scored.
    pub fn held_out_pictures(&self) -> Result<[usize; 2]> {
        Ok(self.windows()?.held_out_pictures(&self.experiment))
    }

    /// The exposure at the start, of which the settings that the experiment names may move.
    pub fn exposure(&self) -> ExposureBlock {
        let config = &self.experiment.exposure;
        let settings = [(ExposureSetting::Time, config.times_s), (ExposureSetting::Gain, config.gains)];
        let varied = settings.into_iter().filter(|(setting, _)| config.vary.contains(setting));
        ExposureBlock::new(config.exposure(), varied)
    }

    /// The parameters of the hardware ISP at the start, of which those that the experiment names may move.
    pub fn isp(&self) -> Result<IspBlock> {
        let Some(chip) = &self.body.chip else {
            return Ok(IspBlock::new(Vec::new(), Vec::new(), Vec::new()));
        };
        let isp = &self.experiment.isp;
        let parameters = chip.parameters();
        let named = isp.vary.iter().flat_map(|name| places_of(name, &parameters));
        let varied: BTreeSet<usize> = named.collect();
        let plan = ImitationPlan {
            isp: chip.isp().clone(),
            values: chip.values().to_vec(),
            scores: Arc::new(standard_scores(&self.lpips()?)),
            device: self.body.device.clone(),
            per_step: isp.proxy_steps,
            warm_up: isp.proxy_warm_up,
            in_all: isp.proxy_steps * (isp.proxy_warm_up + isp.steps),
            seed: self.experiment.seed,
        };
        let varied = varied.into_iter().collect();
        let block = IspBlock::new(parameters, chip.values().to_vec(), varied).with_imitation(plan);
        Ok(if chip.settings().is_some() { block } else { block.without_gradient() })
    }

    /// The blocks as a variant finds them before its first stage, at the numbers of its lens file and the start of its network.
    pub fn blocks(&self, variant: &Variant) -> Result<Blocks> {
        let weight = self.experiment.constraints.weight;
        let optics = OpticsBlock::new(self.start(variant).clone(), weight).with_field(variant.field);
        Ok(Blocks { optics, exposure: self.exposure(), isp: self.isp()?, network: self.network()? })
    }
}
