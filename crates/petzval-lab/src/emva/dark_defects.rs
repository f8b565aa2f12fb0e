//! Pixels that answer neither light nor exposure time, which the dark series of a gain leaves out.
//!
//! Ten of 32,000 pixels that are stuck at 4095 raise the mean of dark frames by 1.26 DN, and the black level with it. A flat and a dark point of
//! one exposure time show them ([`super::defects`]): the stacks, or where there are none the pairs of medium light. A hot pixel that is full
//! in the dark point answers no light there, but its signal grows from the shortest to the longest dark exposure: it stays in.

use super::captures::{Kind, Point};
use super::defects::defects;
use super::high_pass::Plane;
use super::point::{PointStatistics, Stack};
use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};
use petzval_camera::sensor::CfaPattern;

/// Standard deviations of the ordinary pixels beyond which the growth of a dark signal is that of a hot pixel.
const GROWTH_SIGMAS: f64 = 6.0;

/// Least standard deviation of that growth, DN: two numbers that are both rounded.
const LEAST_GROWTH_DN: f64 = 0.41;

/// A flat and a dark point of one exposure time that show which pixels answer light: stacks, or else the pair in the middle of the flat ones.
pub fn flat_and_dark<'a>(points: &[&'a Point]) -> Option<[&'a Point; 2]> {
    let with_dark = |flat: &'a Point| {
        let darks = points.iter().copied().filter(|p| p.kind == Kind::Dark);
        let of_time = darks.filter(|dark| dark.has_time_of(flat));
        Some([flat, of_time.max_by_key(|dark| dark.frames.len())?])
    };
    let flats = points.iter().copied().filter(|p| p.kind == Kind::Flat);
    let mut pairs: Vec<[&Point; 2]> = flats.filter_map(with_dark).collect();
    if let Some(stacks) = pairs.iter().find(|pair| pair.iter().all(|point| point.is_stack())) {
        return Some(*stacks);
    }
    let light = |point: &Point| point.photons.unwrap_or(point.exposure_s);
    pairs.sort_by(|[a, _], [b, _]| light(a).total_cmp(&light(b)));
    pairs.get(pairs.len() / 2).copied()
}

/// Places in the frame of the pixels that answer no light, ascending, without those whose dark signal grows as that of hot pixels does between
/// the ends of the dark series.
pub fn dark_defects(
    [flat, dark]: [&PointStatistics; 2],
    ends: [Option<&PointStatistics>; 2],
    cfa: &CfaPattern,
) -> Vec<usize> {
    let (Some(flat), Some(dark)) = (&flat.stack, &dark.stack) else { return Vec::new() };
    let mut found = Vec::new();
    for (row, column) in (0..cfa.rows()).flat_map(|row| (0..cfa.cols()).map(move |column| (row, column))) {
        let [light, unlit] = [flat, dark].map(|stack| plane(stack, cfa, row, column));
        if light.values.is_empty() {
            continue;
        }
        let place = |at: usize| {
            (row + at / light.width * cfa.rows()) * flat.width + column + at % light.width * cfa.cols()
        };
        found.extend(defects(&light, &unlit).into_iter().map(place));
    }
    found.sort_unstable();
    let [Some(short), Some(long)] = ends.map(|end| end.and_then(|end| end.stack.as_ref())) else {
        return found;
    };
    let growth = |i: usize| mean_dn(long, i) - mean_dn(short, i);
    let middle = median((0..short.sum_dn.len()).map(growth));
    let spread = SIGMA_OVER_MEDIAN * median((0..short.sum_dn.len()).map(|i| (growth(i) - middle).abs()));
    let limit = middle + GROWTH_SIGMAS * spread.max(LEAST_GROWTH_DN);
    found.retain(|i| growth(*i) <= limit);
    found
}

/// The mean of a pixel over the frames, DN.
fn mean_dn(stack: &Stack, i: usize) -> f64 {
    f64::from(stack.sum_dn[i]) / stack.frames as f64
}

/// The mean frame at one place of the tile.
pub(super) fn plane(stack: &Stack, cfa: &CfaPattern, row: usize, column: usize) -> Plane {
    let rows = (row..stack.height).step_by(cfa.rows());
    let columns = (column..stack.width).step_by(cfa.cols());
    let (height, width) = (rows.len(), columns.len());
    let values = rows.flat_map(|r| columns.clone().map(move |c| mean_dn(stack, r * stack.width + c)));
    Plane { height, width, values: values.collect() }
}
