//! Dark frames whose noise is cut off from below: a camera sets what lies below a number to this number.

use super::counts::Counts;

/// Share of samples at an end of the range of numbers above which a point counts as clipped there.
pub const CLIPPED_SHARE: f64 = 1e-4;

/// Standard deviations by which the last count of a histogram must exceed the one before to be a pile-up.
pub(super) const PILE_SIGMAS: f64 = 5.0;

/// Standard deviations below the median within which the least number of dark frames counts as the end of their noise; those of dead pixels lie
/// further off.
const CLAMP_SIGMAS: f64 = 4.0;

/// Least number of samples that the noise must have below the least number which occurs.
const FEWEST_MISSING: f64 = 25.0;

/// Digital number at which the noise of dark frames is cut off from below, if it is: a camera sets what lies below to this number. `median` and
/// `high` are the numbers at the median and one standard deviation above it.
pub(super) fn clamp_dn(histogram: &Counts, [median, high]: [f64; 2]) -> Option<u32> {
    let from = median - CLAMP_SIGMAS * (high - median).max(1.0);
    let numbers = histogram.counts.iter().zip(histogram.first_dn..).filter(|(count, _)| **count > 0);
    let mut ends = numbers.filter(|(_, dn)| f64::from(*dn) >= from).map(|(count, dn)| (*count as f64, dn));
    let [(c0, dn), (c1, second), (c2, third), (c3, fourth)] =
        [ends.next()?, ends.next()?, ends.next()?, ends.next()?];
    // Left-aligned numbers lie apart.
    let step = second - dn;
    let is_even = third - second == step && fourth - third == step;
    let is_end = histogram.at(i64::from(dn) - i64::from(step)) == 0;
    // Noise within a number or two has no shape that could be cut: a few electrons of dark current end at none by themselves.
    let is_spread = high - median >= 2.0 * f64::from(step);
    if !is_even || !is_end || !is_spread || c0 <= CLIPPED_SHARE * histogram.total() as f64 {
        return None;
    }
    // Noise that spreads over several numbers does not have most samples at its end.
    let is_peak = c0 - c1 > PILE_SIGMAS * (c0 + c1).sqrt();
    (is_peak || is_cut_flank([c0, c1, c2, c3])).then_some(dn)
}

/// Whether the lower flank of a normal distribution is cut off at the first of four neighbouring counts. The logarithms of its counts lie on a
/// parabola: those of the other three give the first, and one below it.
fn is_cut_flank([c0, c1, c2, c3]: [f64; 4]) -> bool {
    let curvature = (c1 * c3 / (c2 * c2)).min(1.0);
    let expected = c1 * c1 / c2 * curvature;
    let below = expected * expected / c1 * curvature;
    let error = c0.sqrt().hypot(expected * (9.0 / c1 + 9.0 / c2 + 1.0 / c3).sqrt());
    c0 - expected > PILE_SIGMAS * error && below > FEWEST_MISSING
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts of `samples` of a normal distribution, cut off below a number, at every `step`-th number.
    fn normal(samples: f64, mean: f64, sigma: f64, clamp: i64, step: i64) -> Counts {
        let below = |dn: f64| 0.5 * libm::erfc((mean - dn) / (sigma * std::f64::consts::SQRT_2));
        let mut table = vec![0; 2048];
        for dn in 0..(table.len() as i64 / step) {
            let share = below(dn as f64 + 0.5) - below(dn as f64 - 0.5);
            table[(step * dn.max(clamp)) as usize] += (samples * share).round() as u64;
        }
        Counts::of(&table)
    }

    #[test]
    fn a_clamp_of_dark_frames_is_distinguished_from_the_end_of_their_noise() {
        let found = |counts: &Counts| {
            let [median, high] = [0.5, 0.841_345].map(|share| f64::from(counts.quantile_dn(share)));
            clamp_dn(counts, [median, high])
        };
        for step in [1, 16] {
            for sigma in [0.1, 0.3, 0.5, 0.8, 1.2, 2.0, 5.0, 12.0] {
                for mean in [100.0, 100.2, 100.5] {
                    for samples in [1e4, 4e4, 1e6, 5e7] {
                        let whole = normal(samples, mean, sigma, 0, step);
                        assert_eq!(found(&whole), None, "{step} {sigma} {mean} {samples}");
                    }
                }
            }
            let least = |dn: i64| Some((step * dn) as u32);
            for (sigma, clamp) in [(2.0, 97), (2.0, 98), (2.0, 100), (5.0, 94), (12.0, 90)] {
                let cut = normal(4e4, 100.2, sigma, clamp, step);
                assert_eq!(found(&cut), least(clamp), "{step} {sigma} {clamp}");
            }
        }
        // Half an electron of dark current at 1 DN/e- with little read noise has no numbers below that of no electron.
        let few_electrons = Counts { first_dn: 119, counts: vec![6065, 3033, 758, 126, 16, 2] };
        assert_eq!(found(&few_electrons), None);
        // Dead pixels below do not hide the clamp, and are none.
        let dead = Counts { first_dn: 0, counts: vec![300] };
        assert_eq!(found(&normal(4e4, 100.2, 2.0, 97, 1).merge(&dead)), Some(97));
        assert_eq!(found(&normal(4e4, 100.2, 2.0, 0, 1).merge(&dead)), None);
    }
}
