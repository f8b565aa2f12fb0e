//! Digital numbers that were compressed in the camera, as by a table of square roots: numbers that never occur, in gaps that grow with the level.
//!
//! Two numbers that follow each other among those that occur, `g` apart, are certainly neighbours if both have at least `25 g` samples: each number
//! between them would have some as well. Rounding to steps of `g` adds a variance of `g^2 / 12` to the noise, which no subtraction of dark frames
//! removes where the steps grow.
//!
//! Dark figures hold for the steps near the black level: the errors by [rounding](super::rounding) take these in place of 1 DN.

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
    /// Step in the dark frames, DN: the errors of dark figures contain its rounding.
    pub dark_step_dn: f64,
    /// Standard error that the steps add to K, DN/e-.
    pub gain_error_dn_per_e: f64,
}

/// A step between two numbers that follow each other.
struct Step {
    /// The lower number, DN.
    at_dn: u32,
    /// Its samples.
    samples: f64,
    /// Samples of the rarer of both.
    fewest: f64,
    /// Distance, DN.
    step_dn: f64,
}

/// Certain steps between numbers, ascending.
fn steps(counts: &Counts) -> Vec<Step> {
    let occupied: Vec<(u64, u32)> = (counts.counts.iter().zip(counts.first_dn..))
        .filter(|(count, _)| **count > 0)
        .map(|(count, dn)| (*count, dn))
        .collect();
    let certain = occupied.windows(2).filter_map(|pair| {
        let [(low, at), (high, next)] = [pair[0], pair[1]];
        let fewest = low.min(high);
        (fewest >= FEWEST_SAMPLES * u64::from(next - at)).then(|| Step {
            at_dn: at,
            samples: low as f64,
            fewest: fewest as f64,
            step_dn: f64::from(next - at),
        })
    });
    certain.collect()
}

/// The mean step at the lower and at the upper end of all samples of a gain, if it grows.
pub(super) fn growing_steps(counts: &Counts) -> Option<[f64; 2]> {
    let all: Vec<f64> = steps(counts).into_iter().map(|step| step.step_dn).collect();
    let quarter = all.len() / 4;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    (all.len() >= LEAST_STEPS)
        .then(|| [mean(&all[..quarter]), mean(&all[all.len() - quarter..])])
        .filter(|[low, high]| *high > LEAST_GROWTH * low)
}

/// Variance that rounding to the steps adds to the samples of one point, DN^2.
pub(super) fn step_variance_dn2(counts: &Counts) -> f64 {
    let all = steps(counts);
    let samples: f64 = all.iter().map(|step| step.samples).sum();
    let squares: f64 = all.iter().map(|step| step.samples * step.step_dn.powi(2)).sum();
    if samples > 0.0 { squares / samples / 12.0 } else { 0.0 }
}

/// Share of the samples below, and above, those between which numbers are near the level.
const TAIL: f64 = 0.05;

/// Distance of the numbers near the level of these samples, DN: the root mean square of the certain steps there, of which each counts as its rarer
/// number does. 1 where the samples show none.
pub(super) fn level_step_dn(counts: &Counts) -> f64 {
    let (low, high) = (f64::from(counts.quantile_dn(TAIL)), f64::from(counts.quantile_dn(1.0 - TAIL)));
    let is_near = |step: &Step| {
        let at_dn = f64::from(step.at_dn);
        at_dn <= high && at_dn + step.step_dn >= low
    };
    let near: Vec<Step> = steps(counts).into_iter().filter(is_near).collect();
    // Next to little noise, a gap may be that between dead pixels and the others.
    let least = near.iter().map(|step| step.step_dn).fold(f64::INFINITY, f64::min);
    let of_converter = || near.iter().filter(|step| step.step_dn <= 2.0 * least);
    let weight: f64 = of_converter().map(|step| step.fewest).sum();
    let squares: f64 = of_converter().map(|step| step.fewest * step.step_dn.powi(2)).sum();
    if weight > 0.0 { (squares / weight).sqrt() } else { 1.0 }
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

    #[test]
    fn the_step_at_a_level_is_that_of_the_numbers_there() {
        let of = |numbers: &[(usize, u64)]| level_step_dn(&at(numbers.iter().copied()));
        // A table of square roots at the black level, with hot pixels above.
        let step = of(&[(57, 30), (61, 6000), (64, 30_000), (69, 2400), (73, 2), (900, 1)]);
        assert!((3.0..4.2).contains(&step), "{step}");
        assert_eq!(of(&[(62, 300), (63, 9000), (64, 20_000), (65, 9000), (66, 300), (200, 1)]), 1.0);
        // Dead pixels far below, noise of one number, and samples of one number alone.
        assert_eq!(of(&[(8, 600), (63, 200), (64, 20_000), (65, 200)]), 1.0);
        assert_eq!(of(&[(64, 20_000), (65, 3)]), 1.0);
        assert_eq!(of(&[(64, 20_000)]), 1.0);
        // Left-aligned frames.
        assert_eq!(of(&[(1008, 5000), (1024, 20_000), (1040, 5000)]), 16.0);
    }
}
