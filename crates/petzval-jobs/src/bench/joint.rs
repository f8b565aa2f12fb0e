//! Workloads of joint optimisation: steps of networks, of the hardware ISP and of lenses in the built-in experiments.

use petzval_base::simd::widest;
use petzval_design::design_loop::DesignLoop;
use petzval_design::error::DesignError;
use petzval_design::experiment::BlockName;
use petzval_design::parts::Part;
use petzval_design::run::RunFolder;
use petzval_design::setup::Setup;

use super::workload::{Prepared, Workload};
use crate::built_in::built_in_assets;
use crate::design::scorer;
use crate::device::device;
use crate::error::JobError;

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
fn part(part: Part, what: &str) -> Result<Prepared, JobError> {
    let assets = built_in_assets();
    let experiment = assets.experiment(PICTURES)?;
    let training = experiment.training.clone();
    let inputs = design_loop(Setup::new(experiment, &assets, device("cpu")?)?)?.part_inputs()?;
    Ok(Prepared {
        work: format!("{what}; batch {} of {}^2: a part of joint_step", training.batch, training.crop),
        units: None,
        single_thread: false,
        run: Box::new(move || Ok(inputs.iter().try_for_each(|inputs| inputs.run(part))?)),
    })
}

/// Steps of a block of a built-in experiment.
fn step(experiment: &str, kind: BlockName, what: &str) -> Result<Prepared, JobError> {
    let assets = built_in_assets();
    let has_network = experiment == PICTURES;
    let mut experiment = assets.experiment(experiment)?;
    experiment.street.windows = WINDOWS;
    let training = experiment.training.clone();
    let network = &experiment.network;
    let size = if has_network {
        format!(", {} channels, {} levels", network.base_channels, network.levels)
    } else {
        String::new()
    };
    let setup = Setup::new(experiment, &assets, device("cpu")?)?;
    let mut design = design_loop(setup)?;
    Ok(Prepared {
        work: format!("{what}; batch {} of {}^2{size}", training.batch, training.crop),
        units: None,
        single_thread: false,
        run: Box::new(move || {
            design.one_step(kind)?;
            Ok(())
        }),
    })
}

/// A run whose single steps write nothing.
fn design_loop(setup: Setup) -> Result<DesignLoop, JobError> {
    let scratch = std::env::temp_dir().join(format!("petzval-bench-{}", std::process::id()));
    let design = DesignLoop::new(RunFolder::create(&scratch)?, scorer(setup)?)?;
    std::fs::remove_dir_all(&scratch).map_err(DesignError::io(&scratch))?;
    Ok(design)
}
