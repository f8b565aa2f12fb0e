//! Statistics of the digital numbers of a frame, for each colour.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::RawFrame;
use super::info::largest_dn;
use petzval_camera::sensor::{CfaPattern, Colour};

/// Digital numbers of all pixels of one colour.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ColourStatistics {
    /// The colour; all pixels are `Clear` if the frame's mosaic is not known.
    pub colour: Colour,
    /// Number of pixels.
    pub pixels: u64,
    /// Least digital number, DN.
    pub min_dn: u32,
    /// Largest digital number, DN.
    pub max_dn: u32,
    /// Mean, DN.
    pub mean_dn: f64,
    /// Standard deviation over the pixels, DN.
    pub sd_dn: f64,
    /// Pixels at 0, the lower limit of the converter.
    pub at_zero: u64,
    /// Pixels at or above the white level or the largest number of the converter; `None` if neither is known.
    pub saturated: Option<u64>,
}

/// Statistics of every colour of the frame's mosaic, in the order red, green, blue, clear.
pub fn colour_statistics<T: Copy + Into<u32>>(frame: &RawFrame<T>) -> Vec<ColourStatistics> {
    let cfa = frame.info.cfa.unwrap_or(CfaPattern::MONO);
    let converter = frame.info.bits.map(|bits| f64::from(largest_dn(bits)));
    // The levels of a companded frame are those of its expanded numbers.
    let compressed = |white: f64| match &frame.info.companding {
        Some(companding) => f64::from(companding.compress(white as u32)),
        None => white,
    };
    let white = match (frame.info.white_level_dn.map(compressed), converter) {
        (Some(white), Some(converter)) => Some(white.min(converter)),
        (white, converter) => white.or(converter),
    };
    let of = |colour: Colour| {
        let all = || {
            let is = move |(i, dn): (usize, &T)| {
                (cfa.colour(i / frame.width, i % frame.width) == colour).then_some((*dn).into())
            };
            frame.dn.iter().enumerate().filter_map(is)
        };
        // Sums of whole numbers below 2^24 over at most 2^28 pixels are exact in 64 bits, those of their squares in 128.
        let (mut pixels, mut sum, mut squares, mut at_zero, mut saturated) = (0u64, 0u64, 0u128, 0, 0);
        let (mut min_dn, mut max_dn) = (u32::MAX, 0);
        for dn in all() {
            let value = u64::from(dn);
            (pixels, sum, squares) = (pixels + 1, sum + value, squares + u128::from(value * value));
            (min_dn, max_dn) = (min_dn.min(dn), max_dn.max(dn));
            at_zero += u64::from(dn == 0);
            saturated += u64::from(white.is_some_and(|white| f64::from(dn) >= white));
        }
        let mean_dn = sum as f64 / pixels as f64;
        let spread = u128::from(pixels) * squares - u128::from(sum) * u128::from(sum);
        let sd_dn = (spread as f64).sqrt() / pixels as f64;
        let saturated = white.map(|_| saturated);
        let found = ColourStatistics { colour, pixels, min_dn, max_dn, mean_dn, sd_dn, at_zero, saturated };
        (pixels > 0).then_some(found)
    };
    cfa.colours().into_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::RawInfo;
    use super::*;

    #[test]
    fn each_colour_counts_its_own_pixels() {
        let info = RawInfo { bits: Some(12), cfa: Some(CfaPattern::RGGB), ..RawInfo::default() };
        let frame = RawFrame { height: 2, width: 4, dn: vec![1_u16, 10, 3, 30, 20, 4095, 40, 0], info };
        let all = colour_statistics(&frame);
        assert_eq!(
            all.iter().map(|s| s.colour).collect::<Vec<_>>(),
            [Colour::Red, Colour::Green, Colour::Blue]
        );
        let [red, green, blue] = all[..] else { panic!("three colours") };
        assert_eq!((red.pixels, red.min_dn, red.max_dn, red.mean_dn, red.sd_dn), (2, 1, 3, 2.0, 1.0));
        assert_eq!((green.mean_dn, green.sd_dn), (25.0, 125.0f64.sqrt()));
        assert_eq!((blue.at_zero, blue.saturated, green.saturated), (1, Some(1), Some(0)));
        let unknown = RawFrame { info: RawInfo::default(), ..frame };
        let [clear] = colour_statistics(&unknown)[..] else { panic!("one colour") };
        assert_eq!((clear.colour, clear.pixels, clear.saturated), (Colour::Clear, 8, None));
    }
}
