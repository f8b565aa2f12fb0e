//! Properties of the converter from all digital numbers: where it clips, and whether the stated `bits` are right.

use super::captures::Kind;
use super::clamp::{CLIPPED_SHARE, PILE_SIGMAS};
use super::counts::Counts;
use super::point::Moments;

/// Different digital numbers that a series must have: fewer may have a common factor by chance.
const FACTOR_NUMBERS: usize = 8;

/// How often samples must step over the numbers that a stuck bit leaves out: once if these are many, that is from this bit on, else this often.
const WIDE_BIT: u32 = 4;
const NARROW_STEPS: usize = 4;

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

    /// The different numbers, ascending, unless they are few. The top of the range is left out: clipped samples may be set to it whatever the
    /// others are.
    fn numbers(&self, max_dn: u32) -> Option<Vec<u32>> {
        let numbers = self.all.counts.iter().zip(self.all.first_dn..).filter(|(count, _)| **count > 0);
        let inside: Vec<u32> = numbers.map(|(_, dn)| dn).filter(|dn| *dn < max_dn).collect();
        (inside.len() >= FACTOR_NUMBERS).then_some(inside)
    }

    /// The highest bit that is the same in all samples while higher ones change. Zeros at the low end are those of left-aligned frames, and
    /// do not count.
    ///
    /// Frames of few levels may lack a bit by chance. So the samples must step over the numbers with the other bit without a gap: from the
    /// last number before them to the first one after them.
    pub fn stuck_bit(&self, max_dn: u32) -> Option<StuckBit> {
        let numbers = self.numbers(max_dn)?;
        let (any, all) = numbers.iter().fold((0, u32::MAX), |(any, all), dn| (any | dn, all & dn));
        let changes = any & !all;
        let constant = !changes & ((1 << changes.ilog2()) - 1);
        // The next number with the same constant bits.
        let next = |dn: u32| (((dn | constant) + 1) & !constant) | (dn & constant);
        let is_stuck = |bit: &u32| {
            let steps_over = |pair: &&[u32]| pair[1] == next(pair[0]) && (pair[0] >> bit) != (pair[1] >> bit);
            numbers.windows(2).filter(steps_over).count() >= if *bit < WIDE_BIT { NARROW_STEPS } else { 1 }
        };
        let mut bits = (any.trailing_zeros()..u32::BITS).rev().filter(|bit| (constant >> bit) & 1 == 1);
        bits.find(is_stuck).map(|bit| StuckBit { bit, is_one: (all >> bit) & 1 == 1 })
    }

    /// Flags about the bits of the converter. Frames of fewer bits than stated end at a quarter of the range or below,
    /// or pile up below its end; left-aligned ones are multiples of a power of two.
    pub fn flags(&self, max_dn: u32) -> ConverterFlags {
        let factor =
            self.numbers(max_dn).map_or(1, |numbers| numbers.into_iter().fold(0, greatest_common_divisor));
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

/// A bit of the converter that never changes, although higher bits do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StuckBit {
    /// Its place; 0 is the lowest.
    pub bit: u32,
    /// What it is.
    pub is_one: bool,
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

    #[test]
    fn a_stuck_bit_is_found_and_levels_that_lack_a_bit_by_chance_are_none() {
        let of = |numbers: &mut dyn Iterator<Item = u32>| {
            let mut samples = Samples::default();
            let mut table = vec![0; 4096];
            numbers.for_each(|dn| table[dn as usize] += 1);
            samples.all = Counts::of(&table);
            samples.stuck_bit(4095)
        };
        assert_eq!(of(&mut (60..4096)), None);
        for bit in 0..11 {
            let mask = 1 << bit;
            assert_eq!(of(&mut (60..4096).map(|dn| dn | mask)), Some(StuckBit { bit, is_one: true }));
            // With clipped samples that another stage has set.
            let zeros = (60..4096).map(|dn| dn & !mask).chain([4095]);
            let wanted = if bit == 0 { None } else { Some(StuckBit { bit, is_one: false }) };
            assert_eq!(of(&mut zeros.into_iter()), wanted, "{bit}");
        }
        // Two of them; the higher one is named. Left-aligned frames; a gain after the converter.
        let two = of(&mut (60..4096).map(|dn| dn & !0x88));
        assert_eq!(two, Some(StuckBit { bit: 7, is_one: false }));
        assert_eq!(of(&mut (60..1024).map(|dn| dn << 2)), None);
        assert_eq!(of(&mut (60..1024).map(|dn| dn * 3)), None);
        // Dark frames and four levels, none of which has bit 9.
        let levels = [64, 1100, 2100, 3100_u32];
        assert_eq!(of(&mut levels.into_iter().flat_map(|level| level - 20..level + 20)), None);
        // Few numbers, all of them odd.
        assert_eq!(of(&mut [61, 65, 71, 77].into_iter()), None);
    }
}
