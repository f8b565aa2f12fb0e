//! Workloads of joint optimisation: a network step and a lens step of the built-in experiment.

use std::sync::Arc;

use petzval::base::simd::widest;
use petzval::built_in_assets;
use petzval::design::block::BlockName;
use petzval::design::design_loop::DesignLoop;
use petzval::design::error::DesignError;
use petzval::design::run::RunFolder;
use petzval::design::scoring::Scorer;
use petzval::design::setup::Setup;
use petzval::jobs::{Context, Silent};
use petzval::learn::score::standard_scores;

use super::workload::{Prepared, Workload};
use crate::cli::failure::Failure;

pub(super) fn workloads() -> Vec<Workload> {
    vec![
        Workload { name: "unet_step", simd: widest, prepare: || step(BlockName::Network) },
        Workload { name: "joint_step", simd: widest, prepare: || step(BlockName::Optics) },
    ]
}

fn step(kind: BlockName) -> Result<Prepared, Failure> {
    let assets = built_in_assets();
    let experiment = assets.experiment("cooke-triplet-image-quality")?;
    let training = experiment.training.clone();
    let network = experiment.network.clone();
    // The loop exists as long as the process, so its settings and its scratch folder are leaked on purpose.
    let setup: &'static Setup = Box::leak(Box::new(Setup::new(
        experiment,
        &assets,
        Context::new(assets.clone(), Arc::new(Silent)).device("cpu")?,
    )?));
    let scratch = std::env::temp_dir().join(format!("petzval-bench-{}", std::process::id()));
    let folder: &'static RunFolder = Box::leak(Box::new(RunFolder::create(&scratch)?));
    let mut design = DesignLoop::new(setup, folder, Scorer::new(setup, standard_scores(&setup.lpips()?))?)?;
    // Single steps write nothing.
    std::fs::remove_dir_all(&scratch).map_err(DesignError::io(&scratch))?;
    let what = match kind {
        BlockName::Network => "render, expose, develop, U-Net forward and back, LPIPS, Adam",
        BlockName::Optics => "13 x 3 PSFs, the same chain held, back to every number of the lens, Adam",
    };
    Ok(Prepared {
        work: format!(
            "{what}; batch {} of {}^2, {} channels, {} levels",
            training.batch, training.crop, network.base_channels, network.levels
        ),
        units: None,
        single_thread: false,
        run: Box::new(move || {
            design.one_step(kind)?;
            Ok(())
        }),
    })
}
