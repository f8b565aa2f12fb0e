//! The high-pass filter of EMVA 1288, which removes the shading of the light before non-uniformity is evaluated.
//!
//! A filter is `h = delta - l` with a separable low-pass `l`. Its loss of variance is known exactly and corrected:
//! white noise keeps the share `sum(h^2)`, a pattern of columns `sum over x of (sum over y of h)^2`, which for a
//! separable `l` of unit sum is `sum((delta - l_x)^2)`, and rows likewise. Release 3.1 (Sec. C.3) uses a 5x5 box,
//! release 4 a 7x7 box, an 11x11 box and a 3x3 binomial kernel one after the other.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A picture of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Values, row by row.
    pub values: Vec<f64>,
}

/// The high-pass filter before the evaluation of non-uniformity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum HighPass {
    /// No filter, as in the EMVA 1288 Python library.
    #[serde(rename = "none")]
    None,
    /// The filter of EMVA 1288 release 3.1: a box of 5 x 5.
    #[serde(rename = "r3.1")]
    R31,
    /// The filter of EMVA 1288 release 4: boxes of 7 x 7 and 11 x 11, then a binomial of 3 x 3.
    #[serde(rename = "r4")]
    R4,
}

/// Shares of the variance that a filter leaves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Passed {
    /// Share for pixels with independent noise.
    pub pixel: f64,
    /// Share for a pattern that is constant along rows or along columns.
    pub line: f64,
    /// Sum of the squared correlations of a filtered pixel with all pixels: the factor by which the lost independence
    /// raises the variance of a variance.
    pub pixel_correlation: f64,
    /// The same sum for the lines of a filtered pattern.
    pub line_correlation: f64,
}

impl HighPass {
    /// One-dimensional low-pass kernel, of unit sum.
    pub fn kernel(self) -> Vec<f64> {
        let boxes = |n: usize| vec![1.0 / n as f64; n];
        match self {
            Self::None => Vec::new(),
            Self::R31 => boxes(5),
            Self::R4 => convolve(&convolve(&boxes(7), &boxes(11)), &[0.25, 0.5, 0.25]),
        }
    }

    /// Number of pixels lost at each border.
    pub fn border(self) -> usize {
        self.kernel().len() / 2
    }

    /// Shares of the variance that the filter leaves.
    pub fn passed(self) -> Passed {
        let kernel = self.kernel();
        if kernel.is_empty() {
            return Passed { pixel: 1.0, line: 1.0, pixel_correlation: 1.0, line_correlation: 1.0 };
        }
        let centre = kernel[kernel.len() / 2];
        let power: f64 = kernel.iter().map(|k| k * k).sum();
        let (pixel, line) = (1.0 - 2.0 * centre * centre + power * power, 1.0 - 2.0 * centre + power);
        // Autocovariances of delta - l over shifts: delta - 2 l + l * l, where l is symmetric.
        let twice = convolve(&kernel, &kernel);
        let middle = twice.len() / 2;
        let once = |i: usize| {
            (i + kernel.len() / 2).checked_sub(middle).and_then(|k| kernel.get(k)).copied().unwrap_or(0.0)
        };
        let at_zero = |on: bool| if on { 1.0 } else { 0.0 };
        let (mut pixels, mut lines) = (0.0, 0.0);
        for i in 0..twice.len() {
            lines += (at_zero(i == middle) - 2.0 * once(i) + twice[i]).powi(2);
            for j in 0..twice.len() {
                let same = at_zero(i == middle && j == middle);
                pixels += (same - 2.0 * once(i) * once(j) + twice[i] * twice[j]).powi(2);
            }
        }
        let (pixel_correlation, line_correlation) = (pixels / (pixel * pixel), lines / (line * line));
        Passed { pixel, line, pixel_correlation, line_correlation }
    }

    /// Variance of the means over `across` filtered pixels, over that of as many independent ones: what independent pixels leave in the means of rows
    /// or columns. With the mean `b` over the pixels, the low-passes `l_x` along and `l_y` across the means, and `c = b * l_y`,
    ///
    /// ```text
    /// across sum (b^2 - 2 l_x(0) b c + sum(l_x^2) c^2)
    /// ```
    ///
    /// which is [`Passed::line`] of many pixels. Few are as many as the filter is wide: the low-pass across reaches beyond them.
    pub fn passed_by_means(self, across: usize) -> f64 {
        let kernel = self.kernel();
        if kernel.is_empty() {
            return 1.0;
        }
        let own = vec![1.0 / across as f64; across];
        let low = convolve(&own, &kernel);
        let power: f64 = kernel.iter().map(|k| k * k).sum();
        let squares = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
        let product: f64 = own.iter().zip(&low[self.border()..]).map(|(b, c)| b * c).sum();
        across as f64 * (squares(&own) - 2.0 * kernel[kernel.len() / 2] * product + power * squares(&low))
    }

