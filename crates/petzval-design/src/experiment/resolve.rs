//! Variants as the loop goes through them, from those of the file.

use petzval_optics::psf::PerfectImage;

use super::{Experiment, ScheduleConfig, StageConfig, VariantConfig};
use crate::experiment::{BlockName, LensGoal, LensSearch, Schedule, Stage, StepMethod, Variant};

impl Experiment {
    /// The variants in the order of the file, with the experiment's own values for all that they leave out.
    pub fn variants(&self) -> Vec<Variant> {
        let resolve = |v: &VariantConfig| Variant {
            name: v.name.clone(),
            lens: self.lens_of(v).unwrap_or_else(|| self.lens.clone()),
            keeps_lens: v.lens.is_none(),
            from: v.from.clone(),
            optics_proxy: v.optics_proxy.clone(),
            noise: v.noise.unwrap_or(self.training.noise),
            field: v.field,
            zoomed_like: v.zoomed_like.clone(),
            sees: v.sees,
            perfect_image: self.perfect_image_of(v),
            starts_moved: v.lens.is_none() && self.parent(v).is_some_and(|parent| self.moves_lens(parent)),
            stages: v.stage.iter().map(|s| stage(self, s)).collect(),
        };
        self.variant.iter().map(resolve).collect()
    }

    /// The lens that a variant names, or the nearest one in the chain of `from`.
    fn lens_of(&self, variant: &VariantConfig) -> Option<String> {
        variant.lens.clone().or_else(|| self.parent(variant).and_then(|parent| self.lens_of(parent)))
    }

    /// The image of a perfect lens of the variant that names the lens of this one.
    fn perfect_image_of(&self, variant: &VariantConfig) -> PerfectImage {
        let parent = self.parent(variant).filter(|_| variant.lens.is_none());
        let named = variant.perfect_image;
        named.unwrap_or_else(|| match parent {
            Some(parent) => self.perfect_image_of(parent),
            None => PerfectImage::of(self.psf.kind.traced()),
        })
    }

    /// The variant from which another starts: one earlier in the file, so that every chain ends.
    fn parent(&self, variant: &VariantConfig) -> Option<&VariantConfig> {
        let place = self.variant.iter().position(|v| v.name == variant.name)?;
        self.variant[..place].iter().find(|v| Some(&v.name) == variant.from.as_ref())
    }

    /// Whether a variant, or one of the chain from which it starts, moves the lens.
    fn moves_lens(&self, variant: &VariantConfig) -> bool {
        variant.stage.iter().any(|s| stage(self, s).steps_of(BlockName::Optics) > 0)
            || variant.lens.is_none() && self.parent(variant).is_some_and(|parent| self.moves_lens(parent))
    }
}

fn stage(experiment: &Experiment, config: &StageConfig) -> Stage {
    if let Some(goal) = config.goal.of_lens() {
        // The error after restoration takes too long for a search: it starts from what the spots have found.
        let rounds = if goal == LensGoal::Spot { experiment.spot.rounds } else { 0 };
        let search = LensSearch { rounds, seed: experiment.seed };
        return Stage::Lens { goal, iterations: experiment.spot.iterations, search };
    }
    let (t, o, i) = (&experiment.training, &experiment.optics, &experiment.isp);
    let e = &experiment.exposure;
    let default = |block: BlockName| match block {
        BlockName::Optics => Schedule {
            steps: o.steps,
            learning_rate: o.learning_rate,
            final_learning_rate: o.final_learning_rate,
            share: o.moving_share,
            proximal: o.proximal,
            method: StepMethod::Gradient,
            error_share: o.error_share,
        },
        BlockName::Exposure => Schedule {
            steps: e.steps,
            learning_rate: e.learning_rate,
            final_learning_rate: e.final_learning_rate,
            share: 1.0,
            proximal: e.proximal,
            method: StepMethod::Gradient,
            error_share: 0.0,
        },
        BlockName::Isp => Schedule {
            steps: i.steps,
            learning_rate: i.learning_rate,
            final_learning_rate: i.final_learning_rate,
            share: 1.0,
            proximal: i.proximal,
            method: StepMethod::Gradient,
            error_share: 0.0,
        },
        BlockName::Network => Schedule {
            steps: t.steps,
            learning_rate: t.learning_rate,
            final_learning_rate: t.final_learning_rate,
            share: 1.0,
            proximal: t.proximal,
            method: StepMethod::Gradient,
            error_share: 0.0,
        },
    };
    let moves = config.moves.iter().map(|block| {
        let (all, own): (Schedule, ScheduleConfig) =
            (default(*block), config.schedule.get(block).copied().unwrap_or_default());
        // Draws go on as long as the stage, and as far.
        let is_random = own.method == Some(StepMethod::Random);
        let all = if is_random {
            Schedule { share: 1.0, final_learning_rate: 1.0, error_share: 0.0, proximal: 0.0, ..all }
        } else {
            all
        };
        let schedule = Schedule {
            steps: own.steps.unwrap_or(all.steps),
            learning_rate: own.learning_rate.unwrap_or(all.learning_rate),
            final_learning_rate: own.final_learning_rate.unwrap_or(all.final_learning_rate),
            share: own.share.unwrap_or(all.share),
            proximal: own.proximal.unwrap_or(all.proximal),
            method: own.method.unwrap_or(all.method),
            error_share: own.error_share.unwrap_or(all.error_share),
        };
        (*block, schedule)
    });
    Stage::Task(moves.collect())
}
