//! Where a descent stands between two iterations, so that one that is interrupted goes on to the same bits.

use serde::{Deserialize, Serialize};

use super::analysis::{Analysis, figures};
use super::problem::Problem;
use crate::design_space::DesignSpace;
use crate::merit::Landings;

/// Why a descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// An iteration brought less than the tolerance.
    Converged,
    /// No step improves the merit.
    Stuck,
    /// All iterations are done.
    Exhausted,
    /// The caller stopped it.
    Interrupted,
}

/// All that a descent needs to go on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DescentState {
    /// Coordinates: one per variable (a curvature for a radius), then the image distance if it is free.
    pub at: Vec<f64>,
    /// Iterations done.
    pub iterations: usize,
    /// Why it ended; `None` on the way.
    pub stop: Option<Stop>,
    /// The last good damping.
    pub(super) damping: f64,
    /// Iterations of little gain in a row.
    pub(super) calm: usize,
    /// The rays of the lens there, from which the aiming of the next one starts: without them its last digits would differ.
    pub(super) landings: Landings,
}

/// A descent under way: what its watcher sees before every iteration and at the end.
#[derive(Clone, Debug)]
pub struct DescentProgress {
    /// The best lens so far.
    pub best: Analysis,
    /// Its coordinates, as in [`DescentState`].
    pub at: Vec<f64>,
    /// Iterations done.
    pub iterations: usize,
    pub(super) damping: f64,
    pub(super) calm: usize,
}

impl DescentProgress {
    /// A descent that begins at a lens.
    pub(super) fn new(best: Analysis, at: Vec<f64>) -> Self {
        Self { best, at, iterations: 0, damping: 1e-3, calm: 0 }
    }

    /// One that goes on from a state; `None` if the state is none of this problem.
    pub(super) fn restore(problem: &Problem, space: &DesignSpace, state: &DescentState) -> Option<Self> {
        if state.at.len() != space.dimension() || !state.at.iter().all(|x| x.is_finite()) {
            return None;
        }
        let best = figures(problem, space.lens_at(&state.at).ok()?, state.landings.clone())?;
        let DescentState { at, iterations, damping, calm, .. } = state.clone();
        Some(Self { best, at, iterations, damping, calm })
    }

    /// What is needed to go on from here.
    pub fn state(&self) -> DescentState {
        let (at, landings) = (self.at.clone(), self.best.landings().clone());
        DescentState {
            at,
            iterations: self.iterations,
            stop: None,
            damping: self.damping,
            calm: self.calm,
            landings,
        }
    }
}

impl DescentState {
    /// The same for a descent that ended, and is to go on nevertheless.
    pub fn going_on(self) -> Self {
        Self { stop: None, calm: 0, ..self }
    }
}
