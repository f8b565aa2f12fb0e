//! Dead and hot rows and columns, before an edge is known.
//!
//! The light along a row rises or falls once, at the edge, and a running median leaves such a row as it is. It takes out what is narrower than
//! half of it. A line whose pixels differ from their running medians across it is dead.
//!
//! A sharpened picture has a bright and a dark seam beside the edge. A seam runs along the edge, and leaves a line after a part of its length.
//! It is brighter than the bright side or darker than the dark side; a line that differs in part of its length only lies between the two.

use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

/// Pixels on either side in the running median: lines up to so many wide are found.
const REACH: usize = 3;

/// Least deviation from the running median: in standard deviations of the ordinary pixels, and of the range of the values.
const SIGMAS: f64 = 7.0;
const LEAST: f64 = 0.03;

/// Share of the pixels of a line that deviate towards the other side of the edge; or share of those that deviate at all.
const INWARD: f64 = 0.4;
const ANY: f64 = 0.9;

/// Share of the pixels below and above the range of the values.
const TAIL: f64 = 0.1;

/// Marks the pixels of dead rows and columns.
pub fn dead_lines(values: &[f64], height: usize, width: usize) -> Vec<bool> {
    let mut marks = vec![false; values.len()];
    let mut ordered = values.to_vec();
    ordered.sort_unstable_by(f64::total_cmp);
    let cut = (TAIL * values.len() as f64) as usize;
    let [dark, bright] = [ordered[cut], ordered[values.len() - 1 - cut]];
    let (range, middle) = (bright - dark, 0.5 * (dark + bright));
    let mut mark = |lines: usize, length: usize, place: &dyn Fn(usize, usize) -> usize| {
        let mut is_dead = vec![false; lines];
        // As many living lines on either side, so that a line of rising light has the median itself.
        let around = |is_dead: &[bool], line: usize| -> Vec<usize> {
            let is_living = |l: &usize| !is_dead[*l];
            let before: Vec<usize> = (0..line).rev().filter(is_living).take(REACH).collect();
            let after: Vec<usize> = (line + 1..lines).filter(is_living).take(REACH).collect();
            let reach = before.len().min(after.len());
            before[..reach].iter().chain(&after[..reach]).copied().chain([line]).collect()
        };
        // The running median of each pixel, and by how much the pixel differs from it.
        let deviations = |is_dead: &[bool], line: usize| -> Vec<[f64; 2]> {
            let around = around(is_dead, line);
            let running = |k: usize| median(around.iter().map(|l| values[place(*l, k)]));
            let both = |k: usize| {
                let running = running(k);
                [running, values[place(line, k)] - running]
            };
            (0..length).map(both).collect()
        };
        let all = (0..lines).flat_map(|line| deviations(&is_dead, line)).map(|[_, by]| by.abs());
        let limit = (SIGMAS * SIGMA_OVER_MEDIAN * median(all)).max(LEAST * range);
        // How many pixels of a line deviate, if it is dead.
        let off = |is_dead: &[bool], line: usize| -> Option<usize> {
            let deviations = deviations(is_dead, line);
            let beyond = || deviations.iter().filter(|[_, by]| by.abs() > limit);
            let inward = beyond().filter(|[running, by]| (middle - running) * by > 0.0).count();
            let all = beyond().count();
            let share = |count: usize| count as f64 / length as f64;
            (share(inward) > INWARD || share(all) > ANY).then_some(all)
        };
        let mut counts: Vec<Option<usize>> = (0..lines).map(|line| off(&is_dead, line)).collect();
        // Take the worst line out first: its neighbours deviate by it alone.
        while let Some((_, worst)) =
            (0..lines).filter(|l| !is_dead[*l]).filter_map(|l| counts[l].map(|count| (count, l))).max()
        {
            is_dead[worst] = true;
            (0..length).for_each(|k| marks[place(worst, k)] = true);
            for line in worst.saturating_sub(2 * REACH)..(worst + 2 * REACH + 1).min(lines) {
                counts[line] = off(&is_dead, line);
            }
        }
    };
    mark(width, height, &|col, row| row * width + col);
    mark(height, width, &|row, col| row * width + col);
    marks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_to_three_lines_beside_an_edge_are_found_and_none_where_there_is_none() {
        let edge = |row: usize, col: usize| {
            let from = col as f64 - 20.0 - 0.1 * row as f64;
            0.2 + 0.6 * (0.5 + 0.4 * from).clamp(0.0, 1.0)
        };
        for dead in [0..0, 22..23, 21..23, 21..24] {
            let value = |i: usize| if dead.contains(&(i % 40)) { 0.0 } else { edge(i / 40, i % 40) };
            let values: Vec<f64> = (0..40 * 40).map(value).collect();
            let turned: Vec<f64> = (0..40 * 40).map(|i| values[i % 40 * 40 + i / 40]).collect();
            let (columns, rows) = (dead_lines(&values, 40, 40), dead_lines(&turned, 40, 40));
            for i in 0..40 * 40 {
                assert_eq!(columns[i], dead.contains(&(i % 40)), "{dead:?} {i}");
                assert_eq!(rows[i], dead.contains(&(i / 40)), "{dead:?} {i}");
            }
        }
    }

    #[test]
    fn the_seams_of_a_sharpened_edge_are_no_dead_lines() {
        // An edge at 5 degrees, and seams 1.5 pixels beside it of a fifth of the step.
        let sharpened = |row: usize, col: usize| {
            let from = row as f64 - 20.0 - 0.0875 * (col as f64 - 20.0);
            let seam = |at: f64| 0.2 * (-0.5 * ((from - at) / 0.8).powi(2)).exp();
            0.2 + 0.6 * ((0.5 + 0.5 * from).clamp(0.0, 1.0) + seam(1.5) - seam(-1.5))
        };
        let lying: Vec<f64> = (0..40 * 40).map(|i| sharpened(i / 40, i % 40)).collect();
        let upright: Vec<f64> = (0..40 * 40).map(|i| lying[i % 40 * 40 + i / 40]).collect();
        for values in [lying, upright] {
            assert!(dead_lines(&values, 40, 40).iter().all(|is_dead| !is_dead));
        }
    }
}
