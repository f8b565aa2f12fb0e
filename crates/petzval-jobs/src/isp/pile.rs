//! Pixels that pile up at the largest digital number of a frame: they are saturated, whatever its white level is said to be.

use petzval_camera::sensor::CfaPattern;

/// Fewest pixels of a pile, and their least share of the frame.
const LEAST_PIXELS: usize = 20;
const LEAST_SHARE: f64 = 1e-4;

/// How many times as many pixels a pile has as the mean of the numbers just below it, and how far below, as a share of the number.
const HIGHER: f64 = 8.0;
const BELOW: f64 = 0.03;

/// A pile at the largest number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pile {
    /// The number, DN.
    pub dn: u32,
    /// Pixels that have it.
    pub pixels: usize,
}

/// The pile of pixels at the largest number of a mosaic. `None` if they are few, or no more than at other numbers. `None` as well if the
/// frame has no noise: then equal numbers are equal light.
pub fn pile_up(dn: &[u32], width: usize, cfa: CfaPattern) -> Option<Pile> {
    let largest = *dn.iter().max()?;
    let pixels = dn.iter().filter(|v| **v == largest).count();
    let least = LEAST_PIXELS.max((LEAST_SHARE * dn.len() as f64) as usize);
    let below = ((BELOW * f64::from(largest)) as u32).max(1);
    let near = dn.iter().filter(|v| **v < largest && largest - **v <= below).count();
    let is_pile = pixels >= least && pixels as f64 > HIGHER * (near as f64 / f64::from(below)).max(1.0);
    (is_pile && is_noisy(dn, width, cfa, largest)).then_some(Pile { dn: largest, pixels })
}

/// Whether neighbours of a colour differ where there is light: in half of the pairs at least.
fn is_noisy(dn: &[u32], width: usize, cfa: CfaPattern, largest: u32) -> bool {
    let (mut equal, mut all) = (0_usize, 0_usize);
    let is_light = |v: u32| v < largest && v > largest / 4;
    for line in dn.chunks_exact(width) {
        for (a, b) in line.iter().zip(line.iter().skip(cfa.cols())) {
            if is_light(*a) && is_light(*b) {
                equal += usize::from(a == b);
                all += 1;
            }
        }
    }
    all > 0 && 2 * equal < all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp with noise of a few numbers, whose bright end is cut off.
    fn ramp(cut: u32, noise: u32) -> Vec<u32> {
        let hash = |i: u32| (i.wrapping_mul(2_654_435_761) >> 16) % (2 * noise + 1);
        (0..120 * 200_u32).map(|i| (300 + 20 * (i % 200) + hash(i)).min(cut)).collect()
    }

    #[test]
    fn a_cut_off_end_is_a_pile_and_others_are_none() {
        let cut = ramp(3800, 15);
        let pixels = cut.iter().filter(|v| **v == 3800).count();
        assert_eq!(pile_up(&cut, 200, CfaPattern::RGGB), Some(Pile { dn: 3800, pixels }));
        assert_eq!(pile_up(&ramp(u32::MAX, 15), 200, CfaPattern::RGGB), None);
        // Without noise equal numbers are equal light.
        let flat: Vec<u32> = (0..24_000).map(|i| if i % 200 < 100 { 2000 } else { 3800 }).collect();
        assert_eq!(pile_up(&flat, 200, CfaPattern::RGGB), None);
        assert_eq!(pile_up(&[], 200, CfaPattern::RGGB), None);
    }
}
