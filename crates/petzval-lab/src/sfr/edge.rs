//! Where the edge lies: the centroid of the derivative of every row, and the straight line through them.

use petzval_camera::render::Window;

use super::error::SfrError;
use super::limits::{LEAST_ROWS, STEEPEST_DEG};
use super::plane::Plane;

/// How often the centroids are computed, each time in windows about the line of the time before.
const PASSES: usize = 4;

/// Least ratio of the step to the noise of the two ends of a row, in the mean over the rows.
const LEAST_STEP: f64 = 1.0;

/// Rows across a nearly vertical edge, from dark on the left to bright on the right.
pub struct Rows {
    pub height: usize,
    pub width: usize,
    pub values: Vec<f64>,
    /// Whether they are rows of the picture; otherwise they are its columns.
    pub is_upright: bool,
}

impl Rows {
    /// The rows, or for a nearly horizontal edge the columns, of a window.
    pub fn across_edge(plane: &Plane, window: &Window) -> Result<Self, SfrError> {
        let (top, left) = (window.placement.row, window.placement.col);
        let (height, width) = (window.height, window.width);
        if left + width > plane.width || (top + height) * plane.width > plane.values.len() {
            return Err(SfrError::Outside);
        }
        if height.min(width) < LEAST_ROWS {
            return Err(SfrError::Small { along: height.min(width), across: width / 2 });
        }
        let at = |row: usize, col: usize| f64::from(plane.values[(top + row) * plane.width + left + col]);
        // The light changes from side to side across the edge, and little along it.
        let mean = |rows: std::ops::Range<usize>, cols: std::ops::Range<usize>| {
            let count = (rows.len() * cols.len()) as f64;
            let cols = &cols;
            rows.flat_map(|r| cols.clone().map(move |c| (r, c))).map(|(r, c)| at(r, c)).sum::<f64>() / count
        };
        let (fifth_down, fifth_across) = (height / 5, width / 5);
        let rightwards = mean(0..height, width - fifth_across..width) - mean(0..height, 0..fifth_across);
        let downwards = mean(height - fifth_down..height, 0..width) - mean(0..fifth_down, 0..width);
        let is_vertical = rightwards.abs() >= downwards.abs();
        let is_bright_last = if is_vertical { rightwards > 0.0 } else { downwards > 0.0 };
        let (height, width) = if is_vertical { (height, width) } else { (width, height) };
        let value = |row: usize, col: usize| {
            let col = if is_bright_last { col } else { width - 1 - col };
            if is_vertical { at(row, col) } else { at(col, row) }
        };
        let values = (0..height * width).map(|i| value(i / width, i % width)).collect();
        Ok(Self { height, width, values, is_upright: is_vertical })
    }

    pub fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.width..][..self.width]
    }
}

/// The edge: `x = start + slope * row`, in pixels from the left end of the rows, where the middle of the first pixel is at 1/2.
pub struct Line {
    pub start: f64,
    pub slope: f64,
    /// Root mean square distance of the rows' centroids from the line, pixels.
    pub roughness_px: f64,
}

impl Line {
    /// The line through the centroids of all rows.
    pub fn through(rows: &Rows) -> Result<Self, SfrError> {
        check_step(rows)?;
        let mut line = Self { start: 0.5 * rows.width as f64, slope: 0.0, roughness_px: f64::INFINITY };
        for _ in 0..PASSES {
            let found: Vec<(f64, f64)> = (0..rows.height)
                .filter_map(|row| Some((row as f64, centroid(rows.row(row), line.at(row as f64))?)))
                .collect();
            if found.len() < rows.height.div_ceil(2) {
                return Err(SfrError::NoEdge);
            }
            line = Self::fitted(&found);
        }
        let deg = line.slope.atan().to_degrees();
        if line.slope.abs() * (rows.height as f64) < 1.0 || deg.abs() > STEEPEST_DEG {
            return Err(SfrError::Angle { deg });
        }
        Ok(line)
    }

    /// Where the line crosses a row.
    pub fn at(&self, row: f64) -> f64 {
        self.start + self.slope * row
    }

    /// Least squares.
    fn fitted(points: &[(f64, f64)]) -> Self {
        let count = points.len() as f64;
        let mean_row = points.iter().map(|p| p.0).sum::<f64>() / count;
        let mean_at = points.iter().map(|p| p.1).sum::<f64>() / count;
        let spread: f64 = points.iter().map(|p| (p.0 - mean_row).powi(2)).sum();
        let slope = points.iter().map(|p| (p.0 - mean_row) * (p.1 - mean_at)).sum::<f64>() / spread;
        let line = Self { start: mean_at - slope * mean_row, slope, roughness_px: 0.0 };
        let squares: f64 = points.iter().map(|p| (p.1 - line.at(p.0)).powi(2)).sum();
        Self { roughness_px: (squares / count).sqrt(), ..line }
    }
}

/// The centroid of the derivative of a row, weighted by a Hamming window about `near`. None where the light does not rise.
fn centroid(row: &[f64], near: f64) -> Option<f64> {
    let last = row.len() as f64;
    // The window is symmetric, so that noise and blur pull the centroid to neither side.
    let half = near.min(last - near).max(4.0);
    let (mut sum, mut moment) = (0.0, 0.0);
    for (i, pair) in row.windows(2).enumerate() {
        let from_middle = (i + 1) as f64 - near;
        if from_middle.abs() < half {
            let weight = 0.54 + 0.46 * (std::f64::consts::PI * from_middle / half).cos();
            let rise = weight * (pair[1] - pair[0]);
            sum += rise;
            moment += rise * from_middle;
        }
    }
    let at = near + moment / sum;
    (sum > 0.0 && at > 0.0 && at < last).then_some(at)
}

/// Refuses a window whose two ends differ by less than they scatter.
fn check_step(rows: &Rows) -> Result<(), SfrError> {
    let fifth = rows.width / 5;
    let (mut step, mut scatter) = (0.0, 0.0);
    for row in 0..rows.height {
        let [dark, bright] = [&rows.row(row)[..fifth], &rows.row(row)[rows.width - fifth..]];
        let mean = |side: &[f64]| side.iter().sum::<f64>() / side.len() as f64;
        let variance = |side: &[f64], mean: f64| {
            side.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / side.len() as f64
        };
        let means = [mean(dark), mean(bright)];
        step += means[1] - means[0];
        scatter += variance(dark, means[0]) + variance(bright, means[1]);
    }
    let count = rows.height as f64;
    let (step, scatter) = (step / count, (0.5 * scatter / count).sqrt());
    if step > LEAST_STEP * scatter { Ok(()) } else { Err(SfrError::NoEdge) }
}
