//! Which convolutions the steps of an experiment compute: those of its networks and losses, at the sizes of its windows.

use std::collections::BTreeSet;

use burn::prelude::*;
use petzval_learn::convolution::{Convolution, collect};
use petzval_learn::network::IspProxyConfig;

use crate::block::Sight;
use crate::camera::isp_proxy::PAIRS;
use crate::design_loop::{StepOf, step_of};
use crate::error::Result;
use crate::experiment::{BlockName, Schedule, Stage, StepMethod, Variant};
use crate::setup::Setup;

/// The convolutions of a training step of the experiment, collected from the step itself: one step of the network, or of the first block with a
/// gradient where no network moves. It is taken on the device of the setup and changes nothing. All windows of the batch are taken together, also
/// on the CPU, so that the shapes are those of a GPU.
///
/// None if no block moves by a gradient.
pub fn convolutions_of(setup: &Setup) -> Result<BTreeSet<Convolution>> {
    let schedules =
        || setup.variants.iter().flat_map(|variant| schedules_of(variant).map(move |s| (variant, s)));
    let by_gradient = |s: &Schedule| matches!(s.method, StepMethod::Gradient | StepMethod::Levenberg);
    let learns = |(_, (block, schedule)): &(&Variant, (BlockName, Schedule))| {
        *block != BlockName::Exposure && by_gradient(schedule)
    };
    let network = schedules().find(|s| s.1.0 == BlockName::Network && learns(s));
    let mut all = BTreeSet::new();
    if let Some((variant, (block, schedule))) = network.or_else(|| schedules().find(learns)) {
        let (taken, seen) = collect(|| one_step(setup, variant, block, schedule));
        taken?;
        all = seen;
    }

    // A network that imitates the hardware ISP sees the windows as raw frames.
    if schedules().any(|(_, (_, schedule))| schedule.method == StepMethod::Proxy) {
        let config = IspProxyConfig::default();
        let (device, training) = (&setup.body.device, &setup.experiment.training);
        let proxy = config.init(1, device)?;
        let side = training.crop.div_ceil(2);
        // It leads a step on the batch itself, and learns on two points of several pairs for each frame.
        for batch in [training.batch, 2 * PAIRS * training.batch] {
            let raw = Tensor::zeros([batch, 4, side, side], device);
            let theta = Tensor::zeros([batch, config.parameters], device);
            all.extend(collect(|| proxy.forward(raw, theta)).1);
        }
    }
    Ok(all)
}

fn schedules_of(variant: &Variant) -> impl Iterator<Item = (BlockName, Schedule)> {
    let moves = variant.stages.iter().filter_map(|stage| match stage {
        Stage::Task(moves) => Some(moves),
        Stage::Lens { .. } => None,
    });
    moves.flatten().map(|(block, schedule)| (*block, *schedule))
}

/// The first step of a block in a variant, with everything else at its start.
fn one_step(setup: &Setup, variant: &Variant, block: BlockName, schedule: Schedule) -> Result<()> {
    let (mut blocks, objective) = (setup.blocks(variant)?, setup.objective()?);
    blocks.network.set_sight(Sight { sees: variant.sees, zoom: 1.0 });
    let camera = blocks.held(&setup.moving_camera(variant, blocks.optics.lens()?)?);
    let rule = schedule.rule(0);
    let objective = &*objective;
    let step = StepOf { setup, variant, objective, block, rule, number: 0, next: None, is_whole: true };
    step_of(&step, &camera, &mut blocks).map(drop)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::experiment::Experiment;
    use crate::library::Library;

    /// The convolutions of a step on three small windows.
    fn of_task(task: &str, more: &str) -> BTreeSet<Convolution> {
        let text = format!(
            "name = \"small\"\ntask = \"{task}\"\n[psf]\nfields = 3\ngrid = 64\npatches = [2, 2]\npupil_cells = 16\n\
             [network]\nbase_channels = 8\nlevels = 2\nweights = \"none\"\n[training]\nsteps = 4\nbatch = 3\n{more}\
             [[variant]]\nname = \"end-to-end\"\n[[variant.stage]]\nmoves = [\"optics\", \"network\"]\n"
        );
        let assets =
            Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data"))
                .unwrap();
        let experiment = Experiment::parse(&text).unwrap();
        let setup = Setup::new(experiment, &assets, Device::flex().autodiff()).unwrap();
        convolutions_of(&setup).unwrap()
    }

    #[test]
    fn a_step_has_the_shapes_of_its_whole_batch() {
        // No other test of this program has windows of these sides, so that none adds to their convolutions.
        let streets = "crop = 160\n[street]\nwindows = 3\nheld_out = 1\nsamples = 1\n";
        for (task, more, side) in [("image-quality", "crop = 72\n", 72), ("pedestrian-vehicle", streets, 160)]
        {
            let all = of_task(task, more);
            let batches: BTreeSet<usize> =
                all.iter().filter(|c| c.input[2..] == [side, side]).map(|c| c.input[0]).collect();
            // Losses on pairs of pictures have a multiple of the batch.
            assert!(batches.contains(&3) && batches.iter().all(|batch| batch % 3 == 0), "{task}: {all:?}");
        }
    }
}