    /// The filtered picture without its border; `None` if nothing is left.
    pub fn apply(self, plane: &Plane) -> Option<Plane> {
        let (kernel, border) = (self.kernel(), self.border());
        if kernel.is_empty() {
            return Some(plane.clone());
        }
        if plane.height <= 2 * border || plane.width <= 2 * border {
            return None;
        }
        let (height, width) = (plane.height - 2 * border, plane.width - 2 * border);
        // Subtract the mean, so that no digits are lost; filter columns, then rows.
        let mean = plane.values.iter().sum::<f64>() / plane.values.len() as f64;
        let mut along = vec![0.0; height * plane.width];
        for row in 0..height {
            for (k, weight) in kernel.iter().enumerate() {
                let source = &plane.values[(row + k) * plane.width..(row + k + 1) * plane.width];
                let target = &mut along[row * plane.width..(row + 1) * plane.width];
                target.iter_mut().zip(source).for_each(|(t, s)| *t += weight * (s - mean));
            }
        }
        let mut values = Vec::with_capacity(height * width);
        for row in 0..height {
            let line = &along[row * plane.width..(row + 1) * plane.width];
            let centre = &plane.values[(row + border) * plane.width + border..][..width];
            values.extend(centre.iter().enumerate().map(|(col, y)| {
                let low: f64 = kernel.iter().zip(&line[col..]).map(|(k, v)| k * v).sum();
                (y - mean) - low
            }));
        }
        Some(Plane { height, width, values })
    }
}

fn convolve(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            out[i + j] += x * y;
        }
    }
    out
}

/// The 5x5 high-pass of release 3.1 in whole numbers, 25 times as large: `25 y - sum of the 5x5 neighbours`, without the
/// border of two pixels. Returns the picture with its rows and columns.
pub fn high_pass_5x5_times_25(values: &[i64], height: usize, width: usize) -> (Vec<i64>, usize, usize) {
    let (rows, cols) = (height.saturating_sub(4), width.saturating_sub(4));
    let mut out = Vec::with_capacity(rows * cols);
    for row in 0..rows {
        for col in 0..cols {
            let sum: i64 = (row..row + 5).map(|r| values[r * width + col..][..5].iter().sum::<i64>()).sum();
            out.push(25 * values[(row + 2) * width + col + 2] - sum);
        }
    }
    (out, rows, cols)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn independent_pixels_leave_their_share_in_means_of_few_pixels() {
        // The mean of the middle column is linear in the pixels: sum the squares of its answers to one bright pixel each.
        for (filter, across) in [(HighPass::R31, 5), (HighPass::R31, 12), (HighPass::R4, 8)] {
            let (height, width) = (across + 2 * filter.border(), 2 * filter.border() + 1);
            let of_pixel = |bright: usize| {
                let values = (0..height * width).map(|i| if i == bright { 1.0 } else { 0.0 }).collect();
                let filtered = filter.apply(&Plane { height, width, values }).unwrap();
                (filtered.values.iter().sum::<f64>() / across as f64).powi(2)
            };
            let variance: f64 = (0..height * width).map(of_pixel).sum();
            let share = filter.passed_by_means(across);
            assert!((across as f64 * variance - share).abs() < 1e-12, "{filter:?} {across}: {share}");
            // More than many pixels leave, which is the limit.
            assert!(share > 1.01 * filter.passed().line, "{filter:?} {across}: {share}");
            assert!((filter.passed_by_means(20_000) / filter.passed().line - 1.0).abs() < 1e-3);
        }
        assert_eq!(HighPass::None.passed_by_means(7), 1.0);
    }

    #[test]
    fn shares_equal_those_of_filtered_patterns() {
        for filter in [HighPass::R31, HighPass::R4] {
            let size = 101;
            // Filter one bright pixel, one bright row and one bright column, and compare what is left of their squares.
            let left = |on: fn(usize, usize) -> bool| {
                let values = (0..size * size).map(|i| f64::from(on(i / size, i % size))).collect();
                let filtered = filter.apply(&Plane { height: size, width: size, values }).unwrap();
                (filtered.values.iter().map(|v| v * v).sum::<f64>(), filtered.width)
            };
            let passed = filter.passed();
            assert!((left(|r, c| r == 50 && c == 50).0 - passed.pixel).abs() < 1e-12);
            let (row, width) = left(|r, _| r == 50);
            assert!((row / width as f64 - passed.line).abs() < 1e-12);
            let (col, height) = left(|_, c| c == 50);
            assert!((col / height as f64 - passed.line).abs() < 1e-12);
            // The filter removes a slope.
            assert!(
                filter
                    .apply(&Plane {
                        height: size,
                        width: size,
                        values: (0..size * size).map(|i| (3 * (i / size) + i % size) as f64).collect(),
                    })
                    .unwrap()
                    .values
                    .iter()
                    .all(|v| v.abs() < 1e-9)
            );
        }
        assert!((HighPass::R31.passed().pixel - 0.96).abs() < 1e-12);
        assert!((HighPass::R4.kernel().iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(HighPass::R4.border(), 9);
    }
}
