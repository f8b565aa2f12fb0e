//! Workloads of joint optimisation: steps of networks, of the hardware ISP and of lenses in the built-in experiments.

use petzval_base::simd::widest;
use petzval_design::block::{Blocks, Sight};
use petzval_design::camera::Camera;
use petzval_design::design_loop::{StepOf, step_of};
use petzval_design::error::DesignError;
use petzval_design::experiment::{BlockName, Schedule, Stage, StepMethod, Variant};
use petzval_design::parts::{Part, PartInputs};
use petzval_design::setup::Setup;
use petzval_design::task::Objective;

use super::workload::{Prepared, Workload};
use crate::built_in::built_in_assets;
use crate::device::device;
use crate::error::{JobError, Result};

const PICTURES: &str = "cooke-triplet-image-quality";
const HARDWARE_ISP: &str = "cooke-triplet-image-quality-hardware-isp";
const OBJECTS: &str = "pedestrian-vehicle";

/// Windows of streets from which the steps of a detector draw: after a few steps all of them are made.
const WINDOWS: usize = 8;

pub(super) fn workloads() -> Vec<Workload> {
    let workload = |name, prepare| Workload { name, simd: widest, prepare };
    vec![
        workload("network_step", || {
            step(
                PICTURES,
                BlockName::Network,
                "render, expose, develop, restore, network forward and back, LPIPS, optimiser",
            )
        }),
        workload("isp_step", || {
            let what = "render, expose, automotive ISP in floating point forward and back, LPIPS, optimiser";
            step(HARDWARE_ISP, BlockName::Isp, what)
        }),
        workload("joint_step", || {
            let what = "13 x 3 PSFs, the same chain held, back to every number of the lens, optimiser";
            step(PICTURES, BlockName::Optics, what)
        }),
        workload("joint_render", || {
            part(Part::Render, "kernels of the patches, scenes through them, back to the PSFs")
        }),
        workload("joint_sensor", || part(Part::Sensor, "light to digital numbers with noise, and back")),
        workload("joint_development", || {
            part(
                Part::Development,
                "mosaic to linear light, blur divided out, back to the mosaic and the PSFs",
            )
        }),
        workload("joint_network", || {
            part(Part::Network, "restoration network, held, and back to the pictures")
        }),
        workload("joint_loss", || part(Part::Loss, "L1 and LPIPS, back to the finished pictures")),
        workload("detector_step", || {
            let what =
                "render, expose, automotive ISP in whole numbers, Faster R-CNN forward and back, optimiser";
            step(OBJECTS, BlockName::Network, what)
        }),
        workload("detector_lens_step", || {
            let what = "streets anew through the chief rays of the lens, 13 x 3 PSFs, sensor, ISP and Faster R-CNN held, back to the lens, optimiser";
            step(OBJECTS, BlockName::Optics, what)
        }),
    ]
}

/// A part of `joint_step`.
fn part(part: Part, what: &str) -> Result<Prepared> {
    let mut steps = Steps::new(PICTURES, BlockName::Optics)?;
    let Steps { setup, variant, .. } = &steps;
    let training = &setup.experiment.training;
    let work = format!("{what}; batch {} of {}^2: a part of joint_step", training.batch, training.crop);
    let (objective, noise) = (setup.objective()?, setup.noise(variant));
    let camera = steps.camera()?;
    let shots = steps.setup.training_shots(&camera, 0)?;
    let inputs = PartInputs::new(objective, camera, shots, noise)?;
    Ok(Prepared::new(work, move || Ok(inputs.run(part)?)))
}

/// Steps of a block of a built-in experiment.
fn step(experiment: &str, block: BlockName, what: &str) -> Result<Prepared> {
    let mut steps = Steps::new(experiment, block)?;
    let (training, network) = (&steps.setup.experiment.training, &steps.setup.experiment.network);
    let size = if experiment == PICTURES {
        format!(", {} channels, {} levels", network.base_channels, network.levels)
    } else {
        String::new()
    };
    let work = format!("{what}; batch {} of {}^2{size}", training.batch, training.crop);
    Ok(Prepared::new(work, move || Ok(steps.step()?)))
}

/// Steps of a block, as the first variant takes them in which it and others move by their gradients.
struct Steps {
    setup: Setup,
    variant: Variant,
    schedule: Schedule,
    block: BlockName,
    blocks: Blocks,
    objective: Box<dyn Objective>,
    /// Made anew only when the lens has moved.
    camera: Option<Camera>,
    taken: usize,
}

impl Steps {
    fn new(experiment: &str, block: BlockName) -> Result<Self> {
        let assets = built_in_assets();
        let mut experiment = assets.experiment(experiment)?;
        experiment.street.windows = WINDOWS;
        let setup = Setup::new(experiment, &assets, device("cpu")?)?;
        let by_gradient = |s: &Schedule| matches!(s.method, StepMethod::Gradient | StepMethod::Levenberg);
        let schedule_of = |stage: &Stage| match stage {
            Stage::Task(moves) if moves.len() > 1 && moves.values().all(by_gradient) => {
                moves.get(&block).copied()
            }
            _ => None,
        };
        let mut found = setup
            .variants
            .iter()
            .filter_map(|variant| Some((variant.clone(), variant.stages.iter().find_map(schedule_of)?)));
        let (variant, schedule) =
            found.next().ok_or_else(|| JobError::failed("no stage of the experiment moves the block"))?;
        drop(found);
        let (mut blocks, objective) = (setup.blocks(&variant)?, setup.objective()?);
        blocks.network.set_sight(Sight { sees: variant.sees, zoom: 1.0 });
        Ok(Self { setup, variant, schedule, block, blocks, objective, camera: None, taken: 0 })
    }

    fn camera(&mut self) -> Result<Camera, DesignError> {
        let camera = match self.camera.take() {
            Some(camera) => camera,
            None => self.setup.moving_camera(&self.variant, self.blocks.optics.lens()?)?,
        };
        self.camera = Some(camera.clone());
        Ok(self.blocks.held(&camera))
    }

    fn step(&mut self) -> Result<(), DesignError> {
        let camera = self.camera()?;
        let next = (!self.block.moves_psfs()).then_some(self.taken as u64 + 1);
        let at = StepOf {
            setup: &self.setup,
            variant: &self.variant,
            objective: &*self.objective,
            block: self.block,
            rule: self.schedule.rule(self.taken),
            number: self.taken as u64,
            next,
            is_whole: false,
        };
        step_of(&at, &camera, &mut self.blocks)?;
        self.taken += 1;
        self.camera = self.camera.take().filter(|_| !self.block.moves_psfs());
        Ok(())
    }
}
