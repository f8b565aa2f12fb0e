//! Temporal noise that all pixels of a row, or of a column, have in common: that of a readout circuit which they share.
//!
//! It differs from movement and from uneven light by looking at neighbours only. `D_k(r)` is the mean of row `r` in frame `k`. The
//! difference of two neighbouring rows, `D_k(r + 1) - D_k(r)`, varies from frame to frame by twice the variance of a row's mean. In the
//! double difference of four neighbouring pixels, `d = a - b - c + d` of two rows and two columns, all that rows or columns have in common
//! cancels, and it varies by four times the variance of single pixels:
//!
//! ```text
//! v_row = R + P / N        N pixels in a row        [DN^2]
//! v_col = C + P / M        M pixels in a column
//! v_dd  = 4 P
//! ```
//!
//! which are three equations for the parts of rows `R`, of columns `C` and of single pixels `P`. Flicker and objects that move are the
//! same in neighbouring rows, but at the edges of the objects, and cancel.
//!
//! The parts are those of the frames as they are, whole digital numbers. How far rounding to these changes the noise of a row is
//! [another error](super::rounding::Steps).

use schemars::JsonSchema;
use serde::Serialize;

use super::measured::{Measured, Unresolved};

/// Sums of the rows, of the columns and of the double differences of each frame, DN.
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
    /// Double differences of each row with the next of its kind.
    pub doubles: Vec<DoubleDifferences>,
}

/// Double differences `d` of the pixels of two neighbouring rows.
#[derive(Debug, Clone, Copy, Default)]
pub struct DoubleDifferences {
    /// How many in a frame.
    pub count: usize,
    /// Sum over places and frames of `d^2`, DN^2.
    pub squares: f64,
    /// Sum over places of the square of the sum over frames of `d`, DN^2.
    pub squares_of_sum: f64,
}

/// The double differences of the pixels of a row with their neighbours below and to the right, by column. `step` is the distance of
/// neighbours of one colour, rows and columns.
pub fn double_differences<T: Copy + Into<i64>>(
    picture: &[T],
    width: usize,
    row: usize,
    [down, right]: [usize; 2],
) -> impl Iterator<Item = (usize, i64)> {
    let line = |row: usize| picture.get(row * width..(row + 1) * width).unwrap_or_default();
    let (above, below) = (line(row), line(row + down));
    let slope = move |line: &[T], col: usize| line[col + right].into() - line[col].into();
    (0..below.len().saturating_sub(right)).map(move |col| (col, slope(below, col) - slope(above, col)))
}

impl LineSums {
    /// No pixels yet.
    pub fn new(frames: usize, (height, width): (usize, usize)) -> Self {
        Self {
            rows: vec![vec![0; height]; frames],
            columns: vec![vec![0; width]; frames],
            row_pixels: vec![0; height],
            column_pixels: vec![0; width],
            doubles: vec![DoubleDifferences::default(); height],
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
        for (a, b) in self.doubles.iter_mut().zip(&other.doubles) {
            a.count += b.count;
            a.squares += b.squares;
            a.squares_of_sum += b.squares_of_sum;
        }
    }

    /// The noise of rows, columns and pixels. The colour filter array repeats after `tile` rows and columns. None of it is resolved if
    /// there are too few rows or columns.
    pub fn noise(&self, tile: [usize; 2]) -> LineNoise {
        let parts = || {
            let rows = line_variance(&self.rows, &self.row_pixels, tile[0])?;
            let columns = line_variance(&self.columns, &self.column_pixels, tile[1])?;
            Some((rows, columns, self.pixel_variance()?))
        };
        let Some((rows, columns, pixel_dn2)) = parts() else {
            let none = Measured::none(Unresolved::FewLines);
            return LineNoise { row_dn2: none, column_dn2: none, pixel_dn2: none };
        };
        let part = |of: &LineVariance| {
            Measured::new(of.variance, of.standard_error).minus(pixel_dn2.scale(of.share))
        };
        LineNoise { row_dn2: part(&rows), column_dn2: part(&columns), pixel_dn2 }
    }

    /// Variance of single pixels, DN^2: a quarter of that of the double differences. Its error is the scatter over the rows, which have
    /// pixels of their own kinds (hot ones are noisier).
    fn pixel_variance(&self) -> Option<Measured> {
        let frames = self.rows.len() as f64;
        let used: Vec<(f64, f64)> = (self.doubles.iter().filter(|row| row.count > 0))
            .map(|row| {
                let squares = row.squares - row.squares_of_sum / frames;
                (row.count as f64, squares / (4.0 * (frames - 1.0)))
            })
            .collect();
        if used.len() < 2 {
            return None;
        }
        let (count, sum) = used.iter().fold((0.0, 0.0), |(n, s), (count, sum)| (n + count, s + sum));
        let variance = sum / count;
        let scatter: f64 = used.iter().map(|(n, sum)| (sum - n * variance).powi(2)).sum();
        // Neighbouring rows of double differences share pixels, which correlates their squares by a quarter.
        let rows = used.len() as f64;
        let standard_error = (1.5 * scatter * rows / (rows - 1.0)).sqrt() / count;
        Some(Measured::new(variance, standard_error))
    }
}

/// Temporal variances that pixels of a row, and of a column, have in common, and that of single pixels, DN^2. Noise may make the former
/// negative.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct LineNoise {
    /// Of rows.
    pub row_dn2: Measured,
    /// Of columns.
    pub column_dn2: Measured,
    /// Of single pixels.
    pub pixel_dn2: Measured,
}

impl LineNoise {
    /// Variances of rows and columns where they are beyond doubt, else zero, DN^2: for standard errors, which chance must not widen.
    pub fn certain_dn2(&self) -> [f64; 2] {
        [self.row_dn2, self.column_dn2].map(|m| {
            let value = m.value().unwrap_or(0.0);
            if value > CERTAIN_SIGMAS * m.error_or_zero() { value } else { 0.0 }
        })
    }

    /// Variance that the noise of `lines = [rows, columns]` independent lines leaves in their mean, DN^2.
    pub fn of_mean_dn2(&self, lines: [f64; 2]) -> f64 {
        let [row, column] = self.certain_dn2();
        row / lines[0] + column / lines[1]
    }
}

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
