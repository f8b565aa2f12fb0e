//! A part of the lenses that are made at random, by number.

use petzval_base::Cancelled;
use petzval_optics::tolerance::{MonteCarlo, Study, Trial};
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
    /// Merit of each; none without an image.
    pub merits: Vec<Option<f64>>,
    /// Where the compensators of each stand, in their units; empty without an image.
    pub compensators: Vec<Vec<f64>>,
}

impl MadeLenses {
    pub(super) fn of(part: Part, made: &MonteCarlo) -> Self {
        Self {
            part,
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
    let trial = |number: usize| {
        let made = study.make(&study.draw(seed, number as u64));
        tick()?;
        // Without an image, or with one of which nothing can be said, a lens cannot be ranked.
        let made = made.filter(|made| made.value.is_finite());
        Ok(Trial {
            value: made.as_ref().map(|made| made.value),
            compensators: made.map_or_else(Vec::new, |made| made.compensators),
        })
    };
    let trials = (from..to).into_par_iter().map(trial).collect::<Result<_, Cancelled>>()?;
    Ok(MonteCarlo { seed, trials, better: study.better() })
}
