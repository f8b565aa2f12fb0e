//! The normal distribution of a search, and its update from ranked points.

use nalgebra::{DMatrix, SymmetricEigen};
use serde::{Deserialize, Serialize};

use super::weights::Weights;

/// Largest ratio of the variances along two axes.
const MOST_CONDITION: f64 = 1e14;

/// Largest deviation; the cube is 1 wide.
const MOST_DEVIATION: f64 = 10.0;

/// Normal distribution with mean `m` and covariance `s^2 C`, `C = B D^2 B^T`, and the two paths that adapt it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Distribution {
    mean: Vec<f64>,
    /// `s`.
    size: f64,
    /// `C`, row by row.
    covariance: Vec<f64>,
    /// `B`, row by row; its columns are the axes.
    axes: Vec<f64>,
    /// `D`: standard deviation along each axis.
    lengths: Vec<f64>,
    /// Path of the size.
    size_path: Vec<f64>,
    /// Path of the covariance.
    path: Vec<f64>,
    /// Updates since it began.
    updates: i32,
}

/// What an update did to the distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ended {
    /// It can go on.
    No,
    /// Its covariance has become singular, or wider than any search.
    Degenerate,
}

impl Distribution {
    /// A round distribution.
    pub fn new(mean: Vec<f64>, size: f64) -> Self {
        let n = mean.len();
        let identity: Vec<f64> = (0..n * n).map(|i| if i % (n + 1) == 0 { 1.0 } else { 0.0 }).collect();
        Self {
            mean,
            size,
            covariance: identity.clone(),
            axes: identity,
            lengths: vec![1.0; n],
            size_path: vec![0.0; n],
            path: vec![0.0; n],
            updates: 0,
        }
    }

    /// Number of coordinates.
    pub fn coordinates(&self) -> usize {
        self.mean.len()
    }

    /// The step `y = B D z` of white noise `z`.
    pub fn step(&self, white: &[f64]) -> Vec<f64> {
        let n = self.coordinates();
        let along: Vec<f64> = white.iter().zip(&self.lengths).map(|(z, d)| z * d).collect();
        (0..n).map(|i| dot(&self.axes[i * n..(i + 1) * n], &along)).collect()
    }

    /// The point `m + s y` of a step.
    pub fn at(&self, step: &[f64]) -> Vec<f64> {
        self.mean.iter().zip(step).map(|(m, y)| m + self.size * y).collect()
    }

    /// `m`.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// The step to a point: the inverse of [`Self::at`].
    pub fn step_to(&self, point: &[f64]) -> Vec<f64> {
        self.mean.iter().zip(point).map(|(m, x)| (x - m) / self.size).collect()
    }

    /// The white noise `z` that would lead to a point.
    pub fn white(&self, point: &[f64]) -> Vec<f64> {
        self.along_axes(&self.step_to(point))
    }

    /// Shortens a step whose white noise is improbably long: beyond `sqrt(n) + 2n / (n + 2)`.
    pub fn shorten(&self, step: &mut [f64]) {
        let n = self.coordinates() as f64;
        let white = self.along_axes(step);
        let (length, longest) = (dot(&white, &white).sqrt(), n.sqrt() + 2.0 * n / (n + 2.0));
        if length > longest {
            step.iter_mut().for_each(|y| *y *= longest / length);
        }
    }

    /// Standard deviation along the widest axis.
    pub fn widest(&self) -> f64 {
        self.size * self.lengths.iter().copied().fold(0.0, f64::max)
    }

    /// Whether every coordinate, and the step that the path proposes, is smaller than `least`.
    pub fn is_narrow(&self, least: f64) -> bool {
        let n = self.coordinates();
        (0..n).all(|i| {
            self.size * self.covariance[i * n + i].sqrt() < least && self.size * self.path[i].abs() < least
        })
    }

    /// `D^-1 B^T y`.
    fn along_axes(&self, y: &[f64]) -> Vec<f64> {
        let n = self.coordinates();
        (0..n)
            .map(|axis| (0..n).map(|i| self.axes[i * n + axis] * y[i]).sum::<f64>() / self.lengths[axis])
            .collect()
    }

    /// `C^(-1/2) y = B D^-1 B^T y`.
    fn whitened(&self, y: &[f64]) -> Vec<f64> {
        let n = self.coordinates();
        let along = self.along_axes(y);
        (0..n).map(|i| dot(&self.axes[i * n..(i + 1) * n], &along)).collect()
    }

