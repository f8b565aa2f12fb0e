//! Pixels that pile up at the largest digital numbers of a frame: they are saturated, whatever its white level is said to be.
//!
//! Where the converter ends they have one number. Where the pixels are full they scatter by a few, since full wells differ and are read with noise.
//! A scene makes no such peak: its noise grows with the light, and its colours differ as they do below.

use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};
use petzval_camera::sensor::CfaPattern;

/// Fewest pixels of a pile, and their least share of the frame.
const LEAST_PIXELS: usize = 20;
const LEAST_SHARE: f64 = 1e-4;

/// How many times as many pixels a pile has as the mean of the numbers just below it, and how far below, as a share of the number.
const HIGHER: f64 = 8.0;
const BELOW: f64 = 0.03;

/// Numbers below the largest that have fewer pixels than it, if the pile is that of one number.
const NEAR: u32 = 8;

/// Widest pile, as standard deviation over its number. The shot noise of 60,000 electrons is wider.
const WIDEST: f64 = 0.004;

/// Widest peak that may be a pile, in the same measure: full wells that scatter by a few per cent, or much noise.
const WIDEST_DOUBTFUL: f64 = 0.04;

/// Distance of the middles of two colours of a doubtful pile below which they have one middle, in its standard deviations and in DN.
const SAME_MIDDLE: f64 = 0.5;
const SAME_MIDDLE_DN: f64 = 1.0;

/// Standard deviations about the middle of a pile within which its pixels lie, and those below it at which pixels count as saturated.
const REACH: f64 = 4.0;
const SATURATED: f64 = 2.0;

/// Rounds in which the middle and the spread of a pile are found.
const ROUNDS: usize = 12;

/// How many times as many pixels a pile that spreads has as the numbers below it have on as many numbers.
const DENSER: f64 = 4.0;

/// Difference of two colours below the pile, as a share, from which it is no chance that both pile up at one number.
const COLOURS_DIFFER: f64 = 0.05;

/// Levels below the pile, as shares of it, at which its noise is compared with that of neighbours; the least share of all pixels of one that counts,
/// and the least number of those that count.
const LEVELS: [f64; 7] = [0.2, 0.3, 0.4, 0.5, 0.6, 0.75, 0.9];
const LEAST_OF_LEVEL: f64 = 0.02;
const LEAST_LEVELS: usize = 2;

/// Largest ratio of variances over their levels among those: shot noise is in proportion to the light, and texture is not.
const EVEN_NOISE: f64 = 2.0;

/// Noise of a pile over the shot noise that lower levels let expect, below which it has none.
const NO_SHOT_NOISE: f64 = 0.5;

/// Share of a white level below which a pile contradicts it.
const LOW_PILE: f64 = 0.995;

/// A pile at the largest numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pile {
    /// The number from which on pixels count as saturated, DN.
    pub dn: u32,
    /// Pixels that have it, or more.
    pub pixels: usize,
    /// Whether the pixels have that one number.
    pub is_one_number: bool,
}

/// The pile of pixels at the largest numbers of a linear mosaic, where it lies below the white level and contradicts it. `None` otherwise.
pub fn pile_below(dn: &[u32], width: usize, cfa: CfaPattern, white_dn: f64) -> Option<Pile> {
    pile_up(dn, width, cfa).filter(|pile| f64::from(pile.dn) < LOW_PILE * white_dn)
}

/// Pixels of all colours that end near one number, from about its lower end on, below `white_dn`. `None` otherwise, and for a frame without noise.
///
/// They may be saturated: full wells that scatter, or noise, hide a pile. They may be light as well: a bright surface that every colour answers
/// alike has such a peak, too.
pub fn doubtful_pile(dn: &[u32], width: usize, cfa: CfaPattern, white_dn: f64) -> Option<Pile> {
    let largest = *dn.iter().max()?;
    let peak = Spread::of(dn, WIDEST_DOUBTFUL)?;
    let is_below = peak.middle + SATURATED * peak.sigma < LOW_PILE * white_dn;
    let is_doubtful = is_below && is_noisy(dn, width, cfa, largest) && peak.is_of_all_colours(dn, width, cfa);
    is_doubtful.then(|| peak.counted(dn))
}

/// The pile of pixels at the largest numbers of a mosaic. `None` if they are few, or no more than at other numbers. `None` as well if the
/// frame has no noise: then equal numbers are equal light.
fn pile_up(dn: &[u32], width: usize, cfa: CfaPattern) -> Option<Pile> {
    let largest = *dn.iter().max()?;
    if !is_noisy(dn, width, cfa, largest) {
        return None;
    }
    let one = at_largest(dn, largest);
    let near = dn.iter().filter(|v| **v < largest && largest - **v <= NEAR).count();
    if one.is_some_and(|pile| near < pile.pixels) {
        return one;
    }
    Spread::of(dn, WIDEST).and_then(|peak| peak.pile(dn, width, cfa)).or(one)
}

