//! Least-squares polynomials through values at arbitrary points of a plane.

use crate::powers::{MAX_POWER, Powers, powers_of};
use nalgebra::{DMatrix, DVector, Dyn, QR};

use crate::pupil::Symmetry;

/// Least-squares fit of polynomials with given terms to values at fixed points.
#[derive(Clone, Debug)]
pub(super) struct PlaneFit {
    /// Powers (i, j) of the first and the second coordinate.
    pub powers: Vec<(usize, usize)>,
    /// Total degree.
    degree: usize,
    /// Powers of the coordinates of each point.
    points: Vec<[Powers; 2]>,
    /// Every term at each point: values from coefficients.
    terms: DMatrix<f64>,
    /// The terms as a product `Q R`: the coefficients of values are `R^-1 Q^T values`. Few values are fitted through the same points, so the
    /// matrix of that product is not made.
    qr: QR<f64, Dyn, Dyn>,
    r: DMatrix<f64>,
}

impl PlaneFit {
    /// Terms of a total degree; only those that are odd or even in the first coordinate, if a symmetry is given. `None`
    /// if the points do not determine the coefficients.
    pub fn new(points: &[[f64; 2]], degree: usize, symmetry: Option<Symmetry>) -> Option<Self> {
        let (first, step) = match symmetry {
            None => (0, 1),
            Some(Symmetry::Even) => (0, 2),
            Some(Symmetry::Odd) => (1, 2),
        };
        let powers: Vec<(usize, usize)> =
            (first..=degree).step_by(step).flat_map(|i| (0..=degree - i).map(move |j| (i, j))).collect();
        let points: Vec<[Powers; 2]> =
            points.iter().map(|point| point.map(|v| powers_of(v, degree))).collect();
        if points.len() < powers.len() {
            return None;
        }
        let terms = DMatrix::from_fn(points.len(), powers.len(), |r, c| term(powers[c], &points[r]));
        let qr = terms.clone().qr();
        let r = qr.r();
        // Where a diagonal element is lost in the rounding of the largest, the points lie on a curve of this degree.
        let largest = r.diagonal().amax();
        let is_determined = r.diagonal().iter().all(|v| v.abs() > f64::EPSILON * largest);
        is_determined.then_some(Self { powers, degree, points, terms, qr, r })
    }

    /// Coefficients of the polynomial through values at the points.
    pub fn fit(&self, values: &[f64]) -> Vec<f64> {
        let mut turned = DVector::from_column_slice(values);
        self.qr.q_tr_mul(&mut turned);
        let mut coefficients = turned.rows(0, self.powers.len()).into_owned();
        self.r.solve_upper_triangular_mut(&mut coefficients);
        coefficients.as_slice().to_vec()
    }

    /// Adds the cotangents of the values and of their points, from those of the coefficients.
    ///
    /// For a polynomial through its values, moving a point by dq at a fixed value is the same as changing the value by
    /// `-grad f . dq`.
    pub fn pull_back(
        &self,
        coefficients: &[f64],
        coefficients_bar: &[f64],
        values_bar: &mut [f64],
        points_bar: &mut [[f64; 2]],
    ) {
        // Q R^-T bar, with the terms times R^-1 for Q.
        let mut bar = DVector::from_column_slice(coefficients_bar);
        self.r.tr_solve_upper_triangular_mut(&mut bar);
        self.r.solve_upper_triangular_mut(&mut bar);
        let by_value = &self.terms * bar;
        for (i, bar) in by_value.iter().enumerate() {
            values_bar[i] += bar;
            let [x, y] = self.slope(coefficients, &self.points[i]);
            points_bar[i][0] -= bar * x;
            points_bar[i][1] -= bar * y;
        }
    }

    /// Changes of the coefficients, from those of the values and of their points: the transpose of [`PlaneFit::pull_back`].
    pub fn push_forward(&self, coefficients: &[f64], values: &[f64], points: &[[f64; 2]]) -> Vec<f64> {
        let at_fixed_points = |i: usize| {
            let [x, y] = self.slope(coefficients, &self.points[i]);
            values[i] - x * points[i][0] - y * points[i][1]
        };
        self.fit(&(0..points.len()).map(at_fixed_points).collect::<Vec<f64>>())
    }

    /// The polynomial at a point.
    pub fn value(&self, coefficients: &[f64], at: [f64; 2]) -> f64 {
        let at = at.map(|v| powers_of(v, self.degree));
        self.powers.iter().zip(coefficients).map(|(p, c)| c * term(*p, &at)).sum()
    }

