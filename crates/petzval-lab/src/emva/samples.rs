//! Properties of the converter from all digital numbers: where it clips, and whether the stated `bits` are right.

use super::captures::Kind;
use super::clamp::{CLIPPED_SHARE, PILE_SIGMAS};
use super::counts::Counts;
use super::point::Moments;

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
}
