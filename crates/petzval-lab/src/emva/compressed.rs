//! Digital numbers that were compressed in the camera, as by a table of square roots: numbers that never occur, in gaps that grow with the level.
//!
//! Two numbers that follow each other among those that occur, `g` apart, are certainly neighbours if both have at least `25 g` samples: each number
//! between them would have some as well. Rounding to steps of `g` adds a variance of `g^2 / 12` to the noise, which no subtraction of dark frames
//! removes where the steps grow.

use schemars::JsonSchema;
use serde::Serialize;

use super::counts::Counts;

/// Samples that each missing number would have at least.
const FEWEST_SAMPLES: u64 = 25;

/// Least number of certain steps.
const LEAST_STEPS: usize = 12;

/// Least growth of the mean step from the lowest to the highest quarter of the steps.
const LEAST_GROWTH: f64 = 1.5;

/// How the steps between digital numbers grow.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Compression {
    /// Mean of the lowest quarter of the steps, DN.
    pub low_step_dn: f64,
    /// Mean of the highest quarter, DN.
    pub high_step_dn: f64,
    /// Standard error that the steps add to K, DN/e-.
    pub gain_error_dn_per_e: f64,
}

/// Certain steps between numbers, ascending: samples at the lower number, and the step, DN.
fn steps(counts: &Counts) -> Vec<(f64, f64)> {
    let occupied: Vec<(u64, u64)> = (counts.counts.iter().zip(0..))
        .filter(|(count, _)| **count > 0)
        .map(|(count, dn)| (*count, dn))
        .collect();
    let certain = occupied.windows(2).filter_map(|pair| {
        let [(low, at), (high, next)] = [pair[0], pair[1]];
        let step = next - at;
        (low.min(high) >= FEWEST_SAMPLES * step).then_some((low as f64, step as f64))
    });
    certain.collect()
}

/// The mean step at the lower and at the upper end of all samples of a gain, if it grows.
pub(super) fn growing_steps(counts: &Counts) -> Option<[f64; 2]> {
    let all: Vec<f64> = steps(counts).into_iter().map(|(_, step)| step).collect();
    let quarter = all.len() / 4;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    (all.len() >= LEAST_STEPS)
        .then(|| [mean(&all[..quarter]), mean(&all[all.len() - quarter..])])
        .filter(|[low, high]| *high > LEAST_GROWTH * low)
}

/// Variance that rounding to the steps adds to the samples of one point, DN^2.
pub(super) fn step_variance_dn2(counts: &Counts) -> f64 {
    let all = steps(counts);
    let samples: f64 = all.iter().map(|(samples, _)| samples).sum();
    let squares: f64 = all.iter().map(|(samples, step)| samples * step * step).sum();
    if samples > 0.0 { squares / samples / 12.0 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(numbers: impl Iterator<Item = (usize, u64)>) -> Counts {
        let mut table = vec![0; 4096];
        numbers.for_each(|(dn, count)| table[dn] = count);
        Counts::of(&table)
    }

    #[test]
    fn steps_that_grow_are_distinguished_from_even_ones_and_from_few_samples() {
        let even = |step: usize| at((5..80).map(|i| (step * i, 1000)));
        assert_eq!([1, 2, 16].map(|step| growing_steps(&even(step))), [None; 3]);
        let square = at((10..60).map(|i| (i * i, 4000)));
        let [low, high] = growing_steps(&square).unwrap();
        // From 10^2 the steps are 2 i + 1: 21 to 43 and 97 to 117.
        assert!(low > 20.0 && high > 1.5 * low, "{low} {high}");
        // Gaps between few samples are chance.
        let few = at((10..60).map(|i| (i * i, 20)));
        assert_eq!(growing_steps(&few), None);
        assert!((step_variance_dn2(&even(4)) - 16.0 / 12.0).abs() < 1e-12);
        assert_eq!(step_variance_dn2(&few), 0.0);
    }
}