    /// Its slopes at a point, of whose coordinates the powers are given.
    fn slope(&self, coefficients: &[f64], [x, y]: &[Powers; 2]) -> [f64; 2] {
        let by = |powers: &Powers, n: usize| if n == 0 { 0.0 } else { n as f64 * powers[n - 1] };
        let mut sum = [0.0; 2];
        for ((i, j), c) in self.powers.iter().zip(coefficients) {
            sum[0] += c * by(x, *i) * y[*j];
            sum[1] += c * x[*i] * by(y, *j);
        }
        sum
    }

    /// Highest power of the first coordinate.
    fn highest(&self) -> usize {
        self.powers.last().map_or(0, |(i, _)| *i)
    }

    /// Coefficients of the powers of the first coordinate at one value of the second.
    pub fn along(&self, coefficients: &[f64], y: f64) -> Vec<f64> {
        let mut row = vec![0.0; self.highest() + 1];
        let powers = products_of(y);
        for ((i, j), c) in self.powers.iter().zip(coefficients) {
            row[*i] += c * powers[*j];
        }
        row
    }

    /// The transpose of [`PlaneFit::along`]: adds the cotangents of the coefficients, from those of a row.
    pub fn pull_back_along(&self, row_bar: &[f64], y: f64, coefficients_bar: &mut [f64]) {
        let powers = products_of(y);
        for ((i, j), bar) in self.powers.iter().zip(coefficients_bar) {
            *bar += row_bar[*i] * powers[*j];
        }
    }
}

/// Powers by repeated products.
fn products_of(v: f64) -> Powers {
    let mut all = [1.0; MAX_POWER];
    for n in 1..MAX_POWER {
        all[n] = all[n - 1] * v;
    }
    all
}

fn term((i, j): (usize, usize), [x, y]: &[Powers; 2]) -> f64 {
    x[i] * y[j]
}

/// A row at one value of the first coordinate, by Horner's rule.
pub(super) fn at(row: &[f64], x: f64) -> f64 {
    row.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// Adds `bar x^i` to the cotangents of a row.
pub(super) fn add_moments(row_bar: &mut [f64], bar: f64, x: f64) {
    let mut power = bar;
    for c in row_bar {
        *c += power;
        power *= x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_determine_no_polynomial_are_refused() {
        let on_a_line: Vec<[f64; 2]> = (0..40).map(|i| [0.05 * f64::from(i) - 1.0; 2]).collect();
        assert!(PlaneFit::new(&on_a_line, 3, None).is_none());
        assert!(PlaneFit::new(&on_a_line[..2], 3, None).is_none());
        assert!(PlaneFit::new(&[[f64::NAN, 0.0]; 40], 3, None).is_none());
    }

    #[test]
    fn derivatives_by_moved_points_match_differences() {
        let point =
            |i: usize| [(i as f64 * 0.754_877_666).fract() - 0.5, (i as f64 * 0.569_840_291).fract() - 0.5];
        let points: Vec<[f64; 2]> = (0..60).map(point).collect();
        let f = |[x, y]: [f64; 2]| 0.4 + x - y * y + x * x * y - 0.3 * x.powi(4);
        let values: Vec<f64> = points.iter().map(|p| f(*p)).collect();
        let fit = PlaneFit::new(&points, 5, None).unwrap();
        let coefficients = fit.fit(&values);
        for i in 0..60 {
            assert!((fit.value(&coefficients, points[i]) - values[i]).abs() < 1e-12);
        }
        let at_row = at(&fit.along(&coefficients, 0.3), -0.2);
        assert!((at_row - f([-0.2, 0.3])).abs() < 1e-12);
        // Compare the gradient of a loss of the coefficients, by values and points, with differences.
        let bar: Vec<f64> = (0..coefficients.len()).map(|c| (c as f64 * 0.9).sin()).collect();
        let (mut by_values, mut by_points) = (vec![0.0; 60], vec![[0.0; 2]; 60]);
        fit.pull_back(&coefficients, &bar, &mut by_values, &mut by_points);
        let loss = |points: &[[f64; 2]], values: &[f64]| -> f64 {
            let c = PlaneFit::new(points, 5, None).unwrap().fit(values);
            c.iter().zip(&bar).map(|(a, b)| a * b).sum()
        };
        let h = 1e-6;
        for i in [0, 17, 42] {
            let moved = |h: f64| {
                let mut points = points.clone();
                points[i][1] += h;
                loss(&points, &values)
            };
            let numeric = (moved(h) - moved(-h)) / (2.0 * h);
            assert!((by_points[i][1] - numeric).abs() < 1e-6 * (1.0 + numeric.abs()));
            let moved = |h: f64| {
                let mut values = values.clone();
                values[i] += h;
                loss(&points, &values)
            };
            let numeric = (moved(h) - moved(-h)) / (2.0 * h);
            assert!((by_values[i] - numeric).abs() < 1e-6 * (1.0 + numeric.abs()));
        }
    }
}
