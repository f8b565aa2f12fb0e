//! A quick look whether a window may hold a slanted edge: the centroid of the derivative of every row, and the straight line through them.
//!
//! A search over a frame looks at every window this way, and measures those that pass.

use petzval_camera::render::Window;

use super::limits::LEAST_SIDE;
use super::plane::Plane;

/// How often the centroids are computed, each time in windows about the line of the time before.
const PASSES: usize = 4;

/// Least ratio of the step to the noise of the two ends of a row, in the mean over the rows.
const LEAST_STEP: f64 = 1.0;

/// Distance of the nearer end of an edge from the middle of a window, pixels; `None` if the window holds no straight edge.
///
/// A straight edge has an inclination within `angles_deg` and at least `least_half` pixels on either side, and its rows lie within
/// `roughness_px` of a line.
pub fn may_be_edge(
    plane: &Plane,
    window: &Window,
    angles_deg: &std::ops::RangeInclusive<f64>,
    least_half: f64,
    roughness_px: f64,
) -> Option<f64> {
    let line = Rows::across_edge(plane, window).and_then(|rows| Line::through(&rows))?;
    let is_one = angles_deg.contains(&line.slope.atan().to_degrees().abs())
        && line.nearest_px >= least_half
        && line.roughness_px < roughness_px;
    is_one.then_some(line.nearest_px)
}

/// Rows across a nearly vertical edge, from dark on the left to bright on the right.
struct Rows {
    height: usize,
    width: usize,
    values: Vec<f64>,
}

impl Rows {
    /// The rows, or for a nearly horizontal edge the columns, of a window.
    fn across_edge(plane: &Plane, window: &Window) -> Option<Self> {
        let (top, left) = (window.placement.row, window.placement.col);
        let (height, width) = (window.height, window.width);
        let is_inside = left + width <= plane.width && (top + height) * plane.width <= plane.values.len();
        if !is_inside || height.min(width) < LEAST_SIDE {
            return None;
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
        Some(Self { height, width, values })
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.width..][..self.width]
    }

    /// Whether the two ends differ by more than they scatter.
    fn has_step(&self) -> bool {
        let fifth = self.width / 5;
        let (mut step, mut scatter) = (0.0, 0.0);
        for row in 0..self.height {
            let [dark, bright] = [&self.row(row)[..fifth], &self.row(row)[self.width - fifth..]];
            let mean = |side: &[f64]| side.iter().sum::<f64>() / side.len() as f64;
            let variance = |side: &[f64], mean: f64| {
                side.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / side.len() as f64
            };
            let means = [mean(dark), mean(bright)];
            step += means[1] - means[0];
            scatter += variance(dark, means[0]) + variance(bright, means[1]);
        }
        let count = self.height as f64;
        step / count > LEAST_STEP * (0.5 * scatter / count).sqrt()
    }
}

/// The edge: `x = start + slope * row`, in pixels from the left end of the rows, where the middle of the first pixel is at 1/2.
struct Line {
    start: f64,
    slope: f64,
    /// Root mean square distance of the rows' centroids from the line, pixels.
    roughness_px: f64,
    /// Distance of the line from the nearer end of the rows, pixels.
    nearest_px: f64,
}

impl Line {
    /// The line through the centroids of all rows.
    fn through(rows: &Rows) -> Option<Self> {
        if !rows.has_step() {
            return None;
        }
        let middle = 0.5 * rows.width as f64;
        let mut line = Self { start: middle, slope: 0.0, roughness_px: f64::INFINITY, nearest_px: middle };
        for _ in 0..PASSES {
            let found: Vec<(f64, f64)> = (0..rows.height)
                .filter_map(|row| Some((row as f64, centroid(rows.row(row), line.at(row as f64))?)))
                .collect();
            if found.len() < rows.height.div_ceil(2) {
                return None;
            }
            line = Self::fitted(&found);
        }
        let ends = [line.at(0.0), line.at((rows.height - 1) as f64)];
        line.nearest_px =
            ends.iter().fold(f64::INFINITY, |near, at| near.min(*at).min(rows.width as f64 - at));
        Some(line)
    }

    /// Where the line crosses a row.
    fn at(&self, row: f64) -> f64 {
        self.start + self.slope * row
    }

    /// Least squares.
    fn fitted(points: &[(f64, f64)]) -> Self {
        let count = points.len() as f64;
        let mean_row = points.iter().map(|p| p.0).sum::<f64>() / count;
        let mean_at = points.iter().map(|p| p.1).sum::<f64>() / count;
        let spread: f64 = points.iter().map(|p| (p.0 - mean_row).powi(2)).sum();
        let slope = points.iter().map(|p| (p.0 - mean_row) * (p.1 - mean_at)).sum::<f64>() / spread;
        let line = Self { start: mean_at - slope * mean_row, slope, roughness_px: 0.0, nearest_px: 0.0 };
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
