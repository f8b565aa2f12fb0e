//! A global search that never stops improving: descents from random starts, from disturbed good lenses, and from blends of
//! two of them.
//!
//! The search goes in rounds of a fixed number of candidates. What a candidate is depends on the seed, the round, its place
//! in the round and what earlier rounds found, and on nothing else, so the same rounds give the same lenses on any number of
//! threads. It can be asked for its best at any time, and goes on from a [`SearchState`].

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::chart::{Chart, ChartError};
use super::levenberg::{LevenbergOptions, descend_from};
use super::merit::Analysis;
use super::problem::Problem;

/// How to search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOptions {
    /// Everything random follows from it.
    pub seed: u64,
    /// Candidates a round.
    pub round: usize,
    /// Iterations after which a candidate must be near the best to go on.
    pub trial_iterations: usize,
    /// Iterations of the candidates that go on.
    pub iterations: usize,
    /// Good lenses that are kept to start from again.
    pub keep: usize,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self { seed: 1, round: 16, trial_iterations: 12, iterations: 150, keep: 12 }
    }
}

/// A lens that a search found.
#[derive(Clone, Debug)]
pub struct Found {
    /// The lens with its figures.
    pub analysis: Analysis,
    /// Its coordinates, as in [`Descent`](super::Descent).
    pub at: Vec<f64>,
    /// The round that found it.
    pub round: u64,
}

/// What a search needs to go on later.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchState {
    /// Rounds done.
    pub round: u64,
    /// Coordinates of the kept lenses and the round that found each, best first.
    pub kept: Vec<(Vec<f64>, u64)>,
}

/// A search under way.
pub struct Search<'a> {
    problem: &'a Problem,
    options: SearchOptions,
    chart: Chart<'a>,
    round: u64,
    /// Best first, no two alike.
    kept: Vec<Found>,
    descents: u64,
}

/// A candidate must come this near to the best merit, in RMS, within the trial iterations.
const PROMISING: f64 = 4.0;

/// Random points that are tried for a start whose rays reach the image.
const START_ATTEMPTS: usize = 40;

/// Two lenses whose merits differ by less than this share are taken for the same.
const ALIKE: f64 = 1e-4;

impl<'a> Search<'a> {
    /// A search that has not begun.
    pub fn new(problem: &'a Problem, options: SearchOptions) -> Result<Self, ChartError> {
        let chart = Chart::new(problem)?;
        Ok(Self { problem, options, chart, round: 0, kept: Vec::new(), descents: 0 })
    }

    /// A search that goes on.
    pub fn resume(
        problem: &'a Problem,
        options: SearchOptions,
        state: &SearchState,
    ) -> Result<Self, ChartError> {
        let mut search = Self::new(problem, options)?;
        search.round = state.round;
        for (at, round) in &state.kept {
            if let Some(analysis) =
                search.chart.lens(at).and_then(|l| super::merit::analyse(problem, l, None))
            {
                search.kept.push(Found { analysis, at: at.clone(), round: *round });
            }
        }
        Ok(search)
    }

    /// What is needed to go on later.
    pub fn state(&self) -> SearchState {
        let kept = self.kept.iter().map(|f| (f.at.clone(), f.round)).collect();
        SearchState { round: self.round, kept }
    }

    /// The best lens so far.
    pub fn best(&self) -> Option<&Found> {
        self.kept.first()
    }

    /// Good lenses that differ, best first.
    pub fn kept(&self) -> &[Found] {
        &self.kept
    }

    /// Rounds done, and descents in them.
    pub fn progress(&self) -> (u64, u64) {
        (self.round, self.descents)
    }

    /// One round. Returns whether it found a better lens.
    pub fn advance(&mut self) -> bool {
        let before = self.best().map_or(f64::INFINITY, |f| f.analysis.merit);
        let found: Vec<Option<Found>> =
            (0..self.options.round).into_par_iter().map(|place| self.candidate(place)).collect();
        self.descents += found.iter().flatten().count() as u64;
        for candidate in found.into_iter().flatten() {
            self.keep(candidate);
        }
        self.round += 1;
        self.best().map_or(f64::INFINITY, |f| f.analysis.merit) < before
    }

