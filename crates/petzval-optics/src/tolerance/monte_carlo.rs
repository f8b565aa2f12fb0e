//! Lenses made at random.

use petzval_base::Cancelled;
use rayon::prelude::*;

use super::{Failure, Study};
use crate::merit::Better;

/// Shares of the lenses, percent, at which the merit is usually stated.
pub const PERCENTILES: [f64; 7] = [2.0, 10.0, 20.0, 50.0, 80.0, 90.0, 98.0];

/// One lens.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Its merit, compensators set; `None` if it brings no image or cannot be built.
    pub value: Option<f64>,
    /// Where its compensators stand; empty without a merit.
    pub compensators: Vec<f64>,
    /// Whether its parts fit together.
    pub can_be_built: bool,
}

/// Makes the lens of a number from its seed. Other lenses have no part in it.
pub fn trial(study: &Study, seed: u64, number: u64) -> Trial {
    match study.build(&study.draw(seed, number)) {
        // An image of which nothing can be said could not be ranked.
        Ok(made) if made.value.is_finite() => {
            Trial { value: Some(made.value), compensators: made.compensators, can_be_built: true }
        }
        failed => {
            let can_be_built = !matches!(failed, Err(Failure::CannotBeBuilt(_)));
            Trial { value: None, compensators: Vec::new(), can_be_built }
        }
    }
}

/// Many lenses. A lens is made again from its number by [`Study::draw`] and [`Study::build`].
#[derive(Clone, Debug, PartialEq)]
pub struct MonteCarlo {
    /// What every draw follows from.
    pub seed: u64,
    /// The lenses by number.
    pub trials: Vec<Trial>,
    /// Which way the merit is good.
    pub better: Better,
}

/// Makes lenses 0 ... `trials` - 1 of a seed, in parallel; the bits do not depend on the number of threads. `progress` is called after
/// each; its error ends the work.
pub fn monte_carlo(
    study: &Study,
    seed: u64,
    trials: usize,
    progress: &(dyn Fn() -> Result<(), Cancelled> + Sync),
) -> Result<MonteCarlo, Cancelled> {
    let counted = |number: usize| {
        let made = trial(study, seed, number as u64);
        progress()?;
        Ok(made)
    };
    let trials = (0..trials).into_par_iter().map(counted).collect::<Result<_, Cancelled>>()?;
    Ok(MonteCarlo { seed, trials, better: study.better() })
}

impl MonteCarlo {
    /// Merits from the best to the worst; those without an image and those that cannot be built are not among them.
    pub fn sorted(&self) -> Vec<f64> {
        let mut values: Vec<f64> = self.trials.iter().filter_map(|t| t.value).collect();
        values.sort_by(|a, b| self.better.loss(*a, *b).total_cmp(&0.0));
        values
    }

    /// Lenses without a merit: they bring no image or cannot be built.
    pub fn failed(&self) -> usize {
        self.trials.iter().filter(|t| t.value.is_none()).count()
    }

    /// Lenses whose parts do not fit together.
    pub fn unbuildable(&self) -> usize {
        self.trials.iter().filter(|t| !t.can_be_built).count()
    }

    /// The merit that so many percent of the lenses reach; `None` if as many have none. Between two lenses it is
    /// interpolated.
    pub fn percentile(&self, percent: f64) -> Option<f64> {
        let values = self.sorted();
        let place = 0.01 * percent.clamp(0.0, 100.0) * (self.trials.len() as f64 - 1.0);
        let below = *values.get(place.floor() as usize)?;
        let above = *values.get(place.ceil() as usize)?;
        Some(below + (above - below) * place.fract())
    }

    /// Share of all lenses whose merit is at least as good as a limit.
    pub fn yield_at(&self, limit: f64) -> f64 {
        let meets = |t: &&Trial| t.value.is_some_and(|v| self.better.meets(v, limit));
        self.trials.iter().filter(meets).count() as f64 / self.trials.len() as f64
    }

    /// The yield over the merit: (merit, share of all lenses that reach it) from the best lens to the worst.
    pub fn yield_curve(&self) -> Vec<(f64, f64)> {
        let all = self.trials.len() as f64;
        self.sorted().into_iter().enumerate().map(|(i, v)| (v, (i + 1) as f64 / all)).collect()
    }

    /// Mean and standard deviation of the merit over the lenses that have one.
    pub fn mean_and_deviation(&self) -> (f64, f64) {
        let values = self.sorted();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        (mean, (squares / (count - 1.0)).sqrt())
    }

    /// Numbers of the worst lenses, the worst first; those without an image before all. A lens that cannot be built is none of them.
    pub fn worst(&self, count: usize) -> Vec<usize> {
        let mut numbers: Vec<usize> =
            (0..self.trials.len()).filter(|number| self.trials[*number].can_be_built).collect();
        let rank = |n: &usize| self.trials[*n].value;
        numbers.sort_by(|a, b| match (rank(a), rank(b)) {
            (Some(a), Some(b)) => self.better.loss(b, a).total_cmp(&0.0),
            (a, b) => a.is_some().cmp(&b.is_some()),
        });
        numbers.truncate(count);
        numbers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lens_that_cannot_be_built_counts_against_the_yield_and_is_no_worst_lens() {
        let trial =
            |value: Option<f64>, can_be_built: bool| Trial { value, compensators: Vec::new(), can_be_built };
        let trials =
            vec![trial(Some(2.0), true), trial(None, false), trial(None, true), trial(Some(4.0), true)];
        let found = MonteCarlo { seed: 1, trials, better: Better::Lower };
        assert_eq!((found.failed(), found.unbuildable()), (2, 1));
        assert_eq!(found.worst(4), [2, 3, 0]);
        assert_eq!(found.sorted(), [2.0, 4.0]);
        assert!((found.mean_and_deviation().0 - 3.0).abs() < 1e-12);
        assert!((found.yield_at(5.0) - 0.5).abs() < 1e-12);
        assert_eq!(found.percentile(100.0), None);
    }
}
