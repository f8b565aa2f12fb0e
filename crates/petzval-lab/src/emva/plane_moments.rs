//! Moments of a picture split into rows, columns and the rest, and how much of their scatter two pictures of the same pixels share.

use super::high_pass::Plane;
use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

/// Moments of a picture.
pub struct PlaneMoments {
    /// Mean.
    pub mean: f64,
    /// Variance.
    pub variance: f64,
    /// Standard error of the variance that is left without rows and columns.
    pub pixel_se: f64,
    /// Variance of the remainder, estimated from the median of its absolute values: a few outliers do not change it.
    pub pixel_core: f64,
    /// Variance of the column means.
    pub column_means: f64,
    /// Variance of the row means.
    pub row_means: f64,
}

/// The moments of a picture.
pub fn moments(plane: &Plane) -> PlaneMoments {
    let (m, n) = (plane.height as f64, plane.width as f64);
    let mean = plane.values.iter().sum::<f64>() / (m * n);
    let mut second = 0.0;
    let mut columns = vec![0.0; plane.width];
    let mut rows = Vec::with_capacity(plane.height);
    for row in plane.values.chunks_exact(plane.width) {
        let mut sum = 0.0;
        for (column, v) in columns.iter_mut().zip(row) {
            let d = v - mean;
            sum += d;
            *column += d;
            second += d * d;
        }
        rows.push(sum / n);
    }
    columns.iter_mut().for_each(|c| *c /= m);
    // Subtract rows and columns, so that their patterns do not count as errors of the pixels.
    let (mut squares, mut fourth) = (0.0, 0.0);
    let mut sizes = Vec::with_capacity(plane.values.len());
    for (row, of_row) in plane.values.chunks_exact(plane.width).zip(&rows) {
        for (v, of_column) in row.iter().zip(&columns) {
            let d2 = (v - mean - of_row - of_column).powi(2);
            squares += d2;
            fourth += d2 * d2;
            sizes.push(d2.sqrt());
        }
    }
    let pixels = squares / (m * n);
    let variance = second / (m * n - 1.0);
    PlaneMoments {
        mean,
        variance,
        pixel_se: ((fourth / (m * n) - pixels * pixels).max(0.0) / (m * n)).sqrt(),
        pixel_core: (SIGMA_OVER_MEDIAN * median(sizes)).powi(2),
        column_means: columns.iter().map(|c| c * c).sum::<f64>() / n,
        row_means: rows.iter().map(|r| r * r).sum::<f64>() / m,
    }
}

/// Correlation over specimens of the variances of two pictures: of rows, of columns and of single pixels, 0 to 1.
///
/// The pixels of a flat and of a dark stack have the same offsets. Where another specimen would have a larger variance of them, it has so in both, and
/// the difference of the variances changes less than either. For normally distributed numbers of the correlation `r` it is `r^2`; for pixels, some of
/// which are hot, it is the correlation of their squares.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SharedScatter {
    /// Of the variances of rows.
    pub row: f64,
    /// Of the variances of columns.
    pub column: f64,
    /// Of the variances of single pixels.
    pub pixel: f64,
}

impl SharedScatter {
    /// The shared scatter of two pictures of one size.
    pub fn of(one: &Plane, other: &Plane) -> Self {
        let parts = [one, other].map(parts);
        let correlation = |a: &[f64], b: &[f64]| {
            let n = a.len() as f64;
            let [mean_a, mean_b] = [a, b].map(|v| v.iter().sum::<f64>() / n);
            let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
            for (x, y) in a.iter().zip(b) {
                let (x, y) = (x - mean_a, y - mean_b);
                (aa, bb, ab) = (aa + x * x, bb + y * y, ab + x * y);
            }
            if aa * bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
        };
        let [[rows, columns, rest], [other_rows, other_columns, other_rest]] = &parts;
        let squares = |values: &[f64]| values.iter().map(|v| v * v).collect::<Vec<f64>>();
        Self {
            row: correlation(rows, other_rows).powi(2),
            column: correlation(columns, other_columns).powi(2),
            pixel: correlation(&squares(rest), &squares(other_rest)).max(0.0),
        }
    }

    /// The mean of several.
    pub fn mean(all: impl Iterator<Item = Self>) -> Self {
        let all: Vec<Self> = all.collect();
        let mean = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / all.len().max(1) as f64;
        Self { row: mean(|s| s.row), column: mean(|s| s.column), pixel: mean(|s| s.pixel) }
    }
}

/// Means of rows, means of columns, and the picture without both.
fn parts(plane: &Plane) -> [Vec<f64>; 3] {
    let (width, height) = (plane.width as f64, plane.height as f64);
    let rows: Vec<f64> =
        plane.values.chunks_exact(plane.width).map(|row| row.iter().sum::<f64>() / width).collect();
    let mut columns = vec![0.0; plane.width];
    for row in plane.values.chunks_exact(plane.width) {
        columns.iter_mut().zip(row).for_each(|(column, v)| *column += v / height);
    }
    let mean = rows.iter().sum::<f64>() / height;
    let at = |(i, v): (usize, &f64)| v - rows[i / plane.width] - columns[i % plane.width] + mean;
    let rest = plane.values.iter().enumerate().map(at).collect();
    [rows, columns, rest]
}
