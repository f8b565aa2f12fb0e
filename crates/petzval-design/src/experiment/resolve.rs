//! Variants as the loop goes through them, from those of the file.

use super::{Experiment, Goal, ScheduleConfig, StageConfig, VariantConfig};
use crate::block::BlockName;
use crate::variant::{Schedule, Stage, Variant};

impl Experiment {
    /// The variants in the order of the file, with the experiment's own values for all that they leave out.
    pub fn variants(&self) -> Vec<Variant> {
        let resolve = |v: &VariantConfig| Variant {
            name: v.name.clone(),
            lens: v.lens.clone().unwrap_or_else(|| self.lens.clone()),
            from: v.from.clone(),
            stages: v.stage.iter().map(|s| stage(self, s)).collect(),
        };
        self.variant.iter().map(resolve).collect()
    }
}

fn stage(experiment: &Experiment, config: &StageConfig) -> Stage {
    if config.goal == Goal::Spot {
        return Stage::Spot { iterations: experiment.spot.iterations };
    }
    let (t, o) = (&experiment.training, &experiment.optics);
    let default = |block: BlockName| match block {
        BlockName::Optics => Schedule {
            steps: o.steps,
            learning_rate: o.learning_rate,
            final_learning_rate: o.final_learning_rate,
            share: o.moving_share,
            proximal: o.proximal,
        },
        BlockName::Network => Schedule {
            steps: t.steps,
            learning_rate: t.learning_rate,
            final_learning_rate: t.final_learning_rate,
            share: 1.0,
            proximal: t.proximal,
        },
    };
    let own = |block: BlockName| match block {
        BlockName::Optics => config.optics,
        BlockName::Network => config.network,
    };
    let moves = config.moves.iter().map(|block| {
        let (all, own): (Schedule, ScheduleConfig) = (default(*block), own(*block).unwrap_or_default());
        let schedule = Schedule {
            steps: own.steps.unwrap_or(all.steps),
            learning_rate: own.learning_rate.unwrap_or(all.learning_rate),
            final_learning_rate: own.final_learning_rate.unwrap_or(all.final_learning_rate),
            share: own.share.unwrap_or(all.share),
            proximal: own.proximal.unwrap_or(all.proximal),
        };
        (*block, schedule)
    });
    Stage::Task(moves.collect())
}