    fn keep(&mut self, candidate: Found) {
        let merit = candidate.analysis.merit;
        let at = self.kept.partition_point(|f| f.analysis.merit < merit);
        let alike =
            |other: Option<&Found>| other.is_some_and(|f| (f.analysis.merit - merit).abs() < ALIKE * merit);
        if alike(self.kept.get(at)) {
            self.kept[at] = candidate;
        } else if !(at > 0 && alike(self.kept.get(at - 1))) {
            self.kept.insert(at, candidate);
            self.kept.truncate(self.options.keep);
        }
    }

    fn candidate(&self, place: usize) -> Option<Found> {
        // A stream of its own for every candidate.
        let mut random = ChaCha8Rng::seed_from_u64(self.options.seed);
        random.set_stream(self.round * self.options.round as u64 + place as u64);
        let start = self.start(place, &mut random)?;
        let options = |iterations, tolerance| LevenbergOptions { iterations, tolerance };
        let go_on = &mut |_: usize, _: &Analysis, _: &[f64]| true;
        let (problem, chart) = (self.problem, &self.chart);
        let trial =
            descend_from(problem, chart, start, &options(self.options.trial_iterations, 1e-3), go_on)?;
        let best = self.best().map_or(f64::INFINITY, |f| f.analysis.merit);
        if trial.best.merit > PROMISING * PROMISING * best {
            return Some(Found { analysis: trial.best, at: trial.at, round: self.round });
        }
        let descent = descend_from(problem, chart, trial.at, &options(self.options.iterations, 1e-5), go_on)?;
        Some(Found { analysis: descent.best, at: descent.at, round: self.round })
    }

    /// Where a candidate starts: in a quarter of the places anywhere within the bounds, else near what is known.
    fn start(&self, place: usize, random: &mut ChaCha8Rng) -> Option<Vec<f64>> {
        if self.kept.len() < 2 || place.is_multiple_of(4) {
            for _ in 0..START_ATTEMPTS {
                let at = self.anywhere(random);
                if self.traces(&at) {
                    return Some(at);
                }
            }
            return None;
        }
        // The better, the likelier.
        let mut pick = || {
            let share: f64 = random.random::<f64>() * random.random::<f64>();
            (share * self.kept.len() as f64) as usize
        };
        let (first, second) = (&self.kept[pick()].at, &self.kept[pick()].at);
        let mut at = first.clone();
        if place % 4 == 1 {
            // A blend, a little beyond either end too.
            let share = random.random_range(-0.3..1.3);
            for (x, other) in at.iter_mut().zip(second) {
                *x += share * (other - *x);
            }
        } else {
            let size = 10f64.powf(random.random_range(-2.5..-0.3));
            let touched = random.random_range(0.15..1.0);
            for (x, [low, high]) in at.iter_mut().zip(&self.chart.bounds) {
                if (high - low).is_finite() && random.random::<f64>() < touched {
                    *x += size * (high - low) * random.random_range(-1.0..1.0);
                }
            }
        }
        for (x, [low, high]) in at.iter_mut().zip(&self.chart.bounds) {
            *x = x.clamp(*low, *high);
        }
        self.traces(&at).then_some(at)
    }

    fn anywhere(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let mut at = self.chart.start();
        for (x, [low, high]) in at.iter_mut().zip(&self.chart.bounds) {
            if (high - low).is_finite() {
                *x = low + (high - low) * random.random::<f64>();
            }
        }
        self.chart.refocus(&mut at);
        at
    }

    fn traces(&self, at: &[f64]) -> bool {
        self.chart.lens(at).is_some_and(|lens| super::merit::analyse(self.problem, lens, None).is_some())
    }
}
