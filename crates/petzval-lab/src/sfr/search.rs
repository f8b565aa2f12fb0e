//! A first guess of the edge: of all straight steps across a coarse picture of the region, the one that explains most of it.
//!
//! The coarse picture holds medians, so dead pixels and columns do not count. The plane that fits it best is subtracted. Thus neither a
//! slope of light across the region nor low contrast leads away from the edge.

use petzval_base::statistics::median;

use super::region::Pixels;

/// Most cells of the coarse picture in a row or column.
const MOST_CELLS: usize = 56;

/// Least side of the square whose median is a cell, pixels: two dead columns in it are a minority.
const LEAST_SQUARE: usize = 5;

/// Step of the directions, degrees.
const STEP_DEG: usize = 3;

/// Least share of the variance of a step, in units of one per cell, that a plane leaves.
const LEAST_LEFT: f64 = 0.01;

/// A straight step: bright where `normal . (x, y) > offset_px`, in pixels from the upper left corner of the window.
pub struct Step {
    pub normal: [f64; 2],
    pub offset_px: f64,
    /// Pixels of a cell's side: how exact it is.
    pub cell_px: f64,
}

/// The step that explains most; none if the region is even.
pub fn best_step(pixels: &Pixels) -> Option<Step> {
    let cell = pixels.height.max(pixels.width).div_ceil(MOST_CELLS);
    let cells = coarse(pixels, cell);
    let left = without_plane(&cells);
    let mut best: Option<(f64, Step)> = None;
    for deg in (0..180).step_by(STEP_DEG) {
        let (sin, cos) = (deg as f64).to_radians().sin_cos();
        if let Some((score, at, is_rising)) = best_split(&left, [cos, sin], cell as f64)
            && best.as_ref().is_none_or(|(most, _)| score > *most)
        {
            let sign = if is_rising { 1.0 } else { -1.0 };
            let step = Step { normal: [sign * cos, sign * sin], offset_px: sign * at, cell_px: cell as f64 };
            best = Some((score, step));
        }
    }
    best.map(|(_, step)| step)
}

/// A cell: its place, value, and what of a constant and a plane it holds, each of unit length over all cells.
struct Cell {
    at: [f64; 2],
    value: f64,
    plane: [f64; 3],
}

/// Medians of squares, one for every cell.
fn coarse(pixels: &Pixels, cell: usize) -> Vec<Cell> {
    let reach = cell.max(LEAST_SQUARE) / 2;
    let around = |at: usize, end: usize| at.saturating_sub(reach)..(at + reach + 1).min(end);
    let (rows, cols) = (pixels.height / cell, pixels.width / cell);
    let value = |i: usize| {
        let (row, col) = (i / cols * cell + cell / 2, i % cols * cell + cell / 2);
        let square = around(row, pixels.height)
            .flat_map(|r| around(col, pixels.width).map(move |c| r * pixels.width + c));
        let value = |is_dead: bool| {
            let own = square.clone().filter(|i| is_dead || !pixels.is_dead[*i]).map(|i| pixels.values[i]);
            own.clone().next().is_some().then(|| median(own))
        };
        let value = value(false).or_else(|| value(true)).unwrap_or(0.0);
        Cell { at: [col as f64 + 0.5, row as f64 + 0.5], value, plane: [0.0; 3] }
    };
    (0..rows * cols).map(value).collect()
}

/// The cells less the plane that fits them best.
fn without_plane(cells: &[Cell]) -> Vec<Cell> {
    let count = cells.len() as f64;
    let mean = |of: &dyn Fn(&Cell) -> f64| cells.iter().map(of).sum::<f64>() / count;
    let middle = [0, 1].map(|k| mean(&|c| c.at[k]));
    let length = [0, 1].map(|k| (count * mean(&|c| (c.at[k] - middle[k]).powi(2))).sqrt().max(1e-300));
    let plane = |c: &Cell| {
        let [x, y] = [0, 1].map(|k| (c.at[k] - middle[k]) / length[k]);
        [1.0 / count.sqrt(), x, y]
    };
    let share = [0, 1, 2].map(|k| count * mean(&|c| c.value * plane(c)[k]));
    let left = |c: &Cell| {
        let plane = plane(c);
        let value = c.value - (0..3).map(|k| share[k] * plane[k]).sum::<f64>();
        Cell { at: c.at, value, plane }
    };
    cells.iter().map(left).collect()
}

/// Of the steps across one direction the one that explains most: how much, where along the direction, and whether it rises.
///
/// With S = 1 beyond the split and q the unit plane vectors, it explains `<v, S>^2 / (<S, S> - sum_k <S, q_k>^2)`.
fn best_split(cells: &[Cell], normal: [f64; 2], cell: f64) -> Option<(f64, f64, bool)> {
    let along = |c: &Cell| c.at[0] * normal[0] + c.at[1] * normal[1];
    let (first, last) =
        cells.iter().map(along).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let mut bins = vec![[0.0; 5]; ((last - first) / cell) as usize + 1];
    for c in cells {
        let bin = &mut bins[((along(c) - first) / cell) as usize];
        for (sum, v) in bin.iter_mut().zip([1.0, c.value, c.plane[0], c.plane[1], c.plane[2]]) {
            *sum += v;
        }
    }
    let least = LEAST_LEFT * cells.len() as f64;
    let mut beyond = [0.0; 5];
    let mut best: Option<(f64, f64, bool)> = None;
    for (i, bin) in bins.iter().enumerate().skip(1).rev() {
        beyond.iter_mut().zip(bin).for_each(|(sum, v)| *sum += v);
        let left = beyond[0] - beyond[2..].iter().map(|p| p * p).sum::<f64>();
        let score = if left > least { beyond[1] * beyond[1] / left } else { 0.0 };
        if score > best.map_or(0.0, |(most, ..)| most) {
            best = Some((score, first + i as f64 * cell, beyond[1] > 0.0));
        }
    }
    best
}
