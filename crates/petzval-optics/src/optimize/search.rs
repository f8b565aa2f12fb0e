//! A global search that never stops improving: descents from random starts, from disturbed good lenses, and from blends of
//! two of them.
//!
//! The search goes in rounds of a fixed number of candidates. A candidate depends only on the seed, the round, its place in the round and
//! what earlier rounds found. So the same rounds give the same lenses on any number of threads. Its best lens can be read at any time, and
//! it continues from a [`SearchState`].

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::analysis::{Analysis, analyse};
use super::levenberg::{Descent, LevenbergOptions, descend_from, own_start};
use super::problem::{GlassChoice, Problem};
use crate::design_space::{DesignSpace, DesignSpaceError};

/// How to search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOptions {
    /// Everything random follows from it.
    pub seed: u64,
    /// Candidates a round: each makes one descent, unless it is dropped.
    pub round: usize,
    /// Iterations after which a candidate must be near the best to go on.
    pub trial_iterations: usize,
    /// Iterations of the candidates that go on.
    pub iterations: usize,
    /// Good lenses that are kept to start from again.
    pub keep: usize,
    /// Whether the first candidate is the problem's own lens, or a random one as all others.
    pub own_lens: bool,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self { seed: 1, round: 16, trial_iterations: 12, iterations: 150, keep: 12, own_lens: true }
    }
}

/// A lens that a search found.
#[derive(Clone, Debug)]
pub struct Found {
    /// The lens with its figures.
    pub analysis: Analysis,
    /// Its coordinates, as in [`Descent`](super::Descent).
    pub at: Vec<f64>,
    /// Its glasses: an index into the candidates of each choice.
    pub glasses: Vec<usize>,
    /// The round that found it.
    pub round: u64,
}

/// A kept lens of a [`SearchState`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Kept {
    /// Its coordinates.
    pub at: Vec<f64>,
    /// Names of its glasses.
    pub glasses: Vec<String>,
    /// The round that found it.
    pub round: u64,
}

/// What a search needs to go on later.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchState {
    /// Rounds done.
    pub round: u64,
    /// The kept lenses, best first.
    pub kept: Vec<Kept>,
}

/// A search under way.
pub struct Search<'a> {
    problem: &'a Problem,
    options: SearchOptions,
    space: DesignSpace,
    round: u64,
    /// Best first, no two alike.
    kept: Vec<Found>,
    descents: u64,
    dropped: u64,
}

/// A candidate must come this near to the best merit, in RMS, within the trial iterations.
const PROMISING: f64 = 4.0;

/// Random points that are tried for a start whose rays reach the image.
const START_ATTEMPTS: usize = 40;

/// Share of the glasses that a disturbed lens exchanges.
const EXCHANGE: f64 = 0.3;

/// Glasses that count as neighbours.
const NEIGHBOURS: usize = 10;

/// Distances on the glass map that count as one.
const ND_SCALE: f64 = 0.05;
const VD_SCALE: f64 = 5.0;

/// Two lenses whose merits differ by less than this share are taken for the same.
const ALIKE: f64 = 1e-4;

impl<'a> Search<'a> {
    /// A search that has not begun.
    pub fn new(problem: &'a Problem, options: SearchOptions) -> Result<Self, DesignSpaceError> {
        let space = problem.space()?;
        Ok(Self { problem, options, space, round: 0, kept: Vec::new(), descents: 0, dropped: 0 })
    }

    /// A search that goes on.
    pub fn resume(
        problem: &'a Problem,
        options: SearchOptions,
        state: &SearchState,
    ) -> Result<Self, DesignSpaceError> {
        let mut search = Self::new(problem, options)?;
        search.round = state.round;
        for kept in &state.kept {
            // A state may come from a file that was changed: what does not fit is left out.
            let index = |(choice, name): (&GlassChoice, &String)| {
                choice.candidates.iter().position(|glass| glass.name == *name)
            };
            let glasses: Option<Vec<usize>> = problem.glasses.iter().zip(&kept.glasses).map(index).collect();
            let Some(glasses) = glasses.filter(|g| g.len() == problem.glasses.len()) else { continue };
            let with = problem.with_glasses(&glasses);
            let space = with.space()?;
            if kept.at.len() != space.dimension() || !kept.at.iter().all(|x| x.is_finite()) {
                continue;
            }
            if let Some(analysis) = space.lens_at(&kept.at).ok().and_then(|lens| analyse(&with, lens, None)) {
                search.keep(Found { analysis, at: kept.at.clone(), glasses, round: kept.round });
            }
        }
        Ok(search)
    }

