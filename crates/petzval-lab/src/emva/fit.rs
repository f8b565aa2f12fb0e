//! Straight lines through measured points, with the standard errors of their coefficients.

use serde::Serialize;

use super::measured::{Measured, Unresolved};

/// A line `y = slope x + intercept`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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

/// Slope of the least-squares line through the origin, `sum(x y) / sum(x x)`, all points of equal weight.
///
/// With standard errors `x_se`, `y_se` of independent points `s^2 = sum(x^2 (y_se^2 + slope^2 x_se^2)) / sum(x x)^2`.
pub fn through_origin(x: &[f64], y: &[f64], x_se: &[f64], y_se: &[f64]) -> Measured {
    let xx: f64 = x.iter().map(|x| x * x).sum();
    let slope = x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>() / xx;
    let variance: f64 =
        (0..x.len()).map(|i| x[i] * x[i] * (y_se[i].powi(2) + (slope * x_se[i]).powi(2))).sum::<f64>()
            / (xx * xx);
    Measured::new(slope, variance.sqrt())
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

/// Mean of independent measurements with weights `1/s^2`, without those that are not resolved or have no error. If none is
/// left, the reason is that of the first.
pub fn weighted_mean(values: impl IntoIterator<Item = Measured>) -> Measured {
    let (mut weight, mut sum, mut got) = (0.0, 0.0, 0);
    let mut why = None;
    for measured in values {
        why = why.or(measured.reason());
        if let (Some(v), Some(s)) = (measured.value(), measured.standard_error())
            && s > 0.0
        {
            weight += 1.0 / (s * s);
            sum += v / (s * s);
            got += 1;
        }
    }
    match got {
        0 => Measured::none(why.unwrap_or(Unresolved::TooFewPoints { got, need: 1 })),
        _ => Measured::new(sum / weight, weight.sqrt().recip()),
    }
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
        let k = through_origin(&[1.0, 2.0], &[2.0, 4.0], &[0.0; 2], &[0.1; 2]);
        assert_eq!(k.value(), Some(2.0));
        assert!((k.standard_error().unwrap() - 0.1 / 5.0_f64.sqrt()).abs() < 1e-12);
        assert!(line(&[1.0], &[1.0], &[1.0], &[0.1]).slope.value().is_none());
        let mean = weighted_mean([Measured::new(1.0, 1.0), Measured::new(3.0, 1.0)]);
        assert_eq!(mean.value(), Some(2.0));
        assert!((mean.standard_error().unwrap() - 0.5_f64.sqrt()).abs() < 1e-12);
    }
}
