//! Minimises a function over the unit cube without its gradient: CMA-ES with restarts.
//!
//! `(mu/mu_w, lambda)`-CMA-ES with active covariance after Hansen, "The CMA Evolution Strategy: A Tutorial" (arXiv 1604.00772), restarted
//! with twice the population when it has converged (IPOP, Auger and Hansen 2005). One point of each generation is the minimum of a
//! quadratic model of the values so far, injected after Hansen, "Injecting External Solutions Into CMA-ES" (arXiv 1110.4181): functions
//! whose axes matter very differently so need far fewer values. The search proposes points and is given their values:
//! the caller evaluates a whole generation at once, in parallel if it likes, and may keep the state after each.
//!
//! The points of a generation are a function of the state alone. A state that is written as JSON and read again continues with the same
//! bits.
//!
//! ```
//! use petzval_design::evolution::{Evolution, EvolutionSettings};
//!
//! let f = |x: &[f64]| (x[0] - 0.3).powi(2) + 100.0 * (x[1] - 0.9).powi(2);
//! let mut search = Evolution::new(&[0.5, 0.5], EvolutionSettings::default())?;
//! while search.evaluations() < 600 {
//!     let values: Vec<f64> = search.ask().iter().map(|x| f(x)).collect();
//!     search.tell(&values);
//! }
//! let best = search.best().map(|best| best.at.clone()).unwrap_or_default();
//! assert!((best[0] - 0.3).abs() < 1e-4 && (best[1] - 0.9).abs() < 1e-4);
//! # Ok::<(), petzval_design::evolution::EvolutionError>(())
//! ```

mod cube;
mod distribution;
mod model;
mod weights;

use std::collections::VecDeque;

use petzval_base::random::{Stage, Stream};
use serde::{Deserialize, Serialize};

use self::cube::{folded, held, image_near};
use self::distribution::{Distribution, Ended};
use self::weights::Weights;

/// How a search goes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvolutionSettings {
    /// Seed of all points.
    pub seed: u64,
    /// Points of a generation, at least 4; none means `4 + 3 ln n` for n coordinates.
    pub population: Option<usize>,
    /// First standard deviation of each coordinate, above 0, at most 1.
    pub first_deviation: f64,
    /// The search restarts when every deviation is below this.
    pub least_deviation: f64,
    /// The search restarts when the best values of many generations differ by less than this.
    pub least_change: f64,
}

impl Default for EvolutionSettings {
    fn default() -> Self {
        Self { seed: 1, population: None, first_deviation: 0.25, least_deviation: 1e-9, least_change: 1e-13 }
    }
}

/// Settings or a start that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{what} is {got}; it must be {need}")]
pub struct EvolutionError {
    /// What.
    pub what: &'static str,
    /// What was given.
    pub got: f64,
    /// What is permitted.
    pub need: &'static str,
}

/// The best point so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Best {
    /// Its coordinates, 0..1.
    pub at: Vec<f64>,
    /// Its value.
    pub value: f64,
    /// Number of the evaluation that found it, from 1.
    pub evaluation: usize,
}

/// A search: everything that the next generation depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evolution {
    settings: EvolutionSettings,
    population: usize,
    distribution: Distribution,
    /// Best values of the last generations since the restart; infinity is none.
    history: VecDeque<Option<f64>>,
    /// Points since the restart with their finite values, the latest last.
    known: VecDeque<(Vec<f64>, f64)>,
    best: Option<Best>,
    generation: u64,
    evaluations: usize,
    restarts: usize,
}

impl Evolution {
    /// A search that begins at a point of the cube.
    pub fn new(start: &[f64], settings: EvolutionSettings) -> Result<Self, EvolutionError> {
        let wrong = |what, got, need| Err(EvolutionError { what, got, need });
        if start.is_empty() || start.len() > MOST_COORDINATES {
            return wrong("number of coordinates", start.len() as f64, "1 to 1000");
        }
        if let Some(got) = start.iter().find(|x| !(0.0..=1.0).contains(*x)) {
            return wrong("start", *got, "between 0 and 1");
        }
        if !(settings.first_deviation > 0.0 && settings.first_deviation <= 1.0) {
            return wrong("first deviation", settings.first_deviation, "above 0, at most 1");
        }
        let population = settings.population.unwrap_or(4 + (3.0 * (start.len() as f64).ln()) as usize);
        if !(4..=MOST_POINTS).contains(&population) {
            return wrong("population", population as f64, "4 to 4096");
        }
        Ok(Self {
            population,
            distribution: Distribution::new(start.to_vec(), settings.first_deviation),
            history: VecDeque::new(),
            known: VecDeque::new(),
            best: None,
            generation: 0,
            evaluations: 0,
            restarts: 0,
            settings,
        })
    }

    /// The points of this generation, in the cube. Asking again gives the same.
    pub fn ask(&self) -> Vec<Vec<f64>> {
        self.steps_and_proposal().0.iter().map(|step| folded(&self.distribution.at(step))).collect()
    }

