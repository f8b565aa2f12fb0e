//! Pixels that do not answer light: dead, stuck at one digital number, or full in the dark.
//!
//! Five of 240,000 pixels that are stuck at 4095 turn a dark signal non-uniformity of 1.5 e- into 45: the variance is then that of a few
//! pixels that are no part of the distribution. They are found by their answer to light, the flat stack less the dark one. A hot
//! pixel that answers light is none of them.

use schemars::JsonSchema;
use serde::Serialize;

use super::block_means::BLOCKS;
use super::high_pass::Plane;
use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

/// A pixel that does not answer light as others do.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Defect {
    /// Row of the frame, from 0.
    pub row: usize,
    /// Column of the frame, from 0.
    pub column: usize,
    /// Its mean in the flat stack, DN.
    pub flat_dn: f64,
    /// Its mean in the dark stack, DN.
    pub dark_dn: f64,
}

/// Deviation of an answer to light from that of the pixels around that makes a defect.
const ANSWER: f64 = 0.5;

/// Standard deviations of the ordinary pixels beyond which such a deviation is not noise.
const SIGMAS: f64 = 6.0;

/// Widest group of neighbouring pixels that is a defect, in its narrower direction: a cluster, or a few columns. What is wider both ways and filled is a
/// part of the picture without light, such as the corners beyond the image circle of a lens.
const WIDEST: usize = 8;

/// Side of the largest filled square of a group, as a share of its narrower extent, from which the group is filled: a corner has a half, a dead row that
/// meets a dead column next to nothing.
const FILLED: f64 = 0.25;

/// Light, as a share of the median of the picture, below which there is none.
const LEAST_LIGHT: f64 = 0.1;

/// Places of defect pixels: their response to light is below 0.5 or above 1.5 times the median of their block of the picture, and off it by
/// more than six standard deviations of all pixels. A wide and filled group of such pixels is no defect, and is left out.
pub fn defects(flat: &Plane, dark: &Plane) -> Vec<usize> {
    let answer: Vec<f64> = flat.values.iter().zip(&dark.values).map(|(f, d)| f - d).collect();
    let block_of = |i: usize| {
        let (row, column) = (i / flat.width, i % flat.width);
        row * BLOCKS / flat.height * BLOCKS + column * BLOCKS / flat.width
    };
    let mut blocks = vec![Vec::new(); BLOCKS * BLOCKS];
    for (i, a) in answer.iter().enumerate() {
        blocks[block_of(i)].push(*a);
    }
    let usual: Vec<f64> = blocks.into_iter().map(|b| if b.is_empty() { 0.0 } else { median(b) }).collect();
    let off = |i: usize| Some(usual[block_of(i)]).filter(|u| *u > 0.0).map(|u| answer[i] / u - 1.0);
    let known: Vec<f64> = (0..answer.len()).filter_map(off).map(f64::abs).collect();
    if known.is_empty() {
        return Vec::new();
    }
    let limit = ANSWER.max(SIGMAS * SIGMA_OVER_MEDIAN * median(known));
    let is_off: Vec<bool> = (0..answer.len()).map(|i| off(i).is_some_and(|off| off.abs() > limit)).collect();
    // Groups with the pixels that have no light: those around a dark corner are a part of it.
    let least = LEAST_LIGHT * median(answer.iter().copied());
    let is_marked: Vec<bool> = is_off.iter().zip(&answer).map(|(off, a)| *off || *a < least).collect();
    let sides = square_sides(&is_marked, flat.width);
    let narrow =
        groups(&is_marked, flat.width).into_iter().filter(|group| is_narrow(group, &sides, flat.width));
    let mut found: Vec<usize> = narrow.flatten().filter(|i| is_off[*i]).collect();
    found.sort_unstable();
    found
}

/// The groups of neighbours among the marked pixels.
fn groups(is_marked: &[bool], width: usize) -> Vec<Vec<usize>> {
    let (mut is_left, mut all) = (is_marked.to_vec(), Vec::new());
    for first in 0..is_marked.len() {
        if !is_left[first] {
            continue;
        }
        is_left[first] = false;
        let (mut group, mut next) = (vec![first], 0);
        while let Some(at) = group.get(next).copied() {
            next += 1;
            for near in square(at, 1, width, is_marked.len()) {
                if std::mem::take(&mut is_left[near]) {
                    group.push(near);
                }
            }
        }
        all.push(group);
    }
    all
}

/// For each pixel: the side of the largest square of marked pixels of which it is the last, lower right one.
fn square_sides(is_marked: &[bool], width: usize) -> Vec<usize> {
    let mut sides = vec![0; is_marked.len()];
    for (at, _) in is_marked.iter().enumerate().filter(|(_, marked)| **marked) {
        let is_inside = at >= width && at % width > 0;
        let before = || sides[at - 1].min(sides[at - width]).min(sides[at - width - 1]);
        sides[at] = if is_inside { before() + 1 } else { 1 };
    }
    sides
}

