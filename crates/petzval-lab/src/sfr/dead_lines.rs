//! Dead and hot rows and columns, before an edge is known.
//!
//! The light along a row rises or falls once, at the edge, and a running median leaves such a row as it is. It takes out what is narrower than
//! half of it. A line whose pixels differ from their running medians across it is dead.

use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

/// Pixels on either side in the running median: lines up to so many wide are found.
const REACH: usize = 3;

/// Least deviation from the running median: in standard deviations of the ordinary pixels, and of the range of the values.
const SIGMAS: f64 = 7.0;
const LEAST: f64 = 0.03;

/// Share of the pixels of a line that deviate.
const SHARE: f64 = 0.4;

/// Share of the pixels below and above the range of the values.
const TAIL: f64 = 0.1;

/// Marks the pixels of dead rows and columns.
pub fn dead_lines(values: &[f64], height: usize, width: usize) -> Vec<bool> {
    let mut marks = vec![false; values.len()];
    let mut ordered = values.to_vec();
    ordered.sort_unstable_by(f64::total_cmp);
    let cut = (TAIL * values.len() as f64) as usize;
    let range = ordered[values.len() - 1 - cut] - ordered[cut];
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
        let deviations = |is_dead: &[bool], line: usize| -> Vec<f64> {
            let around = around(is_dead, line);
            let running = |k: usize| median(around.iter().map(|l| values[place(*l, k)]));
            (0..length).map(|k| (values[place(line, k)] - running(k)).abs()).collect()
        };
        let all = (0..lines).flat_map(|line| deviations(&is_dead, line));
        let limit = (SIGMAS * SIGMA_OVER_MEDIAN * median(all)).max(LEAST * range);
        let off = |is_dead: &[bool], line: usize| {
            deviations(is_dead, line).into_iter().filter(|d| *d > limit).count()
        };
        let mut counts: Vec<usize> = (0..lines).map(|line| off(&is_dead, line)).collect();
        // Take the worst line out first: its neighbours deviate by it alone.
        while let Some(worst) = (0..lines).filter(|l| !is_dead[*l]).max_by_key(|l| counts[*l])
            && counts[worst] as f64 > SHARE * length as f64
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
}
