//! Polynomials over the pupil: its sample points, and the least-squares fits through the samples.
//!
//! Fields lie in the y-z plane, so x on any surface is odd in p_x and every other quantity even. A polynomial of total
//! degree n has the terms `p_x^i p_y^j`, `i + j <= n`, with i of its parity. The samples are a product rule on the half
//! disk `p_x > 0`: Gauss-Legendre in r^2 and equal steps in angle. It integrates polynomials over the disk exactly, and its
//! points are denser towards the rim, as Chebyshev points are, so that fits do not oscillate.

use std::f64::consts::PI;
use std::sync::OnceLock;

use nalgebra::DMatrix;

use super::linear::Matrix;
use crate::powers::{Powers, powers_of};

/// The degrees for which a basis exists, ascending.
const DEGREES: [usize; 7] = [4, 6, 8, 10, 12, 16, 20];

/// Number of the rays that sample a pupil.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PupilSampling {
    /// Enough for polynomials of (at least) this total degree, 4 to 20: from 28 to 368 rays, mirror images not counted.
    Degree(usize),
    /// 512 rays, mirror images not counted.
    Fine,
}

/// Degree, rings and arms of the fine sampling.
const FINE: (usize, usize, usize) = (8, 16, 32);

/// The terms of one parity, and the matrices of their least-squares fit.
#[derive(Debug)]
pub(crate) struct Parity {
    /// Total degree.
    degree: usize,
    /// Powers (i, j) of p_x and p_y, rows of one i after another: i ascending, then j ascending.
    pub powers: Vec<(usize, usize)>,
    /// Coefficients from values at the samples.
    fit: Matrix,
    /// Derivatives by p_x and p_y at the samples from coefficients.
    slopes: [Matrix; 2],
    /// Values at the check points from coefficients.
    checks: Matrix,
}

/// Points (radius, angle from the p_x axis over pi) at which polynomials are checked: the rim, and between samples.
const CHECKS: [(f64, f64); 16] = [
    (1.0, -0.49),
    (1.0, -0.41),
    (1.0, -0.31),
    (1.0, -0.22),
    (1.0, -0.09),
    (1.0, 0.03),
    (1.0, 0.13),
    (1.0, 0.24),
    (1.0, 0.37),
    (1.0, 0.48),
    (0.93, -0.45),
    (0.91, 0.29),
    (0.8, 0.44),
    (0.73, -0.17),
    (0.5, -0.33),
    (0.31, 0.08),
];

/// Points of the pupil at which polynomials are checked; they are not samples.
pub(crate) fn check_points() -> [[f64; 2]; CHECKS.len()] {
    CHECKS.map(|(r, turns)| {
        let (sin, cos) = (turns * PI).sin_cos();
        [r * cos, r * sin]
    })
}

/// Samples of the pupil and polynomials through them.
#[derive(Debug)]
pub(crate) struct PupilBasis {
    pub degree: usize,
    /// Samples (p_x, p_y), p_x > 0.
    pub samples: Vec<[f64; 2]>,
    /// Share of the disk's area of a sample and its mirror image; the sum is 1.
    pub weights: Vec<f64>,
    pub odd: Parity,
    pub even: Parity,
}