    /// Moves mean, size and covariance, given the steps of a generation from the best to the worst: equations 38 to 47 of the
    /// tutorial.
    pub fn update(&mut self, ranked: &[&[f64]], weights: &Weights) -> Ended {
        let n = self.coordinates();
        let dimension = n as f64;
        // Length of white noise, on average.
        let expected =
            dimension.sqrt() * (1.0 - 1.0 / (4.0 * dimension) + 1.0 / (21.0 * dimension * dimension));

        // Move the mean to the weighted mean of the better half.
        let mut mean_step = vec![0.0; n];
        for (y, w) in ranked.iter().zip(&weights.of_rank).take(weights.parents) {
            add(&mut mean_step, y, *w);
        }
        add(&mut self.mean, &mean_step, self.size);

        // Grow the size if successive steps point the same way, shrink it if they cancel.
        let rate = weights.size_rate;
        let white = self.whitened(&mean_step);
        self.size_path.iter_mut().for_each(|p| *p *= 1.0 - rate);
        add(&mut self.size_path, &white, (rate * (2.0 - rate) * weights.effective).sqrt());
        let length = dot(&self.size_path, &self.size_path).sqrt();
        self.size *= (rate / weights.size_damping * (length / expected - 1.0)).min(1.0).exp();

        // Hold the path of the covariance while the size is far too small.
        self.updates = self.updates.saturating_add(1);
        let settled = (1.0 - (1.0 - rate).powi(self.updates.saturating_mul(2))).sqrt();
        let is_steady = length / settled < (1.4 + 2.0 / (dimension + 1.0)) * expected;
        let rate = weights.path_rate;
        self.path.iter_mut().for_each(|p| *p *= 1.0 - rate);
        if is_steady {
            add(&mut self.path, &mean_step, (rate * (2.0 - rate) * weights.effective).sqrt());
        }

        // Stretch the covariance along the path and along good points, and shrink it along bad ones.
        let missing = if is_steady { 0.0 } else { rate * (2.0 - rate) };
        let all: f64 = weights.of_rank.iter().sum();
        let keep = 1.0 + weights.rank_one * missing - weights.rank_one - weights.rank_mu * all;
        self.covariance.iter_mut().for_each(|c| *c *= keep);
        let path = self.path.clone();
        self.add_outer(&path, weights.rank_one);
        for (y, w) in ranked.iter().zip(&weights.of_rank) {
            let share = if *w < 0.0 {
                let white = self.whitened(y);
                w * dimension / dot(&white, &white).max(f64::MIN_POSITIVE)
            } else {
                *w
            };
            self.add_outer(y, weights.rank_mu * share);
        }
        self.decompose()
    }

    /// Adds `share y y^T` to the covariance.
    fn add_outer(&mut self, y: &[f64], share: f64) {
        let n = self.coordinates();
        for i in 0..n {
            add(&mut self.covariance[i * n..(i + 1) * n], y, share * y[i]);
        }
    }

    /// Axes and lengths of the covariance.
    fn decompose(&mut self) -> Ended {
        let n = self.coordinates();
        let is_finite = self.covariance.iter().chain(&self.mean).all(|c| c.is_finite());
        if !is_finite || !self.size.is_finite() || self.size <= 0.0 {
            return Ended::Degenerate;
        }
        let eigen = SymmetricEigen::new(DMatrix::from_row_slice(n, n, &self.covariance));
        let values = eigen.eigenvalues.as_slice();
        let [least, greatest] = [
            values.iter().copied().fold(f64::INFINITY, f64::min),
            values.iter().copied().fold(0.0, f64::max),
        ];
        if !(least > 0.0 && greatest < MOST_CONDITION * least) {
            return Ended::Degenerate;
        }
        self.lengths = values.iter().map(|v| v.sqrt()).collect();
        self.axes = (0..n * n).map(|i| eigen.eigenvectors[(i / n, i % n)]).collect();
        if self.widest() > MOST_DEVIATION { Ended::Degenerate } else { Ended::No }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// `target += share * y`.
fn add(target: &mut [f64], y: &[f64], share: f64) {
    target.iter_mut().zip(y).for_each(|(t, y)| *t += share * y);
}