/// The fewest pixels of a pile.
fn least_pixels(dn: &[u32]) -> usize {
    LEAST_PIXELS.max((LEAST_SHARE * dn.len() as f64) as usize)
}

/// The pile of pixels that have the largest number.
fn at_largest(dn: &[u32], largest: u32) -> Option<Pile> {
    let pixels = dn.iter().filter(|v| **v == largest).count();
    let below = ((BELOW * f64::from(largest)) as u32).max(1);
    let near = dn.iter().filter(|v| **v < largest && largest - **v <= below).count();
    let is_pile =
        pixels >= least_pixels(dn) && pixels as f64 > HIGHER * (near as f64 / f64::from(below)).max(1.0);
    is_pile.then_some(Pile { dn: largest, pixels, is_one_number: true })
}

/// The noise of a peak beside that of lower levels.
struct PeakNoise {
    /// Its noise over the least shot noise that a lower level lets expect.
    ratio: f64,
    /// Whether several levels agree, as those of light do.
    is_even: bool,
}

/// A peak at the upper end of the numbers, DN.
struct Spread {
    middle: f64,
    sigma: f64,
}

impl Spread {
    /// The peak at the upper end, without the few brightest pixels, if it is higher than what lies below it and no wider than
    /// `widest`, the standard deviation over the number.
    fn of(dn: &[u32], widest: f64) -> Option<Self> {
        let mut sorted: Vec<u32> = dn.to_vec();
        sorted.sort_unstable();
        let least = least_pixels(dn);
        let top = f64::from(*sorted.get(sorted.len().checked_sub(least)?)?);
        let from = |low: f64| &sorted[sorted.partition_point(|v| f64::from(*v) < low)..];
        // Widen a window from the top down until it holds a peak.
        let (mut middle, mut sigma) = (top, widest * top);
        for _ in 0..ROUNDS {
            let (low, high) = (middle - REACH * sigma, middle + REACH * sigma);
            let inside = || from(low).iter().map(|v| f64::from(*v)).filter(|v| *v <= high.max(top));
            middle = median(inside());
            sigma = (SIGMA_OVER_MEDIAN * median(inside().map(|v| (v - middle).abs()))).max(0.5);
            if sigma > widest * middle {
                return None;
            }
        }
        let low = middle - REACH * sigma;
        let below = (BELOW * middle).max(2.0 * REACH * sigma);
        let (pixels, near) = (from(low).len(), from(low - below).len() - from(low).len());
        let expected = near as f64 / below * 2.0 * REACH * sigma;
        (pixels >= least && pixels as f64 > DENSER * expected).then_some(Self { middle, sigma })
    }

    fn low(&self) -> f64 {
        self.middle - REACH * self.sigma
    }

    fn holds(&self, dn: u32) -> bool {
        (f64::from(dn) - self.middle).abs() <= REACH * self.sigma
    }

    /// The pile, if no scene makes this peak.
    fn pile(&self, dn: &[u32], width: usize, cfa: CfaPattern) -> Option<Pile> {
        // A white wall has one number in colours that differ elsewhere, and the noise of its light.
        let noise = self.noise_over_shot_noise(dn, width, cfa);
        let is_quiet = noise.as_ref().is_none_or(|noise| noise.ratio < NO_SHOT_NOISE);
        let is_sure = noise.as_ref().is_some_and(|noise| noise.is_even);
        let is_pile = is_quiet && (is_sure || self.is_of_colours(&self.colours(dn, width, cfa)));
        is_pile.then(|| self.counted(dn))
    }

    /// The pixels from the lower end of the peak on.
    fn counted(&self, dn: &[u32]) -> Pile {
        let from = (self.middle - SATURATED * self.sigma).round() as u32;
        let pixels = dn.iter().filter(|v| **v >= from).count();
        Pile { dn: from, pixels, is_one_number: false }
    }

    /// Of each colour that lies in the peak and below it: its median inside and its mean below, DN.
    fn colours(&self, dn: &[u32], width: usize, cfa: CfaPattern) -> Vec<(f64, f64)> {
        let of_colour = |colour| {
            let own = dn.iter().enumerate().filter(move |(i, _)| cfa.colour(i / width, i % width) == colour);
            let (mut inside, mut below) = (Vec::new(), Vec::new());
            for (_, v) in own {
                if self.holds(*v) {
                    inside.push(f64::from(*v));
                } else if f64::from(*v) < self.low() {
                    below.push(f64::from(*v));
                }
            }
            let mean = below.iter().sum::<f64>() / below.len().max(1) as f64;
            let is_in = inside.len() >= LEAST_PIXELS && below.len() >= LEAST_PIXELS;
            is_in.then(|| (median(inside), mean))
        };
        cfa.colours().into_iter().filter_map(of_colour).collect()
    }

