//! The profile of an edge: pixels by their distance from it, averaged over quarters of a pixel.

use super::edge::{Line, Rows};
use super::error::SfrError;
use super::limits::LEAST_HALF;

/// Bins in a pixel.
pub const BINS_PER_PIXEL: usize = 4;

/// Share of the profile, at either end, whose mean is the level of that side.
const LEVEL_SHARE: f64 = 0.2;

/// The edge spread function.
pub struct Profile {
    /// Means of the bins, from the dark side to the bright one; the edge lies between the two in the middle.
    pub bins: Vec<f64>,
    /// Root mean square deviation of the pixels from the mean of their bin.
    pub scatter: f64,
}

impl Profile {
    /// The profile across a line: every pixel counts at its distance, perpendicular to the line.
    pub fn about(rows: &Rows, line: &Line) -> Result<Self, SfrError> {
        // Whole periods of the edge against the columns give every fraction of a pixel the same weight.
        let periods = (rows.height as f64 * line.slope.abs()).floor();
        let used = ((periods / line.slope.abs()).round() as usize).min(rows.height);
        let cosine = 1.0 / line.slope.hypot(1.0);
        let ends = [line.at(0.0), line.at((used - 1) as f64)];
        let near = ends.iter().fold(f64::INFINITY, |near, at| near.min(*at).min(rows.width as f64 - at));
        let half = (near * cosine).floor().max(0.0) as usize;
        if half < LEAST_HALF {
            return Err(SfrError::Small { along: rows.height, across: half });
        }
        let count = 2 * half * BINS_PER_PIXEL;
        let (mut sums, mut weights, mut squares) = (vec![0.0; count], vec![0.0; count], 0.0);
        for row in 0..used {
            let edge = line.at(row as f64);
            for (col, value) in rows.row(row).iter().enumerate() {
                let distance = (col as f64 + 0.5 - edge) * cosine;
                let bin = ((distance + half as f64) * BINS_PER_PIXEL as f64).floor();
                if bin >= 0.0 && (bin as usize) < count {
                    sums[bin as usize] += value;
                    weights[bin as usize] += 1.0;
                    squares += value * value;
                }
            }
        }
        // The bins take the squares of their means, the rest is scatter.
        let explained: f64 =
            sums.iter().zip(&weights).filter(|(_, n)| **n > 0.0).map(|(sum, n)| sum * sum / n).sum();
        let scatter = ((squares - explained).max(0.0) / weights.iter().sum::<f64>()).sqrt();
        Ok(Self { bins: filled(&sums, &weights), scatter })
    }

    /// Distance from the edge, pixels, and mean of every bin.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        let half = self.bins.len() as f64 / 2.0;
        self.bins.iter().enumerate().map(move |(i, v)| ((i as f64 + 0.5 - half) / BINS_PER_PIXEL as f64, *v))
    }

    /// The dark and the bright level, far from the edge.
    pub fn levels(&self) -> [f64; 2] {
        let part = (self.bins.len() as f64 * LEVEL_SHARE) as usize;
        let mean = |side: &[f64]| side.iter().sum::<f64>() / side.len() as f64;
        [mean(&self.bins[..part]), mean(&self.bins[self.bins.len() - part..])]
    }
}

/// Means of bins; one that no pixel fell into is interpolated between its neighbours.
fn filled(sums: &[f64], weights: &[f64]) -> Vec<f64> {
    let mean = |i: usize| (weights[i] > 0.0).then(|| sums[i] / weights[i]);
    let known: Vec<(usize, f64)> = (0..sums.len()).filter_map(|i| Some((i, mean(i)?))).collect();
    let value = |i: usize| {
        let next = known.partition_point(|(at, _)| *at < i);
        match (known.get(next.wrapping_sub(1)), known.get(next)) {
            (_, Some((at, v))) if *at == i => *v,
            (Some((a, low)), Some((b, high))) => low + (high - low) * (i - a) as f64 / (b - a) as f64,
            (Some((_, v)), None) | (None, Some((_, v))) => *v,
            (None, None) => 0.0,
        }
    };
    (0..sums.len()).map(value).collect()
}
