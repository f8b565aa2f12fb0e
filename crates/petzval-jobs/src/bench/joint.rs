//! Workloads of joint optimisation: a network step and a lens step of the built-in experiment.

use petzval_base::simd::widest;
use petzval_design::block::BlockName;
use petzval_design::design_loop::DesignLoop;
use petzval_design::error::DesignError;
use petzval_design::run::RunFolder;
use petzval_design::setup::Setup;

use super::workload::{Prepared, Workload};
use crate::built_in::built_in_assets;
use crate::design::scorer;
use crate::device::device;
use crate::error::JobError;

pub(super) fn workloads() -> Vec<Workload> {
    vec![
        Workload { name: "unet_step", simd: widest, prepare: || step(BlockName::Network) },
        Workload { name: "isp_step", simd: widest, prepare: || step(BlockName::Isp) },
        Workload { name: "joint_step", simd: widest, prepare: || step(BlockName::Optics) },
    ]
}

fn step(kind: BlockName) -> Result<Prepared, JobError> {
    let assets = built_in_assets();
    let experiment = assets.experiment(match kind {
        BlockName::Isp => "cooke-triplet-image-quality-hardware-isp",
        BlockName::Optics | BlockName::Network => "cooke-triplet-image-quality",
    })?;
    let training = experiment.training.clone();
    let network = experiment.network.clone();
    let setup = Setup::new(experiment, &assets, device("cpu")?)?;
    let scratch = std::env::temp_dir().join(format!("petzval-bench-{}", std::process::id()));
    let mut design = DesignLoop::new(RunFolder::create(&scratch)?, scorer(setup)?)?;
    // Single steps write nothing.
    std::fs::remove_dir_all(&scratch).map_err(DesignError::io(&scratch))?;
    let what = match kind {
        BlockName::Network => "render, expose, develop, U-Net forward and back, LPIPS, Adam",
        BlockName::Isp => "render, expose, automotive ISP in floating point forward and back, LPIPS, Adam",
        BlockName::Optics => "13 x 3 PSFs, the same chain held, back to every number of the lens, Adam",
    };
    let size = match kind {
        BlockName::Isp => String::new(),
        _ => format!(", {} channels, {} levels", network.base_channels, network.levels),
    };
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