/// Nodes and weights of Gauss-Legendre quadrature on 0..1, by Newton's method on the Legendre polynomial.
fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let n = count as f64;
    (0..count)
        .map(|k| {
            let mut x = (PI * (k as f64 + 0.75) / (n + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut before, mut value) = (1.0, x);
                for j in 2..=count {
                    let j = j as f64;
                    (before, value) = (value, ((2.0 * j - 1.0) * x * value - (j - 1.0) * before) / j);
                }
                if count == 1 {
                    (before, value) = (1.0, x);
                }
                slope = n * (x * value - before) / (x * x - 1.0);
                let step = value / slope;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Derivatives of `p_x^i p_y^j` by p_x and p_y, from the powers of both.
fn slope_of((i, j): (usize, usize), [x, y]: &[Powers; 2]) -> [f64; 2] {
    let slope = |of: &Powers, i: usize| if i == 0 { 0.0 } else { i as f64 * of[i - 1] };
    [slope(x, i) * y[j], x[i] * slope(y, j)]
}

/// Powers (i, j) of a parity: i ascending, then j.
fn powers(degree: usize, parity: usize) -> Vec<(usize, usize)> {
    (parity..=degree).step_by(2).flat_map(|i| (0..=degree - i).map(move |j| (i, j))).collect()
}

impl Parity {
    fn new(degree: usize, parity: usize, samples: &[[f64; 2]]) -> Self {
        let powers = powers(degree, parity);
        let of_points = |points: &[[f64; 2]]| -> Vec<[Powers; 2]> {
            points.iter().map(|p| p.map(|v| powers_of(v, degree))).collect()
        };
        let value_at = |[x, y]: &[Powers; 2], (i, j): (usize, usize)| x[i] * y[j];
        let at = of_points(samples);
        let value = DMatrix::from_fn(samples.len(), powers.len(), |r, c| value_at(&at[r], powers[c]));
        // Least squares by QR: coefficients = R^-1 Q^T values.
        let qr = value.qr();
        let q_t = qr.q().transpose();
        // The rank is full: there are more samples than terms, and the samples lie on no curve of that degree.
        let solve = qr.r().solve_upper_triangular(&q_t).unwrap_or_else(|| unreachable!("full column rank"));
        let fit = Matrix::new(powers.len(), samples.len(), |r, c| solve[(r, c)]);
        let slopes = [0, 1]
            .map(|axis| Matrix::new(samples.len(), powers.len(), |r, c| slope_of(powers[c], &at[r])[axis]));
        let points = of_points(&check_points());
        let checks = Matrix::new(points.len(), powers.len(), |r, c| value_at(&points[r], powers[c]));
        Self { degree, powers, fit, slopes, checks }
    }

    /// Coefficients of the polynomial through values at the samples.
    pub fn fit(&self, values: &[f64]) -> Vec<f64> {
        self.fit.apply(values)
    }

    /// Adds the cotangents of the values, from those of the coefficients.
    pub fn pull_back_fit(&self, coefficients_bar: &[f64], values_bar: &mut [f64]) {
        self.fit.add_transposed(coefficients_bar, values_bar);
    }

    /// The polynomial at the check points.
    pub fn at_checks(&self, coefficients: &[f64]) -> Vec<f64> {
        self.checks.apply(coefficients)
    }

    /// Derivatives by p_x and p_y at the samples.
    pub fn slopes(&self, coefficients: &[f64]) -> [Vec<f64>; 2] {
        self.slopes.each_ref().map(|m| m.apply(coefficients))
    }

    /// Cotangents of the coefficients, from those of the slopes.
    pub fn pull_back_slopes(&self, slopes_bar: [&[f64]; 2]) -> Vec<f64> {
        let mut coefficients_bar = vec![0.0; self.powers.len()];
        for (m, bar) in self.slopes.iter().zip(slopes_bar) {
            m.add_transposed(bar, &mut coefficients_bar);
        }
        coefficients_bar
    }

    /// Derivatives by p_x and p_y at a point of the pupil.
    pub fn slope(&self, coefficients: &[f64], p: [f64; 2]) -> [f64; 2] {
        let p = p.map(|v| powers_of(v, self.degree));
        let mut sum = [0.0; 2];
        for (c, powers) in coefficients.iter().zip(&self.powers) {
            let by = slope_of(*powers, &p);
            sum = [sum[0] + c * by[0], sum[1] + c * by[1]];
        }
        sum
    }

    /// Adds the cotangents of the coefficients, from those of [`Parity::slope`].
    pub fn pull_back_slope(&self, bar: [f64; 2], p: [f64; 2], coefficients_bar: &mut [f64]) {
        let p = p.map(|v| powers_of(v, self.degree));
        for (c, powers) in coefficients_bar.iter_mut().zip(&self.powers) {
            let by = slope_of(*powers, &p);
            *c += bar[0] * by[0] + bar[1] * by[1];
        }
    }

    /// The polynomial at a point of the pupil.
    #[cfg(test)]
    pub fn value(&self, coefficients: &[f64], p: [f64; 2]) -> f64 {
        let term = |(c, (i, j)): (&f64, &(usize, usize))| c * p[0].powi(*i as i32) * p[1].powi(*j as i32);
        coefficients.iter().zip(&self.powers).map(term).sum()
    }
}

impl PupilBasis {
    fn new((degree, rings, arms): (usize, usize, usize)) -> Self {
        let mut samples = Vec::with_capacity(rings * arms);
        let mut weights = Vec::with_capacity(rings * arms);
        for (square, weight) in gauss_legendre(rings) {
            for k in 0..arms {
                let angle = PI * ((k as f64 + 0.5) / arms as f64 - 0.5);
                let radius = square.sqrt();
                samples.push([radius * angle.cos(), radius * angle.sin()]);
                weights.push(weight / arms as f64);
            }
        }
        let odd = Parity::new(degree, 1, &samples);
        let even = Parity::new(degree, 0, &samples);
        Self { degree, samples, weights, odd, even }
    }

    /// The basis of a sampling, made once.
    pub fn of(sampling: PupilSampling) -> &'static Self {
        static OF_DEGREE: [OnceLock<PupilBasis>; DEGREES.len()] = [const { OnceLock::new() }; DEGREES.len()];
        static OF_MANY: OnceLock<PupilBasis> = OnceLock::new();
        match sampling {
            PupilSampling::Degree(wanted) => {
                let at = DEGREES.iter().position(|d| *d >= wanted).unwrap_or(DEGREES.len() - 1);
                let degree = DEGREES[at];
                // About three samples for two terms.
                OF_DEGREE[at].get_or_init(|| Self::new((degree, degree * 3 / 4 + 1, degree + 3)))
            }
            PupilSampling::Fine => OF_MANY.get_or_init(|| Self::new(FINE)),
        }
    }

    /// [`PupilBasis::of`] a degree.
    pub fn of_degree(degree: usize) -> &'static Self {
        Self::of(PupilSampling::Degree(degree))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_integrate_polynomials_over_the_disk() {
        for degree in DEGREES {
            let basis = PupilBasis::of_degree(degree);
            let mean = |f: &dyn Fn([f64; 2]) -> f64| -> f64 {
                basis.samples.iter().zip(&basis.weights).map(|(p, w)| w * f(*p)).sum()
            };
            // Means over the unit disk: <1> = 1, <x^2> = 1/4, <x^2 y^2> = 1/24, <y^6> = 5/64.
            assert!((mean(&|_| 1.0) - 1.0).abs() < 1e-13);
            assert!((mean(&|p| p[0] * p[0]) - 0.25).abs() < 1e-13);
            assert!((mean(&|p| (p[0] * p[1]).powi(2)) - 1.0 / 24.0).abs() < 1e-13);
            assert!((mean(&|p| p[1].powi(6)) - 5.0 / 64.0).abs() < 1e-13);
            assert!(basis.samples.iter().all(|p| p[0] > 0.0 && p[0].hypot(p[1]) < 1.0));
            assert!(basis.samples.len() > basis.even.powers.len());
        }
    }

    #[test]
    fn polynomials_of_the_degree_are_fitted_exactly() {
        for degree in DEGREES {
            let basis = PupilBasis::of_degree(degree);
            for (parity, odd) in [(&basis.even, false), (&basis.odd, true)] {
                let n = degree as i32;
                let f = |p: [f64; 2]| {
                    let even = (0.3 * p[1] - 0.2).powi(n - 1) + 0.5 * (p[0] * p[0]) - p[1];
                    if odd { p[0] * even } else { even }
                };
                let values: Vec<f64> = basis.samples.iter().map(|p| f(*p)).collect();
                let coefficients = parity.fit(&values);
                for p in [[0.0, 1.0], [1.0, 0.0], [0.6, -0.8], [0.3, 0.1]] {
                    assert!((parity.value(&coefficients, p) - f(p)).abs() < 1e-9, "degree {degree} at {p:?}");
                }
                let [by_x, _] = parity.slopes(&coefficients);
                let p = basis.samples[7];
                let h = 1e-6;
                let numeric = (f([p[0] + h, p[1]]) - f([p[0] - h, p[1]])) / (2.0 * h);
                assert!((by_x[7] - numeric).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn pulling_back_is_the_transpose() {
        let basis = PupilBasis::of_degree(8);
        let wave = |i: usize| (i as f64 * 0.7).sin();
        let values: Vec<f64> = (0..basis.samples.len()).map(wave).collect();
        let coefficients = basis.odd.fit(&values);
        let [by_x, by_y] = basis.odd.slopes(&coefficients);
        let bar: Vec<f64> = (0..values.len()).map(|i| wave(3 * i + 1)).collect();
        let coefficients_bar = basis.odd.pull_back_slopes([&bar, &bar]);
        let mut values_bar = vec![0.0; values.len()];
        basis.odd.pull_back_fit(&coefficients_bar, &mut values_bar);
        let left: f64 = by_x.iter().zip(&by_y).zip(&bar).map(|((a, b), c)| (a + b) * c).sum();
        let right: f64 = values.iter().zip(&values_bar).map(|(a, b)| a * b).sum();
        assert!((left - right).abs() < 1e-10 * left.abs().max(1.0), "{left} {right}");
    }
}
