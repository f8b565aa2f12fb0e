//! Straight lines through measured points, with the standard errors of their coefficients.

use schemars::JsonSchema;
use serde::Serialize;

use super::goodness::{Departure, FitTest, Model, Points, test};
use super::measured::{Measured, Unresolved};

/// A line `y = slope x + intercept`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Line {
    /// Slope, unit of y over unit of x.
    pub slope: Measured,
    /// Value at x = 0, unit of y.
    pub intercept: Measured,
}

impl Line {
    /// A line that cannot be fitted.
    pub fn none(why: Unresolved) -> Self {
        Self { slope: Measured::none(why), intercept: Measured::none(why) }
    }
}

/// Least-squares line with weights `w` and standard errors `y_se` of the points:
/// `(slope, intercept) = (A^T W A)^-1 A^T W y`, covariance `(A^T W A)^-1 A^T W S W A (A^T W A)^-1`, `S = diag(y_se^2)`.
/// Equal weights give ordinary least squares, with errors from `y_se`; weights `1/y_se^2` give the best linear fit.
pub fn line(x: &[f64], y: &[f64], w: &[f64], y_se: &[f64]) -> Line {
    let total: f64 = w.iter().sum();
    let mean_x = x.iter().zip(w).map(|(x, w)| x * w).sum::<f64>() / total;
    let mean_y = y.iter().zip(w).map(|(y, w)| y * w).sum::<f64>() / total;
    let sxx: f64 = x.iter().zip(w).map(|(x, w)| w * (x - mean_x).powi(2)).sum();
    if x.len() < 2 || sxx <= 0.0 || !sxx.is_finite() {
        return Line::none(Unresolved::TooFewPoints { got: x.len().min(1), need: 2 });
    }
    let slope = (0..x.len()).map(|i| w[i] * (x[i] - mean_x) * (y[i] - mean_y)).sum::<f64>() / sxx;
    // Both results are linear in y: propagate the errors of y through their coefficients.
    let (mut slope_var, mut intercept_var) = (0.0, 0.0);
    for i in 0..x.len() {
        let of_slope = w[i] * (x[i] - mean_x) / sxx;
        let of_intercept = w[i] / total - mean_x * of_slope;
        slope_var += (of_slope * y_se[i]).powi(2);
        intercept_var += (of_intercept * y_se[i]).powi(2);
    }
    Line {
        slope: Measured::new(slope, slope_var.sqrt()),
        intercept: Measured::new(mean_y - slope * mean_x, intercept_var.sqrt()),
    }
}

/// A fitted line, and the test whether its points lie on a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TestedLine {
    /// The line; its errors contain the departure of the points.
    pub line: Line,
    /// The line with errors of noise alone.
    pub by_noise: Line,
    /// The test.
    pub test: FitTest,
    /// What the departure of the points adds to the errors of the coefficients: intercept, slope.
    pub departure: Departure,
}

/// Fits a [`line()`] and tests whether the points lie on it.
pub fn tested_line(x: &[f64], y: &[f64], w: &[f64], y_se: &[f64]) -> TestedLine {
    let by_noise = line(x, y, w, y_se);
    let found = [by_noise.intercept, by_noise.slope].map(|m| m.value().unwrap_or(0.0));
    let (mut test, departure) = test(&Points::independent(x, y, y_se), Model::Line, &found);
    let widened =
        |m: Measured, coefficient: usize| m.with_error(departure.error(coefficient, m.error_or_zero()));
    test.model_error = departure.error(1, by_noise.slope.error_or_zero());
    let line = Line { slope: widened(by_noise.slope, 1), intercept: widened(by_noise.intercept, 0) };
    TestedLine { line, by_noise, test, departure }
}

/// A mean, and the test whether its values agree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TestedMean {
    /// The mean; its error contains the scatter of the values.
    pub mean: Measured,
    /// The test.
    pub test: FitTest,
}

/// Mean of independent measurements with weights `1/s^2`, without those that are not resolved or have no error. If none is
/// left, the reason is that of the first. Values that differ by more than their errors widen the error of the mean.
pub fn tested_mean(values: impl IntoIterator<Item = Measured>) -> TestedMean {
    let (mut known, mut all_se) = (Vec::new(), Vec::new());
    let mut why = None;
    for measured in values {
        why = why.or(measured.reason());
        if let (Some(v), Some(s)) = (measured.value(), measured.standard_error())
            && s > 0.0
        {
            known.push(v);
            all_se.push(s);
        }
    }
    let weight: f64 = all_se.iter().map(|s| 1.0 / (s * s)).sum();
    let sum: f64 = known.iter().zip(&all_se).map(|(v, s)| v / (s * s)).sum();
    let points = Points { x: vec![1.0; known.len()], y: known, own_se: all_se, shared: Vec::new() };
    let got = points.x.len();
    let (mut test, departure) = match got {
        0 => test(&points, Model::Constant, &[]),
        _ => test(&points, Model::Constant, &[sum / weight]),
    };
    let of_noise = weight.sqrt().recip();
    let mean = match got {
        0 => Measured::none(why.unwrap_or(Unresolved::TooFewPoints { got, need: 1 })),
        _ => Measured::new(sum / weight, of_noise.hypot(departure.error(0, of_noise))),
    };
    test.model_error = if got > 0 { departure.error(0, of_noise) } else { 0.0 };
    TestedMean { mean, test }
}

/// The mean of [`tested_mean`] alone.
pub fn weighted_mean(values: impl IntoIterator<Item = Measured>) -> Measured {
    tested_mean(values).mean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_errors_match_closed_forms() {
        let x = [0.0, 1.0, 2.0, 3.0];
        let fit = line(&x, &[1.0, 3.0, 5.0, 7.0], &[1.0; 4], &[0.1; 4]);
        assert!((fit.slope.value().unwrap() - 2.0).abs() < 1e-12);
        assert!((fit.intercept.value().unwrap() - 1.0).abs() < 1e-12);
        // Ordinary least squares: s / sqrt(sum (x - mean)^2) and s sqrt(1/n + mean^2 / sum (x - mean)^2).
        assert!((fit.slope.standard_error().unwrap() - 0.1 / 5.0_f64.sqrt()).abs() < 1e-12);
        assert!(
            (fit.intercept.standard_error().unwrap() - 0.1 * (0.25 + 2.25 / 5.0_f64).sqrt()).abs() < 1e-12
        );
        assert!(line(&[1.0], &[1.0], &[1.0], &[0.1]).slope.value().is_none());
        let mean = weighted_mean([Measured::new(1.0, 1.0), Measured::new(3.0, 1.0)]);
        assert_eq!(mean.value(), Some(2.0));
        assert!((mean.standard_error().unwrap() - 0.5_f64.sqrt()).abs() < 1e-12);
        // Values that lie 20 standard errors apart: their scatter is the error, 10 sqrt(2) of its own for one degree of freedom.
        let apart = weighted_mean([Measured::new(1.0, 0.1), Measured::new(3.0, 0.1)]);
        assert!((apart.standard_error().unwrap() - 1.84).abs() < 0.01, "{apart:?}");
    }
}
