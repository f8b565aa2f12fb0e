//! Properties of the converter from all digital numbers: where it clips, and whether the stated `bits` are right.

use super::captures::Kind;
use super::counts::Counts;
use super::point::{CLIPPED_SHARE, Moments};

/// Standard deviations by which the last count of a histogram must exceed the one before to be a pile-up.
const PILE_SIGMAS: f64 = 5.0;

/// Different digital numbers that a series must have: fewer may have a common factor by chance.
const FACTOR_NUMBERS: usize = 8;

/// Digital number at which samples are clipped: the largest of the stated bits, or the largest of all flat frames if samples pile
/// up there. The fits need not know whether the converter or the pixel ends there: clipped samples have lost their
/// noise either way.
pub fn clip_dn<'a>(flats: impl Iterator<Item = &'a Moments> + Clone, max_dn: u32) -> u32 {
    let Some(largest) = flats.clone().map(|m| m.histogram.last_dn()).max() else { return max_dn };
    let mut at_end = flats.filter(|m| m.histogram.last_dn() == largest && m.reaches(largest));
    if at_end.any(|m| piles_up(&m.histogram)) { largest } else { max_dn }
}

/// Whether samples pile up at the largest number. Counts of light with noise fall towards their end; clipping adds all
/// samples beyond the end to the last count.
fn piles_up(histogram: &Counts) -> bool {
    let mut from_end = histogram.counts.iter().rev().filter(|c| **c > 0).map(|c| *c as f64);
    let (Some(last), Some(before)) = (from_end.next(), from_end.next()) else { return false };
    last > CLIPPED_SHARE * histogram.total() as f64 && last - before > PILE_SIGMAS * (last + before).sqrt()
}

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

/// All samples of a series.
#[derive(Debug, Default)]
pub struct Samples {
    all: Counts,
    has_flats: bool,
    piled: bool,
}

impl Samples {
    /// Adds the samples of a point.
    pub fn add(&mut self, kind: Kind, moments: &Moments) {
        self.all = self.all.merge(&moments.histogram);
        self.has_flats |= kind == Kind::Flat;
    }

    /// Notes that samples are clipped at a number. If it is the largest number of fewer bits (left-aligned or not), the converter
    /// has fewer bits than stated; at any other number the pixels are full.
    pub fn clips_at(&mut self, clip_dn: u32, max_dn: u32) {
        let odd = clip_dn >> clip_dn.trailing_zeros().min(31);
        self.piled |= clip_dn < max_dn && odd.count_ones() == u32::BITS - odd.leading_zeros();
    }

    /// Flags about the bits of the converter. Frames of fewer bits than stated end at a quarter of the range or below,
    /// or pile up below its end; left-aligned ones are multiples of a power of two.
    pub fn flags(&self, max_dn: u32) -> ConverterFlags {
        let numbers = self.all.counts.iter().enumerate().filter(|(_, count)| **count > 0);
        // The top of the range need not be a multiple: clipped samples may be set to it.
        let inside = || numbers.clone().map(|(i, _)| self.all.first_dn + i as u32).filter(|dn| *dn < max_dn);
        let factor = match inside().count() {
            few if few < FACTOR_NUMBERS => 1,
            _ => inside().fold(0, greatest_common_divisor),
        };
        let largest_dn = self.all.last_dn();
        let quarter = largest_dn < max_dn / 4;
        let top_is_open = self.has_flats && largest_dn + factor <= max_dn && (self.piled || quarter);
        ConverterFlags {
            max_dn,
            common_factor: (factor > 1).then_some(factor),
            top_not_reached: top_is_open.then_some(TopNotReached { largest_dn, piled: self.piled }),
        }
    }
}

/// Flags of the converter from all samples of a series. A flag that is set holds its evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConverterFlags {
    /// Largest digital number of the stated bits.
    pub max_dn: u32,
    /// Every sample is a multiple of this number.
    pub common_factor: Option<u32>,
    /// No sample comes near the largest digital number, or samples pile up below it.
    pub top_not_reached: Option<TopNotReached>,
}

/// Where the samples end below the largest digital number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TopNotReached {
    /// Largest sample, DN.
    pub largest_dn: u32,
    /// Whether samples pile up there.
    pub piled: bool,
}

/// The largest number that divides both.
pub(super) fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(first_dn: u32, counts: &[u64]) -> Counts {
        Counts { first_dn, counts: counts.to_vec() }
    }

    #[test]
    fn a_pile_up_is_distinguished_from_a_tail() {
        assert!(!piles_up(&counts(100, &[10, 100, 1000, 100, 10, 2, 1])));
        // One or two samples far out are not a pile-up.
        assert!(!piles_up(&counts(100, &[10, 100, 1000, 100, 10, 1, 0, 0, 2])));
        assert!(!piles_up(&counts(100, &[90])));
        assert!(piles_up(&counts(100, &[10, 100, 1000, 3000])));
        // Left-aligned samples pile up across gaps.
        assert!(piles_up(&counts(96, &[100, 0, 0, 0, 500, 0, 0, 0, 2000])));
        assert!(!piles_up(&counts(96, &[100, 0, 0, 0, 500, 0, 0, 0, 20])));
    }

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