/// Whether a group is at most [`WIDEST`] pixels wide in one direction, or consists of lines that meet: no square in it is wide.
fn is_narrow(group: &[usize], sides: &[usize], width: usize) -> bool {
    let extent = |of: &dyn Fn(usize) -> usize| {
        let (low, high) = group.iter().fold((usize::MAX, 0), |(l, h), i| (l.min(of(*i)), h.max(of(*i))));
        high - low + 1
    };
    let narrower = extent(&|i| i / width).min(extent(&|i| i % width));
    let square = group.iter().map(|i| sides[*i]).fold(0, usize::max);
    narrower <= WIDEST || square <= WIDEST && (square as f64) < FILLED * narrower as f64
}

/// Places of the pixels up to `reach` rows and columns from a pixel, itself among them, in a picture of so many pixels.
fn square(at: usize, reach: usize, width: usize, pixels: usize) -> impl Iterator<Item = usize> {
    let (row, column) = (at / width, at % width);
    let around = move |middle: usize, end: usize| middle.saturating_sub(reach)..(middle + reach + 1).min(end);
    around(row, pixels / width).flat_map(move |r| around(column, width).map(move |c| r * width + c))
}

/// A picture of rows of `width` in which each of these pixels has the mean of the nearest good ones: those among its eight neighbours, or, inside
/// a cluster, those in the smallest square around it that has some. Without a good pixel it stays as it is.
pub fn without(sum_dn: &[i64], width: usize, defects: &[usize]) -> Vec<i64> {
    let mut clean = sum_dn.to_vec();
    if defects.len() == sum_dn.len() {
        return clean;
    }
    for at in defects {
        let good = |reach: usize| -> Vec<i64> {
            let near = square(*at, reach, width, sum_dn.len());
            near.filter(|i| defects.binary_search(i).is_err()).map(|i| sum_dn[i]).collect()
        };
        let longest = width.max(sum_dn.len() / width);
        if let Some(good) = (1..longest).map(good).find(|good| !good.is_empty()) {
            clean[*at] = (good.iter().sum::<i64>() as f64 / good.len() as f64).round() as i64;
        }
    }
    clean
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 480;
    const HEIGHT: usize = 320;

    /// A flat stack of about 1000 DN with a little structure, and one of the dark.
    fn stacks(flat: impl Fn(usize, usize) -> f64) -> [Plane; 2] {
        let plane = |value: &dyn Fn(usize, usize) -> f64| Plane {
            height: HEIGHT,
            width: WIDTH,
            values: (0..HEIGHT * WIDTH).map(|i| value(i / WIDTH, i % WIDTH)).collect(),
        };
        let noise = |r: usize, c: usize| ((r * 37 + c * 101) % 17) as f64 - 8.0;
        [plane(&|r, c| 100.0 + flat(r, c) + noise(r, c)), plane(&|_, _| 100.0)]
    }

    #[test]
    fn a_cluster_is_found_whole_and_filled_from_around_it() {
        let is_stuck =
            |r: usize, c: usize| (20..28).contains(&r) && (40..48).contains(&c) || (60..64).contains(&c);
        let [flat, dark] = stacks(|r, c| if is_stuck(r, c) { 0.0 } else { 1000.0 });
        let found = defects(&flat, &dark);
        assert_eq!(found.len(), 64 + 4 * HEIGHT);
        assert!(found.iter().all(|i| is_stuck(i / WIDTH, i % WIDTH)));
        let sum: Vec<i64> = flat.values.iter().map(|v| *v as i64).collect();
        let clean = without(&sum, WIDTH, &found);
        assert!(clean.iter().all(|v| (1080..=1120).contains(v)), "{:?}", clean.iter().min());
        // Where no pixel is good, nothing can be filled in.
        let all: Vec<usize> = (0..sum.len()).collect();
        assert_eq!(without(&sum, WIDTH, &all), sum);
    }

    #[test]
    fn dead_rows_and_columns_that_meet_are_found_whole() {
        // A row and two columns from side to side, half a row that ends at one of them, and a cluster on the row.
        let is_dead = |r: usize, c: usize| {
            r == 50
                || (33..35).contains(&c)
                || r == 200 && c < 34
                || (48..54).contains(&r) && (300..306).contains(&c)
        };
        for level in [0.0, 3000.0] {
            let [flat, mut dark] = stacks(|r, c| if is_dead(r, c) { level } else { 1000.0 });
            for (i, value) in dark.values.iter_mut().enumerate() {
                if is_dead(i / WIDTH, i % WIDTH) {
                    *value = flat.values[i];
                }
            }
            let found = defects(&flat, &dark);
            let wanted: Vec<usize> = (0..WIDTH * HEIGHT).filter(|i| is_dead(i / WIDTH, i % WIDTH)).collect();
            assert_eq!(found, wanted, "{level}");
        }
    }

    #[test]
    fn corners_beyond_the_image_circle_are_no_defects() {
        let light = |r: usize, c: usize| {
            let from_axis = (r as f64 - 160.0).hypot(c as f64 - 240.0);
            1000.0 / (1.0 + ((from_axis - 220.0) / 1.5).exp())
        };
        let [flat, dark] = stacks(|r, c| if (r, c) == (150, 200) { 0.0 } else { light(r, c) });
        assert_eq!(defects(&flat, &dark), [150 * WIDTH + 200]);
    }
}
