//! A part of the lenses that are made at random, by number.

use petzval_base::Cancelled;
use petzval_optics::tolerance::{MonteCarlo, Study, trial};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Lenses of these numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// The first, from 0.
    pub from: usize,
    /// The one behind the last, at most `trials`.
    pub to: usize,
}

/// Lenses of a part, with all that an analysis needs of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MadeLenses {
    /// Their numbers.
    pub part: Part,
    /// Merit of each; none without an image, or if it cannot be built.
    pub merits: Vec<Option<f64>>,
    /// Where the compensators of each stand, in their units; empty without a merit.
    pub compensators: Vec<Vec<f64>>,
    /// Numbers of those that cannot be built.
    #[serde(default)]
    pub unbuildable: Vec<usize>,
}

impl MadeLenses {
    pub(super) fn of(part: Part, made: &MonteCarlo) -> Self {
        let numbered = (part.from..part.to).zip(&made.trials);
        Self {
            part,
            unbuildable: numbered
                .filter(|(_, trial)| !trial.can_be_built)
                .map(|(number, _)| number)
                .collect(),
            merits: made.trials.iter().map(|trial| trial.value).collect(),
            compensators: made.trials.iter().map(|trial| trial.compensators.clone()).collect(),
        }
    }
}

/// Makes the lenses of some numbers, in parallel; the bits of each depend on the seed and its number alone. `tick` is called after each; its
/// error ends the work.
pub(super) fn made(
    study: &Study,
    seed: u64,
    Part { from, to }: Part,
    tick: &(dyn Fn() -> Result<(), Cancelled> + Sync),
) -> Result<MonteCarlo, Cancelled> {
    let counted = |number: usize| {
        let made = trial(study, seed, number as u64);
        tick()?;
        Ok(made)
    };
    let trials = (from..to).into_par_iter().map(counted).collect::<Result<_, Cancelled>>()?;
    Ok(MonteCarlo { seed, trials, better: study.better() })
}
