//! Levels of dark frames by the place of a pixel in the tile of the colour filter array: some sensors add a black level of its own to each colour.

use super::dark_defects::plane;
use super::point::Stack;
use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};
use petzval_camera::sensor::CfaPattern;

/// Standard deviations from the median of a place beyond which a pixel does not count in its level.
const SIGMAS: f64 = 6.0;

/// Least range of the levels, in their standard errors and DN: less is a part of the non-uniformity.
const LEAST_ERRORS: f64 = 6.0;
const LEAST_DN: f64 = 0.5;

/// Level of each place of the tile, row by row, DN, if they differ.
pub fn tile_levels_dn(stack: &Stack, cfa: &CfaPattern) -> Option<Vec<f64>> {
    let places = (0..cfa.rows()).flat_map(|row| (0..cfa.cols()).map(move |column| (row, column)));
    let (levels, errors): (Vec<f64>, Vec<f64>) =
        places.map(|(row, column)| level_dn(&plane(stack, cfa, row, column).values)).unzip();
    let (low, high) = levels
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), dn| (low.min(*dn), high.max(*dn)));
    let error = errors.iter().copied().fold(0.0, f64::max);
    (high - low > LEAST_DN.max(LEAST_ERRORS * error)).then_some(levels)
}

/// Mean of the pixels that do not stand out, and its standard error, DN.
fn level_dn(values: &[f64]) -> (f64, f64) {
    let middle = median(values.iter().copied());
    let spread = SIGMA_OVER_MEDIAN * median(values.iter().map(|v| (v - middle).abs()));
    let limit = SIGMAS * spread.max(1.0 / SIGMAS);
    let kept: Vec<f64> = values.iter().copied().filter(|v| (v - middle).abs() <= limit).collect();
    let count = kept.len().max(1) as f64;
    let mean = kept.iter().sum::<f64>() / count;
    let variance = kept.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    (mean, (variance / count).sqrt())
}