    /// What is needed to go on later.
    pub fn state(&self) -> SearchState {
        let names = |f: &Found| {
            let named = self.problem.glasses.iter().zip(&f.glasses);
            named.map(|(choice, i)| choice.candidates[*i].name.clone()).collect()
        };
        let kept = |f: &Found| Kept { at: f.at.clone(), glasses: names(f), round: f.round };
        SearchState { round: self.round, kept: self.kept.iter().map(kept).collect() }
    }

    /// The best lens so far.
    pub fn best(&self) -> Option<&Found> {
        self.kept.first()
    }

    /// The problem's own lens inside its bounds, before any descent: what a search must beat. The error says why it has no merit.
    pub fn own_lens(&self) -> Result<Found, DesignSpaceError> {
        let glasses = self.own_glasses();
        let with = self.problem.with_glasses(&glasses);
        let space = with.space()?;
        let at = own_start(&with, &space)?;
        let analysis = analyse(&with, space.lens_at(&at)?, None).ok_or(DesignSpaceError::NoRays)?;
        Ok(Found { analysis, at, glasses, round: 0 })
    }

    /// The glasses of the problem's own lens; the first candidate for one that is no candidate.
    fn own_glasses(&self) -> Vec<usize> {
        let own = |choice: &GlassChoice| {
            let name = &self.problem.base.surfaces[choice.surface].glass.name;
            choice.candidates.iter().position(|glass| glass.name == *name).unwrap_or(0)
        };
        self.problem.glasses.iter().map(own).collect()
    }

    /// Good lenses that differ, best first.
    pub fn kept(&self) -> &[Found] {
        &self.kept
    }

    /// Rounds done, and descents in them.
    pub fn progress(&self) -> (u64, u64) {
        (self.round, self.descents)
    }

    /// Candidates without a descent: no start was found whose rays reach the image, or the descent lost them.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// One round. Returns whether it found a better lens.
    pub fn advance(&mut self) -> bool {
        let before = self.best().map_or(f64::INFINITY, |f| f.analysis.merit);
        let found: Vec<Option<Found>> =
            (0..self.options.round).into_par_iter().map(|place| self.candidate(place)).collect();
        let descents = found.iter().flatten().count();
        self.descents += descents as u64;
        self.dropped += (found.len() - descents) as u64;
        for candidate in found.into_iter().flatten() {
            self.keep(candidate);
        }
        self.round += 1;
        self.best().map_or(f64::INFINITY, |f| f.analysis.merit) < before
    }

    fn keep(&mut self, candidate: Found) {
        let merit = candidate.analysis.merit;
        let at = self.kept.partition_point(|f| f.analysis.merit < merit);
        let alike = |f: &Found| (f.analysis.merit - merit).abs() < ALIKE * merit;
        if at > 0 && self.kept.get(at - 1).is_some_and(alike) {
            return;
        }
        if self.kept.get(at).is_some_and(alike) {
            self.kept[at] = candidate;
        } else {
            self.kept.insert(at, candidate);
            self.kept.truncate(self.options.keep);
        }
    }

    fn candidate(&self, place: usize) -> Option<Found> {
        // A stream of its own for every candidate.
        let mut random = ChaCha8Rng::seed_from_u64(self.options.seed);
        random.set_stream(self.round * self.options.round as u64 + place as u64);
        let (start, glasses) = self.start(place, &mut random)?;
        let with = self.problem.with_glasses(&glasses);
        let (problem, space) = (&with, &with.space().ok()?);
        let options =
            |iterations, tolerance| LevenbergOptions { iterations, tolerance, ..LevenbergOptions::default() };
        let go_on = &mut |_: usize, _: &Analysis, _: &[f64]| true;
        let trial =
            descend_from(problem, space, start, &options(self.options.trial_iterations, 1e-3), go_on)?;
        let best = self.best().map_or(f64::INFINITY, |f| f.analysis.merit);
        // Analysed afresh, as it will be when the search goes on from its state.
        let found = |d: Descent| {
            let analysis = analyse(problem, d.best.lens, None)?;
            Some(Found { analysis, at: d.at, glasses, round: self.round })
        };
        if trial.best.merit > PROMISING * PROMISING * best {
            return found(trial);
        }
        let more = options(self.options.iterations, 1e-5);
        found(descend_from(problem, space, trial.at, &more, go_on)?)
    }

