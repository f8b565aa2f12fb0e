//! Lenses made at random.

use petzval_base::Cancelled;
use rayon::prelude::*;

use super::Study;
use crate::merit::Better;

/// Shares of the lenses, percent, at which the merit is usually stated.
pub const PERCENTILES: [f64; 7] = [2.0, 10.0, 20.0, 50.0, 80.0, 90.0, 98.0];

/// One lens.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Its merit, compensators set; `None` if it brings no image.
    pub value: Option<f64>,
    /// Where its compensators stand.
    pub compensators: Vec<f64>,
}

/// Many lenses. A lens is made again from its number by [`Study::draw`] and [`Study::make`].
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
    let trial = |number: usize| {
        let made = study.make(&study.draw(seed, number as u64));
        progress()?;
        Ok(match made {
            Some(made) if made.value.is_finite() => {
                Trial { value: Some(made.value), compensators: made.compensators }
            }
            // Without an image, or with one of which nothing can be said: it could not be ranked.
            _ => Trial { value: None, compensators: Vec::new() },
        })
    };
    let trials = (0..trials).into_par_iter().map(trial).collect::<Result<_, Cancelled>>()?;
    Ok(MonteCarlo { seed, trials, better: study.better() })
}

impl MonteCarlo {
    /// Merits from the best to the worst; lenses without an image are not among them.
    pub fn sorted(&self) -> Vec<f64> {
        let mut values: Vec<f64> = self.trials.iter().filter_map(|t| t.value).collect();
        values.sort_by(|a, b| self.better.loss(*a, *b).total_cmp(&0.0));
        values
    }

    /// Lenses without an image.
    pub fn failed(&self) -> usize {
        self.trials.iter().filter(|t| t.value.is_none()).count()
    }

    /// The merit that so many percent of the lenses reach; `None` if as many bring no image. Between two lenses it is
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

    /// Mean and standard deviation of the merit over the lenses with an image.
    pub fn mean_and_deviation(&self) -> (f64, f64) {
        let values = self.sorted();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        (mean, (squares / (count - 1.0)).sqrt())
    }

    /// Numbers of the worst lenses, the worst first; those without an image before all.
    pub fn worst(&self, count: usize) -> Vec<usize> {
        let mut numbers: Vec<usize> = (0..self.trials.len()).collect();
        let rank = |n: &usize| self.trials[*n].value;
        numbers.sort_by(|a, b| match (rank(a), rank(b)) {
            (Some(a), Some(b)) => self.better.loss(b, a).total_cmp(&0.0),
            (a, b) => a.is_some().cmp(&b.is_some()),
        });
        numbers.truncate(count);
        numbers
    }
}