    /// Whether two colours that differ below the peak both lie in it.
    fn is_of_colours(&self, all: &[(f64, f64)]) -> bool {
        all.iter().enumerate().any(|(i, (at, below))| {
            all[..i].iter().any(|(other_at, other_below)| {
                let is_other = (below - other_below).abs() > COLOURS_DIFFER * below.max(*other_below);
                is_other && (at - other_at).abs() < self.sigma
            })
        })
    }

    /// Whether every colour lies in the peak with the same middle, though two of them differ below it.
    fn is_of_all_colours(&self, dn: &[u32], width: usize, cfa: CfaPattern) -> bool {
        let all = self.colours(dn, width, cfa);
        let near = (SAME_MIDDLE * self.sigma).max(SAME_MIDDLE_DN);
        let is_same = |(at, _): &(f64, f64)| all.iter().all(|(other, _)| (at - other).abs() < near);
        all.len() == cfa.colours().len() && all.iter().all(is_same) && self.is_of_colours(&all)
    }

    /// By how much neighbours in the peak differ, over the shot noise that lower levels let expect there; none where there are none.
    fn noise_over_shot_noise(&self, dn: &[u32], width: usize, cfa: CfaPattern) -> Option<PeakNoise> {
        let mut levels = vec![Vec::new(); LEVELS.len() - 1];
        let mut inside = Vec::new();
        for line in dn.chunks_exact(width) {
            for (a, b) in line.iter().zip(line.iter().skip(cfa.cols())) {
                let (difference, mean) = (f64::from(a.abs_diff(*b)), 0.5 * f64::from(a + b));
                if self.holds(*a) && self.holds(*b) {
                    inside.push(difference);
                    continue;
                }
                let share = mean / self.middle;
                if let Some(level) = LEVELS.windows(2).position(|pair| (pair[0]..pair[1]).contains(&share)) {
                    levels[level].push(difference);
                }
            }
        }
        let least = (LEAST_OF_LEVEL * dn.len() as f64).max(1.0) as usize;
        let middles = LEVELS.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        let known: Vec<(f64, f64)> = middles
            .zip(levels)
            .filter(|(_, differences)| differences.len() >= least)
            .map(|(share, differences)| (share, median(differences)))
            .collect();
        if inside.len() < LEAST_PIXELS || known.is_empty() {
            return None;
        }
        // Shot noise is in proportion to the root of the light: continue that of each level to the peak.
        let in_peak = || known.iter().map(|(share, noise)| noise / share.sqrt());
        let (low, high) = (in_peak().fold(f64::INFINITY, f64::min), in_peak().fold(0.0, f64::max));
        let is_even = known.len() >= LEAST_LEVELS && high * high <= EVEN_NOISE * low * low;
        (low > 0.0).then(|| PeakNoise { ratio: median(inside) / low, is_even })
    }
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
        assert_eq!(
            pile_up(&cut, 200, CfaPattern::RGGB),
            Some(Pile { dn: 3800, pixels, is_one_number: true })
        );
        assert_eq!(pile_up(&ramp(u32::MAX, 15), 200, CfaPattern::RGGB), None);
        // Without noise equal numbers are equal light.
        let flat: Vec<u32> = (0..24_000).map(|i| if i % 200 < 100 { 2000 } else { 3800 }).collect();
        assert_eq!(pile_up(&flat, 200, CfaPattern::RGGB), None);
        assert_eq!(pile_up(&[], 200, CfaPattern::RGGB), None);
    }

    const WIDTH: usize = 128;
    const SIZE: usize = 96 * WIDTH;

    /// Numbers between 0 and 1, and nearly normal ones.
    struct Random(u64);

    impl Random {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }

        fn normal(&mut self) -> f64 {
            (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
        }
    }

    /// A frame of 0.4 DN an electron and a black level of 64 DN. `light` is the digital number of green above it, `answers` those of the colours.
    fn frame(
        answers: [f64; 3],
        full: impl Fn(&mut Random) -> f64,
        light: impl Fn(usize, usize) -> f64,
    ) -> Vec<u32> {
        let mut random = Random(5);
        let pixel = |i: usize| {
            let (row, column) = (i / WIDTH, i % WIDTH);
            let signal = light(row, column) * answers[[[0, 1], [1, 2]][row % 2][column % 2]];
            let noisy = 64.0 + signal + (0.4 * signal + 4.0).sqrt() * random.normal();
            noisy.min(full(&mut random)).round().clamp(0.0, 4095.0) as u32
        };
        (0..SIZE).map(pixel).collect()
    }

    const ANSWERS: [f64; 3] = [0.5, 1.0, 0.7];

    #[test]
    fn full_wells_that_spread_are_a_pile() {
        for sigma in [0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0] {
            let full = |random: &mut Random| 3000.0 + sigma * random.normal();
            // All colours are full on the left, and green alone at the end of a ramp.
            let halves = frame(ANSWERS, full, |_, column| if column < 64 { 8000.0 } else { 940.0 });
            let ramp = frame([0.3, 1.0, 0.4], full, |row, _| 4500.0 * row as f64 / 96.0);
            for (name, dn) in [("halves", halves), ("ramp", ramp)] {
                let found = pile_up(&dn, WIDTH, CfaPattern::RGGB).unwrap_or_else(|| panic!("{name} {sigma}"));
                let low = 3000.0 - 3.5 * sigma - 1.0;
                assert!((low..=3000.0).contains(&f64::from(found.dn)), "{name} {sigma}: {found:?}");
            }
        }
    }

    #[test]
    fn full_wells_that_scatter_widely_are_a_doubtful_pile() {
        for sigma in [20.0, 30.0, 90.0] {
            let full = |random: &mut Random| 3000.0 + sigma * random.normal();
            let dn = frame(ANSWERS, full, |_, column| if column < 64 { 8000.0 } else { 940.0 });
            assert_eq!(pile_up(&dn, WIDTH, CfaPattern::RGGB), None, "{sigma}");
            let found = doubtful_pile(&dn, WIDTH, CfaPattern::RGGB, 4095.0);
            let found = found.unwrap_or_else(|| panic!("{sigma}"));
            assert!((3000.0 - 2.5 * sigma..3000.0).contains(&f64::from(found.dn)), "{sigma}: {found:?}");
            // A white level that cuts them says all.
            for white_dn in [f64::from(found.dn), 3000.0] {
                assert_eq!(
                    doubtful_pile(&dn, WIDTH, CfaPattern::RGGB, white_dn),
                    None,
                    "{sigma}: {white_dn}"
                );
            }
        }
        assert_eq!(doubtful_pile(&[], WIDTH, CfaPattern::RGGB, 4095.0), None);
    }

    #[test]
    fn bright_scenes_and_speculars_are_no_pile() {
        let none = |_: &mut Random| f64::INFINITY;
        let spot = |row: usize, column: usize| (40..42).contains(&row) && (60..64).contains(&column);
        type Light<'a> = &'a dyn Fn(usize, usize) -> f64;
        let scenes: [(&str, Light); 5] = [
            ("wall", &|_, column| if column < 64 { 2800.0 } else { 540.0 }),
            ("sky", &|row, column| {
                if row < 60 { 2900.0 - 3.0 * row as f64 } else { 300.0 + 400.0 * ((row * column) % 5) as f64 }
            }),
            ("page", &|row, column| if row % 9 < 2 && column % 5 < 3 { 300.0 } else { 2700.0 }),
            ("ramp", &|_, column| 3000.0 * column as f64 / 128.0),
            ("specular", &|row, column| {
                if spot(row, column) { 9000.0 } else { 500.0 + 10.0 * column as f64 }
            }),
        ];
        for (name, light) in scenes {
            for answers in [ANSWERS, [1.0; 3]] {
                let dn = frame(answers, none, light);
                assert_eq!(pile_up(&dn, WIDTH, CfaPattern::RGGB), None, "{name} {answers:?}");
                let doubtful = doubtful_pile(&dn, WIDTH, CfaPattern::RGGB, 4095.0);
                assert_eq!(doubtful, None, "{name} {answers:?}");
            }
        }
        // A white wall, on which the colours answer alike, in front of a ground on which they do not.
        let white = |row: usize, column: usize| match column {
            ..64 => 2800.0 / ANSWERS[[[0, 1], [1, 2]][row % 2][column % 2]],
            _ => 540.0,
        };
        assert_eq!(pile_up(&frame(ANSWERS, none, white), WIDTH, CfaPattern::RGGB), None, "white wall");
        // Noise of two numbers whatever the light, as pictures of a program have it: an edge, and equal answers of all colours.
        let mut random = Random(7);
        for answers in [ANSWERS, [1.0; 3]] {
            let pixel = |i: usize| {
                let (row, column) = (i / WIDTH, i % WIDTH);
                let light = if column < 64 { 2500.0 } else { 400.0 };
                (64.0 + light * answers[[[0, 1], [1, 2]][row % 2][column % 2]] + 2.0 * random.normal())
                    .round() as u32
            };
            let dn: Vec<u32> = (0..SIZE).map(pixel).collect();
            assert_eq!(pile_up(&dn, WIDTH, CfaPattern::RGGB), None, "{answers:?}");
        }
    }
}
