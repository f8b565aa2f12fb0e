//! The variants of an experiment: what each camera starts from, which blocks move, and in what stages.
//!
//! [`Experiment::variants`](crate::experiment::Experiment::variants) makes them from the experiment file.

use std::collections::BTreeMap;

use petzval_camera::sensor::NoiseMode;
use petzval_optics::psf::PerfectImage;

use super::names::{BlockName, DetectorInput, FieldOfView, LensGoal, StepMethod};

/// A camera of the comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// Its name in tables and folders.
    pub name: String,
    /// Name of the lens from which it starts.
    pub lens: String,
    /// The variant whose finished lens, ISP and network it starts from.
    pub from: Option<String>,
    /// Whether it starts from that variant's lens as well, and not from one of its own.
    pub keeps_lens: bool,
    /// The description of the network from which its PSFs come while its lens moves for the task.
    pub optics_proxy: Option<String>,
    /// How noise is sampled while it is made.
    pub noise: NoiseMode,
    /// Whether its lens keeps its field of view while it moves for the task.
    pub field: FieldOfView,
    /// The variant whose magnification its detector sees by a digital zoom.
    pub zoomed_like: Option<String>,
    /// What its detector sees.
    pub sees: DetectorInput,
    /// What its lens makes of a point, if it has no aberrations.
    pub perfect_image: PerfectImage,
    /// Whether a variant of the chain from which it starts moves the lens.
    pub starts_moved: bool,
    /// What is done with it, in this order.
    pub stages: Vec<Stage>,
}

/// What a stage does.
#[derive(Clone, Debug, PartialEq)]
pub enum Stage {
    /// Moves the lens alone, for a goal that needs no pictures, by Levenberg and Marquardt's method. It counts as one step of the lens.
    Lens {
        /// What becomes small.
        goal: LensGoal,
        /// Iterations at most.
        iterations: usize,
        /// The global search before the descent.
        search: LensSearch,
    },
    /// Moves blocks, each with its schedule, for the objective of the experiment.
    Task(BTreeMap<BlockName, Schedule>),
}

/// A global search for a lens within its bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LensSearch {
    /// Rounds; 0 for none.
    pub rounds: usize,
    /// Seed of its random lenses.
    pub seed: u64,
}

/// How a block steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepRule {
    /// The method.
    pub method: StepMethod,
    /// Learning rate of this step; CMA-ES has none, and for random draws it is their reach.
    pub rate: f64,
    /// Weight mu of the proximal term `mu / 2 |theta - theta_0|^2`, where theta_0 are the free numbers at the start of the stage.
    pub proximal: f64,
}

/// How many steps a block takes in a stage, and how long they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// Steps.
    pub steps: usize,
    /// First learning rate of Adam; it falls along a half cosine.
    pub learning_rate: f64,
    /// Learning rate at the end over that at the start.
    pub final_learning_rate: f64,
    /// Share of the stage's network steps over which the steps of this block are spread.
    pub share: f64,
    /// Weight of the proximal term.
    pub proximal: f64,
    /// How steps are found.
    pub method: StepMethod,
    /// Standard deviation of the random errors of the lens in each of its steps, as a share of the range of each of its numbers.
    pub error_share: f64,
}

impl Schedule {
    /// How the block takes a step, counted from 0.
    pub fn rule(&self, step: usize) -> StepRule {
        let rate = cosine_rate(self.learning_rate, self.final_learning_rate, step, self.steps);
        StepRule { method: self.method, rate, proximal: self.proximal }
    }
}

/// A learning rate that falls along a half cosine from `first` to `first * last_share`.
pub fn cosine_rate(first: f64, last_share: f64, step: usize, steps: usize) -> f64 {
    let t = if steps > 1 { step as f64 / (steps - 1) as f64 } else { 0.0 };
    let share = last_share + (1.0 - last_share) * 0.5 * (1.0 + (std::f64::consts::PI * t.min(1.0)).cos());
    first * share
}

impl Stage {
    /// Steps of all blocks together.
    pub fn steps(&self) -> usize {
        BlockName::ALL.into_iter().map(|block| self.steps_of(block)).sum()
    }

    /// Steps of a block; 0 for one that does not move.
    pub fn steps_of(&self, block: BlockName) -> usize {
        match self {
            Self::Lens { .. } => usize::from(block == BlockName::Optics),
            Self::Task(moves) => moves.get(&block).map_or(0, |s| s.steps),
        }
    }

