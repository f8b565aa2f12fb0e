//! How far a score scatters with the choice of pictures: the bootstrap.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How pictures are drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Bootstrap {
    /// Number of the cluster of each picture. Pictures of one film resemble each other, and are drawn together.
    pub clusters: Vec<usize>,
    /// Draws.
    pub draws: usize,
    /// Seed of the draws. Equal seeds and clusters give equal draws.
    pub seed: u64,
    /// Share of the draws inside the interval, such as 0.95.
    pub confidence: f64,
}

impl Bootstrap {
    /// 1000 draws of single pictures, 95 %.
    pub fn of_pictures(pictures: usize, seed: u64) -> Self {
        Self::of_clusters((0..pictures).collect(), seed)
    }

    /// 1000 draws of clusters of pictures, 95 %.
    pub fn of_clusters(clusters: Vec<usize>, seed: u64) -> Self {
        Self { clusters, draws: 1000, seed, confidence: 0.95 }
    }
}

/// A score with the range in which it scatters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// The score of the pictures as they are.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
    /// Standard deviation of the score over the draws.
    pub standard_error: f64,
    /// Share of the draws whose score is above 0; of a difference, how surely the second camera is better.
    pub above_zero: f64,
}

/// Draws as many clusters as there are, with repetition, and scores them again and again: a percentile interval.
///
/// `score` gets how often each picture counts, and is `None` where it is undefined; such draws are left out. For the difference of two
/// cameras that took the same scenes, let it return the difference: both then see the same draw. A single cluster says nothing about how others
/// differ from it, and has no interval.
///
/// ```
/// # use petzval_learn::score::detection::{Bootstrap, bootstrap};
/// let errors = [1.0, 2.0, 3.0, 4.0];
/// let mean = |counts: &[u32]| {
///     let sum: f64 = errors.iter().zip(counts).map(|(e, n)| e * f64::from(*n)).sum();
///     Some(sum / 4.0)
/// };
/// let interval = bootstrap(&Bootstrap::of_pictures(4, 1), mean).unwrap();
/// assert!(interval.value == 2.5 && interval.low < 2.0 && interval.high > 3.0);
/// ```
pub fn bootstrap(how: &Bootstrap, score: impl Fn(&[u32]) -> Option<f64> + Sync) -> Option<Interval> {
    let value = score(&vec![1; how.clusters.len()])?;
    let mut scores: Vec<f64> = drawn_scores(how, score).into_iter().flatten().collect();
    let [low, high] = percentiles(&mut scores, how.confidence)?;
    let n = scores.len() as f64;
    let mean = scores.iter().sum::<f64>() / n;
    let variance = scores.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let above_zero = scores.iter().filter(|s| **s > 0.0).count() as f64 / n;
    Some(Interval { value, low, high, standard_error: variance.sqrt(), above_zero })
}

/// The scores of all draws of [`bootstrap`], in their order; none of a single cluster. Cameras that took the same scenes see the same draws, so that
/// the differences of two such lists are those of the cameras.
pub fn drawn_scores(how: &Bootstrap, score: impl Fn(&[u32]) -> Option<f64> + Sync) -> Vec<Option<f64>> {
    let mut names = how.clusters.clone();
    names.sort_unstable();
    names.dedup();
    if names.len() < 2 {
        return Vec::new();
    }
    let members: Vec<usize> = how.clusters.iter().map(|c| names.partition_point(|name| name < c)).collect();
    let draw = |k: usize| {
        let mut random = ChaCha8Rng::seed_from_u64(how.seed);
        random.set_stream(k as u64);
        let mut drawn = vec![0_u32; names.len()];
        for _ in 0..names.len() {
            drawn[random.random_range(0..names.len())] += 1;
        }
        let counts: Vec<u32> = members.iter().map(|cluster| drawn[*cluster]).collect();
        score(&counts)
    };
    (0..how.draws).into_par_iter().map(draw).collect()
}

/// The ends of the interval that holds a share of some scores, which are sorted; none without scores.
pub fn percentiles(scores: &mut [f64], confidence: f64) -> Option<[f64; 2]> {
    scores.sort_by(f64::total_cmp);
    let tail = 0.5 * (1.0 - confidence.clamp(0.0, 1.0));
    (!scores.is_empty()).then(|| [quantile(scores, tail), quantile(scores, 1.0 - tail)])
}

/// A quantile of sorted values, linear between them.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = share * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    below + (above - below) * at.fract()
}
