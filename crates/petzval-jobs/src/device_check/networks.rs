//! The convolutions that `doctor --device` tries: those of the networks and losses of every built-in experiment and of every detector, each at its
//! real size.

use std::collections::BTreeSet;
use std::time::Instant;

use petzval_design::convolutions::convolutions_of;
use petzval_design::experiment::{Experiment, STREET};
use petzval_design::setup::Setup;
use petzval_learn::convolution::Convolution;
use petzval_learn::device_check::{DETECTORS, of_detector, of_proxies};

use crate::context::Context;
use crate::device::device;
use crate::error::{JobError, Result};

/// Windows of streets that are made for a step: the convolutions do not depend on them.
const WINDOWS: usize = 8;

/// Items of a batch in the training of a network in place of an ISP or of ray tracing.
const PROXY_BATCH: usize = 8;

/// The experiment that comes first, and whose full size counts as well.
const MAIN: &str = crate::experiment::DEFAULT_EXPERIMENT;

/// What networks compute.
pub(super) struct Collected {
    pub(super) convolutions: BTreeSet<Convolution>,
    /// Networks for which there was no time.
    pub(super) left_out: Vec<String>,
}

/// Collects the convolutions from one training step of each experiment and from a forward pass of each detector and proxy, all on the CPU.
/// Experiments that differ in nothing that a network sees count once. Ends with the first one that is finished after `deadline`.
pub(super) fn all_convolutions(deadline: Instant, context: &Context) -> Result<Collected> {
    let experiments = experiments(context)?;
    let street = |(_, e): &&(String, Experiment)| e.data == STREET;
    let [batch, side] = experiments
        .iter()
        .filter(street)
        .fold([1, 32], |[batch, side], (_, e)| [batch.max(e.training.batch), side.max(e.training.crop)]);
    let total = experiments.len() + DETECTORS.len() + 1;
    let mut all = Collected { convolutions: BTreeSet::new(), left_out: Vec::new() };
    let mut done = 0;
    let mut next = |name: String, find: &dyn Fn() -> Result<BTreeSet<Convolution>>| {
        context.check(|| "stopped while the networks were looked at")?;
        if done > 0 && Instant::now() > deadline {
            all.left_out.push(name);
            return Ok(());
        }
        context.progress(done as u64, total as u64, format!("looking at {name}"));
        all.convolutions.extend(find()?);
        done += 1;
        Ok::<(), JobError>(())
    };
    for (name, experiment) in &experiments {
        next(name.clone(), &|| {
            let setup = Setup::new(experiment.clone(), &context.assets, device("cpu")?)?;
            Ok(convolutions_of(&setup)?)
        })?;
    }
    next("the proxies of ISP and optics".to_owned(), &|| {
        of_proxies(PROXY_BATCH).map_err(|e| JobError::failed(e.to_string()))
    })?;
    for (kind, backbone) in DETECTORS {
        let name = format!("{kind:?} on {backbone:?}");
        let failed = |e| JobError::failed(format!("{name}: {e}"));
        next(name.clone(), &|| of_detector((kind, backbone), batch, side).map_err(failed))?;
    }
    Ok(all)
}

/// The built-in experiments whose networks differ, [`MAIN`] first, and its full size.
fn experiments(context: &Context) -> Result<Vec<(String, Experiment)>> {
    let assets = &context.assets;
    let mut all: Vec<(String, Experiment)> = Vec::new();
    let others = assets.names("experiments").into_iter().filter(|name| *name != MAIN);
    for name in std::iter::once(MAIN).chain(others) {
        let mut experiment = assets.experiment(name)?;
        experiment.street.windows = WINDOWS;
        let sees = what_networks_see(&experiment);
        if all.iter().all(|(_, other)| what_networks_see(other) != sees) {
            all.push((name.to_owned(), experiment));
        }
    }
    let mut full = assets.experiment(MAIN)?;
    full.to_full_size(assets.facts_of(&full)?.network);
    all.push((format!("{MAIN} in full size"), full));
    Ok(all)
}

/// All of an experiment on which the shapes of its networks and losses depend.
fn what_networks_see(experiment: &Experiment) -> String {
    let Experiment { task, network, detector, loss, data, training, .. } = experiment;
    let (batch, crop) = (training.batch, training.crop);
    format!("{task} {network:?} {detector:?} {loss:?} {data} {batch} {crop}")
}