    /// Steps of a block for the objective of the experiment.
    pub fn task_steps_of(&self, block: BlockName) -> usize {
        if let Self::Task(_) = self { self.steps_of(block) } else { 0 }
    }

    /// Whether a block moves for the objective of the experiment down a gradient.
    pub fn steps_down_a_gradient(&self, block: BlockName) -> bool {
        let Self::Task(moves) = self else { return false };
        moves
            .get(&block)
            .is_some_and(|s| s.steps > 0 && !matches!(s.method, StepMethod::Random | StepMethod::Evolution))
    }

    /// Whether a block moves for the objective of the experiment, other than at random.
    pub fn improves(&self, block: BlockName) -> bool {
        let Self::Task(moves) = self else { return false };
        moves.get(&block).is_some_and(|s| s.steps > 0 && s.method != StepMethod::Random)
    }

    /// The block whose turn it is once blocks have taken these steps; `None` at the end of the stage.
    pub fn turn(&self, taken: &BTreeMap<BlockName, usize>) -> Option<BlockName> {
        let Self::Task(moves) = self else {
            return (!taken.contains_key(&BlockName::Optics)).then_some(BlockName::Optics);
        };
        turn_of(moves, taken)
    }
}

/// The block whose turn it is among blocks that move for the task; `None` when all have taken their steps.
///
/// The last moving block in the order of the light, usually the network, takes the steps that count. Those of another block
/// are spread evenly over the first `share` of them.
pub fn turn_of(
    moves: &BTreeMap<BlockName, Schedule>,
    taken: &BTreeMap<BlockName, usize>,
) -> Option<BlockName> {
    let taken = |block: BlockName| taken.get(&block).copied().unwrap_or(0);
    let (clock, Schedule { steps, .. }) = moves.last_key_value()?;
    for (block, schedule) in moves {
        if block == clock || taken(*block) >= schedule.steps {
            continue;
        }
        let span = (schedule.share * *steps as f64).max(1.0);
        let passed = (taken(*clock) + 1) as f64 / span;
        let due = (passed * schedule.steps as f64) as usize;
        if taken(*block) < due || taken(*clock) == *steps {
            return Some(*block);
        }
    }
    (taken(*clock) < *steps).then_some(*clock)
}

impl Variant {
    /// Steps of a block in all stages.
    pub fn steps_of(&self, block: BlockName) -> usize {
        self.stages.iter().map(|s| s.steps_of(block)).sum()
    }

    /// Steps of a block in all stages, for the objective of the experiment.
    pub fn task_steps_of(&self, block: BlockName) -> usize {
        self.stages.iter().map(|s| s.task_steps_of(block)).sum()
    }

    /// Whether its finished lens may differ from its lens file.
    pub fn moves_lens(&self) -> bool {
        self.steps_of(BlockName::Optics) > 0 || self.starts_moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(optics: usize, network: usize, share: f64) -> Stage {
        let schedule = |steps| Schedule {
            steps,
            learning_rate: 0.1,
            final_learning_rate: 0.1,
            share,
            proximal: 0.0,
            method: StepMethod::Gradient,
            error_share: 0.0,
        };
        let moves = [(BlockName::Optics, schedule(optics)), (BlockName::Network, schedule(network))];
        Stage::Task(moves.into_iter().filter(|(_, s)| s.steps > 0).collect())
    }

    fn turns(stage: &Stage) -> String {
        let (mut taken, mut all) = (BTreeMap::new(), String::new());
        while let Some(block) = stage.turn(&taken) {
            *taken.entry(block).or_default() += 1;
            all.push(if block == BlockName::Optics { 'o' } else { 'n' });
        }
        all
    }

    #[test]
    fn lens_steps_are_spread_over_the_first_part_of_the_networks_steps() {
        assert_eq!(turns(&stage(2, 8, 0.5)), "nonnonnnnn");
        assert_eq!(turns(&stage(4, 2, 1.0)), "oonoon");
        assert_eq!(turns(&stage(3, 0, 1.0)), "ooo");
        assert_eq!(turns(&stage(0, 3, 1.0)), "nnn");
        assert_eq!(
            turns(&Stage::Lens { goal: LensGoal::Spot, iterations: 200, search: LensSearch::default() }),
            "o"
        );
    }

    #[test]
    fn the_rate_falls_from_first_to_last() {
        assert_eq!(cosine_rate(2.0, 0.1, 0, 100), 2.0);
        assert!((cosine_rate(2.0, 0.1, 99, 100) - 0.2).abs() < 1e-12);
        assert_eq!(cosine_rate(2.0, 0.1, 0, 1), 2.0);
    }
}
