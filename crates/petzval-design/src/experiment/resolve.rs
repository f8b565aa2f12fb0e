//! Variants as the loop goes through them, from those of the file.

use super::{Experiment, Goal, ScheduleConfig, StageConfig, VariantConfig};
use crate::block::BlockName;
use crate::variant::{Schedule, Stage, Variant};

impl Experiment {
    /// The variants in the order of the file, with the experiment's own values for all that they leave out.
    pub fn variants(&self) -> Vec<Variant> {
        let resolve = |v: &VariantConfig| Variant {
            name: v.name.clone(),
            lens: self.origin(v).lens.clone().unwrap_or_else(|| self.lens.clone()),
            from: v.from.clone(),
            stages: v.stage.iter().map(|s| stage(self, s)).collect(),
        };
        self.variant.iter().map(resolve).collect()
    }

    /// The variant at the beginning of the chain of `from`, whose lens all variants of the chain have.
    fn origin<'v>(&'v self, variant: &'v VariantConfig) -> &'v VariantConfig {
        let parent = variant.from.as_ref().and_then(|from| self.variant.iter().find(|v| v.name == *from));
        // A variant starts from an earlier one, so the chain ends.
        parent.map_or(variant, |parent| self.origin(parent))
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
    let moves = config.moves.iter().map(|block| {
        let (all, own): (Schedule, ScheduleConfig) =
            (default(*block), config.schedule.get(block).copied().unwrap_or_default());
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
