//! Temporal noise that all pixels of a row, or of a column, have in common: that of a readout circuit which they share.
//!
//! It differs from movement and from uneven light by looking at neighbours only. `D_k(r)` is the mean of row `r` in frame `k`. The
//! difference of two neighbouring rows, `D_k(r + 1) - D_k(r)`, varies from frame to frame by twice the variance of a row's mean,
//!
//! ```text
//! v_row = R + P / N        N pixels in a row        [DN^2]
//! v_col = C + P / M        M pixels in a column
//! s2    = R + C + P        the whole temporal variance
//! ```
//!
//! which are three equations for the parts of rows `R`, of columns `C` and of single pixels `P`. Flicker and objects that move are the
//! same in neighbouring rows, but at the edges of the objects, and cancel.

use serde::Serialize;

use super::measured::Measured;

/// Sums of the rows and of the columns of each frame, DN.
#[derive(Debug, Clone)]
pub struct LineSums {
    /// By frame, then by row.
    pub rows: Vec<Vec<u64>>,
    /// By frame, then by column.
    pub columns: Vec<Vec<u64>>,
    /// Pixels of each row.
    pub row_pixels: Vec<usize>,
    /// Pixels of each column.
    pub column_pixels: Vec<usize>,
}

impl LineSums {
    /// No pixels yet.
    pub fn new(frames: usize, (height, width): (usize, usize)) -> Self {
        Self {
            rows: vec![vec![0; height]; frames],
            columns: vec![vec![0; width]; frames],
            row_pixels: vec![0; height],
            column_pixels: vec![0; width],
        }
    }

    /// Adds the pixels of another colour of the same frames.
    pub fn add(&mut self, other: &Self) {
        let add = |own: &mut [Vec<u64>], others: &[Vec<u64>]| {
            for (a, b) in own.iter_mut().flatten().zip(others.iter().flatten()) {
                *a += b;
            }
        };
        add(&mut self.rows, &other.rows);
        add(&mut self.columns, &other.columns);
        self.row_pixels.iter_mut().zip(&other.row_pixels).for_each(|(a, b)| *a += b);
        self.column_pixels.iter_mut().zip(&other.column_pixels).for_each(|(a, b)| *a += b);
    }

    /// The noise of rows and columns of frames whose temporal variance is `variance_dn2` with standard error `variance_se_dn2`.
    /// The colour filter array repeats after `tile` rows and columns. No noise if there are too few rows or columns.
    pub fn noise(&self, tile: [usize; 2], variance_dn2: f64, variance_se_dn2: f64) -> LineNoise {
        let rows = line_variance(&self.rows, &self.row_pixels, tile[0]);
        let columns = line_variance(&self.columns, &self.column_pixels, tile[1]);
        let (Some(rows), Some(columns)) = (rows, columns) else { return LineNoise::default() };
        let left = 1.0 - rows.share - columns.share;
        if left < LEAST_SHARE {
            return LineNoise::default();
        }
        let pixel_dn2 = (variance_dn2 - rows.variance - columns.variance) / left;
        let part = |of: &LineVariance| {
            let error = of.standard_error.hypot(of.share * variance_se_dn2 / left);
            Measured::new(of.variance - of.share * pixel_dn2, error)
        };
        LineNoise { row_dn2: part(&rows), column_dn2: part(&columns) }
    }
}

/// Temporal variances that pixels of a row, and of a column, have in common, DN^2. Noise may make them negative.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LineNoise {
    /// Of rows.
    pub row_dn2: Measured,
    /// Of columns.
    pub column_dn2: Measured,
}

impl Default for LineNoise {
    fn default() -> Self {
        Self { row_dn2: Measured::exact(0.0), column_dn2: Measured::exact(0.0) }
    }
}

impl LineNoise {
    /// Variances of rows and columns where they are beyond doubt, else zero, DN^2: for standard errors, which chance must not widen.
    pub fn certain_dn2(&self) -> [f64; 2] {
        [self.row_dn2, self.column_dn2].map(|m| {
            let value = m.value().unwrap_or(0.0);
            if value > CERTAIN_SIGMAS * m.error_or_zero() { value } else { 0.0 }
        })
    }

    /// Variances of rows and columns as they came out, DN^2.
    pub fn found_dn2(&self) -> [f64; 2] {
        [self.row_dn2, self.column_dn2].map(|m| m.value().unwrap_or(0.0))
    }

    /// Variance that the noise of `lines = [rows, columns]` independent lines leaves in their mean, DN^2.
    pub fn of_mean_dn2(&self, lines: [f64; 2]) -> f64 {
        let [row, column] = self.certain_dn2();
        row / lines[0] + column / lines[1]
    }
}

/// Least share of the variance of single pixels in the three equations: frames of a few rows or columns cannot tell them apart.
const LEAST_SHARE: f64 = 0.5;

/// Standard errors beyond which the noise of rows or columns is beyond doubt.
const CERTAIN_SIGMAS: f64 = 3.0;

/// Temporal variance of the mean of a line.
struct LineVariance {
    variance: f64,
    standard_error: f64,
    /// Share of the pixels' variance in it: one over the pixels of a line.
    share: f64,
}

/// Half the temporal variance of the differences of neighbouring lines, `step` apart. Lines without pixels are left out.
fn line_variance(sums: &[Vec<u64>], pixels: &[usize], step: usize) -> Option<LineVariance> {
    let frames = sums.len() as f64;
    let (mut squares, mut shares, mut pairs) = (0.0, 0.0, 0.0);
    for (i, j) in (0..pixels.len()).zip(step..pixels.len()) {
        if pixels[i] == 0 || pixels[j] == 0 {
            continue;
        }
        let difference =
            |frame: &Vec<u64>| frame[j] as f64 / pixels[j] as f64 - frame[i] as f64 / pixels[i] as f64;
        let mean = sums.iter().map(difference).sum::<f64>() / frames;
        squares += sums.iter().map(|frame| (difference(frame) - mean).powi(2)).sum::<f64>();
        shares += 0.5 * (1.0 / pixels[i] as f64 + 1.0 / pixels[j] as f64);
        pairs += 1.0;
    }
    let degrees = pairs * (frames - 1.0);
    let variance = squares / (2.0 * degrees);
    // Each line is in two differences, which correlates them: 3/n in place of the 2/n of independent ones.
    let standard_error = variance * (3.0 / degrees).sqrt();
    (pairs > 0.0).then_some(LineVariance { variance, standard_error, share: shares / pairs })
}