    /// Where a candidate starts: in a quarter of the places anywhere within the bounds, else near what is known.
    fn start(&self, place: usize, random: &mut ChaCha8Rng) -> Option<(Vec<f64>, Vec<usize>)> {
        if self.options.own_lens && self.round == 0 && place == 0 {
            let glasses = self.own_glasses();
            let with = self.problem.with_glasses(&glasses);
            let at = own_start(&with, &with.space().ok()?).ok()?;
            return Some((at, glasses));
        }
        if self.kept.len() < 2 || place.is_multiple_of(4) {
            for _ in 0..START_ATTEMPTS {
                let glasses: Vec<usize> =
                    self.problem.glasses.iter().map(|g| random.random_range(0..g.candidates.len())).collect();
                let with = self.problem.with_glasses(&glasses);
                let at = self.anywhere(&with, random)?;
                if traces(&with, &at) {
                    return Some((at, glasses));
                }
            }
            return None;
        }
        // The better, the likelier.
        let mut pick = || {
            let share: f64 = random.random::<f64>() * random.random::<f64>();
            (share * self.kept.len() as f64) as usize
        };
        let (first, second) = (&self.kept[pick()], &self.kept[pick()]);
        let (mut at, mut glasses) = (first.at.clone(), first.glasses.clone());
        if place % 4 == 1 {
            // A blend, a little beyond either end too.
            let share = random.random_range(-0.3..1.3);
            for (x, other) in at.iter_mut().zip(&second.at) {
                *x += share * (other - *x);
            }
            for (glass, other) in glasses.iter_mut().zip(&second.glasses) {
                if random.random::<bool>() {
                    *glass = *other;
                }
            }
        } else {
            let size = 10f64.powf(random.random_range(-2.5..-0.3));
            let touched = random.random_range(0.15..1.0);
            for (x, [low, high]) in at.iter_mut().zip(self.space.bounds()) {
                if (high - low).is_finite() && random.random::<f64>() < touched {
                    *x += size * (high - low) * random.random_range(-1.0..1.0);
                }
            }
            for (glass, choice) in glasses.iter_mut().zip(&self.problem.glasses) {
                if random.random::<f64>() < EXCHANGE {
                    *glass = a_neighbour(choice, *glass, random);
                }
            }
        }
        for (x, [low, high]) in at.iter_mut().zip(self.space.bounds()) {
            *x = x.clamp(*low, *high);
        }
        traces(&self.problem.with_glasses(&glasses), &at).then_some((at, glasses))
    }

    fn anywhere(&self, problem: &Problem, random: &mut ChaCha8Rng) -> Option<Vec<f64>> {
        let space = problem.space().ok()?;
        let mut at = space.start();
        for (x, [low, high]) in at.iter_mut().zip(space.bounds()) {
            if (high - low).is_finite() {
                *x = low + (high - low) * random.random::<f64>();
            }
        }
        space.refocus(&mut at);
        Some(at)
    }
}

fn traces(problem: &Problem, at: &[f64]) -> bool {
    let lens = problem.space().and_then(|space| space.lens_at(at)).ok();
    lens.is_some_and(|lens| analyse(problem, lens, None).is_some())
}

/// One of the glasses nearest to a glass on the map of n_d and V_d.
fn a_neighbour(choice: &GlassChoice, glass: usize, random: &mut ChaCha8Rng) -> usize {
    let place = |i: usize| (choice.candidates[i].nd(), choice.candidates[i].abbe_vd());
    let (nd, vd) = place(glass);
    let distance = |i: usize| {
        let (other_nd, other_vd) = place(i);
        ((other_nd - nd) / ND_SCALE).hypot((other_vd - vd) / VD_SCALE)
    };
    let mut others: Vec<usize> = (0..choice.candidates.len()).filter(|i| *i != glass).collect();
    others.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    others.truncate(NEIGHBOURS);
    if others.is_empty() { glass } else { others[random.random_range(0..others.len())] }
}