    /// Takes the values of the points that [`Evolution::ask`] returned, in their order; the lower the better, and what is no number
    /// counts as infinity.
    ///
    /// # Panics
    /// If there is not one value for each point.
    pub fn tell(&mut self, values: &[f64]) {
        assert_eq!(values.len(), self.population, "one value for each point");
        let values: Vec<f64> = values.iter().map(|v| if v.is_nan() { f64::INFINITY } else { *v }).collect();
        let (mut steps, is_proposed) = self.steps_and_proposal();
        let points: Vec<Vec<f64>> = steps.iter().map(|step| folded(&self.distribution.at(step))).collect();
        // Equal values keep their order, so that the result does not depend on how they were sorted.
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_by(|a, b| values[*a].total_cmp(&values[*b]).then(a.cmp(b)));
        let first = order[0];
        if values[first] < self.best.as_ref().map_or(f64::INFINITY, |best| best.value) {
            let at = points[first].clone();
            self.best = Some(Best { at, value: values[first], evaluation: self.evaluations + first + 1 });
        }
        self.evaluations += values.len();
        self.generation += 1;

        // A proposal may be far away; the distribution follows it no further than its own points.
        if let (true, Some(step)) = (is_proposed, steps.last_mut()) {
            self.distribution.shorten(step);
        }
        let weights = Weights::new(self.distribution.coordinates(), self.population);
        let ranked: Vec<&[f64]> = order.iter().map(|i| steps[*i].as_slice()).collect();
        let moved = self.distribution.update(&ranked, &weights);
        self.known.extend(points.into_iter().zip(values.iter().copied()).filter(|(_, v)| v.is_finite()));
        let surplus = self.known.len().saturating_sub(MOST_KNOWN.max(4 * self.population));
        self.known.drain(..surplus);
        let kept = 10 + (30 * self.distribution.coordinates()).div_ceil(self.population);
        self.history.push_back(Some(values[first]).filter(|v| v.is_finite()));
        if self.history.len() > kept {
            self.history.pop_front();
        }
        let is_flat = self.history.len() == kept && self.spread() < self.settings.least_change;
        if moved == Ended::Degenerate || is_flat || self.distribution.is_narrow(self.settings.least_deviation)
        {
            self.restart();
        }
    }

    /// The best point so far; none before the first finite value.
    pub fn best(&self) -> Option<&Best> {
        self.best.as_ref()
    }

    /// The middle of the search, in the cube: where the values are noisy, a better answer than the best point.
    pub fn middle(&self) -> Vec<f64> {
        folded(self.distribution.mean())
    }

    /// Points of a generation.
    pub fn population(&self) -> usize {
        self.population
    }

    /// Values that were taken.
    pub fn evaluations(&self) -> usize {
        self.evaluations
    }

    /// Generations that were taken.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// How many times the search has begun again.
    pub fn restarts(&self) -> usize {
        self.restarts
    }

    /// Standard deviation of the widest axis.
    pub fn deviation(&self) -> f64 {
        self.distribution.widest()
    }

    /// Difference of the greatest and the least value of the history; infinite while a value is.
    fn spread(&self) -> f64 {
        let all = || self.history.iter().map(|v| v.unwrap_or(f64::INFINITY));
        let low = all().fold(f64::INFINITY, f64::min);
        // Without any finite value the search is on a plateau.
        if low == f64::INFINITY { 0.0 } else { all().fold(low, f64::max) - low }
    }

    /// Begins again anywhere in the cube with twice the population.
    fn restart(&mut self) {
        self.restarts += 1;
        self.population = (2 * self.population).min(MOST_POINTS);
        self.history.clear();
        self.known.clear();
        let stream = Stream::new(self.settings.seed, self.generation, Stage::Search);
        let start = (0..self.distribution.coordinates())
            .map(|i| stream.uniforms(RESTART_PLACE + i as u32, 0)[0])
            .collect();
        self.distribution = Distribution::new(start, self.settings.first_deviation);
    }

    /// The steps of this generation, without mean and size of the search; the last is that of the model, if there is one.
    fn steps_and_proposal(&self) -> (Vec<Vec<f64>>, bool) {
        let mut steps = self.steps();
        let mean = self.distribution.mean();
        let mut known: Vec<(Vec<f64>, f64)> = self
            .known
            .iter()
            .map(|(point, value)| (self.distribution.white(&image_near(point, mean)), *value))
            .collect();
        known.sort_by(|a, b| a.1.total_cmp(&b.1));
        let Some(white) = model::proposal(&known) else { return (steps, false) };
        let point = held(&self.distribution.at(&self.distribution.step(&white)), mean);
        if let Some(last) = steps.last_mut() {
            *last = self.distribution.step_to(&point);
        }
        (steps, true)
    }

    /// Random steps: normal with the covariance of the search.
    fn steps(&self) -> Vec<Vec<f64>> {
        let stream = Stream::new(self.settings.seed, self.generation, Stage::Search);
        let coordinates = self.distribution.coordinates();
        (0..self.population)
            .map(|point| {
                let first = (point * MOST_COORDINATES) as u32;
                let pairs = (0..coordinates.div_ceil(2)).map(|pair| stream.normals(first + pair as u32));
                let white: Vec<f64> = pairs.flatten().take(coordinates).collect();
                self.distribution.step(&white)
            })
            .collect()
    }
}

/// Largest numbers of coordinates and of points in a generation; each number of a generation has its own place in the stream.
const MOST_COORDINATES: usize = 1000;
const MOST_POINTS: usize = 4096;

/// Points that the model may know; more for large populations.
const MOST_KNOWN: usize = 600;

/// Place of the first random number of a restart, behind those of all points.
const RESTART_PLACE: u32 = (MOST_COORDINATES * (MOST_POINTS + 1)) as u32;

#[cfg(test)]
mod tests;
