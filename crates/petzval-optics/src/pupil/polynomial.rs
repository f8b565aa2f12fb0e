//! Polynomials over the whole pupil, as sums of both parities of a basis.
//!
//! If the y-z plane is a plane of symmetry of the lens, one half of the pupil is the mirror image of the other. Quantities are then odd or
//! even in p_x, and samples of one half are enough. In other lenses both halves are sampled at mirrored points, and a quantity is the sum
//! of an even and an odd part, which are fitted separately.

use super::basis::PupilBasis;
use crate::trace::Sequence;

/// The sampled halves of the pupil.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sides {
    /// The half `p_x > 0`; the other is its mirror image.
    Mirrored,
    /// Both: first `p_x > 0`, then the mirrored points.
    Both,
}

/// Behaviour of a quantity under mirroring, in a symmetric lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Symmetry {
    /// It changes its sign, as x does.
    Odd,
    /// It does not change.
    Even,
}

/// Coefficients of a polynomial over the pupil; a part without coefficients is zero.
#[derive(Clone, Debug)]
pub(crate) struct PupilPolynomial {
    pub even: Vec<f64>,
    pub odd: Vec<f64>,
}

impl PupilPolynomial {
    /// The zero polynomial with as many coefficients.
    pub fn zero_like(other: &Self) -> Self {
        Self { even: vec![0.0; other.even.len()], odd: vec![0.0; other.odd.len()] }
    }

    /// Whether every coefficient is zero.
    pub fn is_zero(&self) -> bool {
        self.even.iter().chain(&self.odd).all(|c| *c == 0.0)
    }
}

impl Sides {
    /// The halves that a lens needs.
    pub fn of(sequence: &Sequence) -> Self {
        if sequence.is_mirror_symmetric { Self::Mirrored } else { Self::Both }
    }

    /// Points of the half `p_x > 0`, and their mirror images if both sides are sampled.
    pub fn points(self, right: &[[f64; 2]]) -> Vec<[f64; 2]> {
        match self {
            Self::Mirrored => right.to_vec(),
            Self::Both => right.iter().copied().chain(right.iter().map(|[x, y]| [-x, *y])).collect(),
        }
    }

    /// Weights of [`Sides::points`], from those of points that include their mirror images.
    pub fn weights(self, right: &[f64]) -> Vec<f64> {
        match self {
            Self::Mirrored => right.to_vec(),
            Self::Both => right.iter().chain(right).map(|w| 0.5 * w).collect(),
        }
    }
}

/// Even and odd parts of values on both sides.
fn parts(values: &[f64], count: usize) -> [Vec<f64>; 2] {
    let (right, left) = (&values[..count], &values[count..2 * count]);
    let part = |sign: f64| right.iter().zip(left).map(|(r, l)| 0.5 * (r + sign * l)).collect();
    [part(1.0), part(-1.0)]
}

/// Values on both sides from those of the parts on the right.
fn both_sides(even: &[f64], odd: &[f64]) -> Vec<f64> {
    let right = even.iter().zip(odd).map(|(e, o)| e + o);
    right.chain(even.iter().zip(odd).map(|(e, o)| e - o)).collect()
}

impl PupilBasis {
    /// The polynomial through values at the sample points of `sides`.
    pub fn fit(&self, values: &[f64], sides: Sides, symmetry: Symmetry) -> PupilPolynomial {
        match (sides, symmetry) {
            (Sides::Mirrored, Symmetry::Odd) => {
                PupilPolynomial { even: Vec::new(), odd: self.odd.fit(values) }
            }
            (Sides::Mirrored, Symmetry::Even) => {
                PupilPolynomial { even: self.even.fit(values), odd: Vec::new() }
            }
            (Sides::Both, _) => {
                let [even, odd] = parts(values, self.samples.len());
                PupilPolynomial { even: self.even.fit(&even), odd: self.odd.fit(&odd) }
            }
        }
    }

    /// Adds the cotangents of the values, from those of the coefficients.
    pub fn pull_back_fit(&self, bar: &PupilPolynomial, sides: Sides, values_bar: &mut [f64]) {
        if sides == Sides::Mirrored {
            if !bar.even.is_empty() {
                self.even.pull_back_fit(&bar.even, values_bar);
            }
            if !bar.odd.is_empty() {
                self.odd.pull_back_fit(&bar.odd, values_bar);
            }
            return;
        }
        let count = self.samples.len();
        let (mut even, mut odd) = (vec![0.0; count], vec![0.0; count]);
        self.even.pull_back_fit(&bar.even, &mut even);
        self.odd.pull_back_fit(&bar.odd, &mut odd);
        for i in 0..count {
            values_bar[i] += 0.5 * (even[i] + odd[i]);
            values_bar[count + i] += 0.5 * (even[i] - odd[i]);
        }
    }

    /// The polynomial at the check points of `sides`.
    pub fn at_checks(&self, p: &PupilPolynomial, sides: Sides) -> Vec<f64> {
        match sides {
            Sides::Mirrored if p.odd.is_empty() => self.even.at_checks(&p.even),
            Sides::Mirrored => self.odd.at_checks(&p.odd),
            Sides::Both => both_sides(&self.even.at_checks(&p.even), &self.odd.at_checks(&p.odd)),
        }
    }

    /// Derivatives by p_x and p_y at the sample points of `sides`.
    pub fn slopes(&self, p: &PupilPolynomial, sides: Sides) -> [Vec<f64>; 2] {
        match sides {
            Sides::Mirrored if p.odd.is_empty() => self.even.slopes(&p.even),
            Sides::Mirrored => self.odd.slopes(&p.odd),
            Sides::Both => {
                // The derivative by p_x of an even function is odd, and the other way round.
                let [even_x, even_y] = self.even.slopes(&p.even);
                let [odd_x, odd_y] = self.odd.slopes(&p.odd);
                [both_sides(&odd_x, &even_x), both_sides(&even_y, &odd_y)]
            }
        }
    }

    /// Cotangents of the coefficients, from those of the slopes.
    pub fn pull_back_slopes(&self, bar: [&[f64]; 2], sides: Sides, symmetry: Symmetry) -> PupilPolynomial {
        match (sides, symmetry) {
            (Sides::Mirrored, Symmetry::Odd) => {
                PupilPolynomial { even: Vec::new(), odd: self.odd.pull_back_slopes(bar) }
            }
            (Sides::Mirrored, Symmetry::Even) => {
                PupilPolynomial { even: self.even.pull_back_slopes(bar), odd: Vec::new() }
            }
            (Sides::Both, _) => {
                // The transpose of the sums of both sides, twice the parts.
                let count = self.samples.len();
                let twice =
                    |values: &[f64]| parts(values, count).map(|v| v.iter().map(|v| 2.0 * v).collect());
                let [x_even, x_odd]: [Vec<f64>; 2] = twice(bar[0]);
                let [y_even, y_odd]: [Vec<f64>; 2] = twice(bar[1]);
                PupilPolynomial {
                    even: self.even.pull_back_slopes([&x_odd, &y_even]),
                    odd: self.odd.pull_back_slopes([&x_even, &y_odd]),
                }
            }
        }
    }

    /// Derivatives by p_x and p_y at any point of the pupil.
    pub fn slope(&self, p: &PupilPolynomial, at: [f64; 2]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (parity, coefficients) in [(&self.even, &p.even), (&self.odd, &p.odd)] {
            if !coefficients.is_empty() {
                let [x, y] = parity.slope(coefficients, at);
                sum = [sum[0] + x, sum[1] + y];
            }
        }
        sum
    }

    /// Adds the cotangents of the coefficients, from those of [`PupilBasis::slope`].
    pub fn pull_back_slope(&self, bar: [f64; 2], at: [f64; 2], to: &mut PupilPolynomial) {
        for (parity, coefficients) in [(&self.even, &mut to.even), (&self.odd, &mut to.odd)] {
            if !coefficients.is_empty() {
                parity.pull_back_slope(bar, at, coefficients);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn function([x, y]: [f64; 2]) -> f64 {
        0.3 + x * y - 0.7 * x * x * y + 0.2 * x.powi(3) + y.powi(4)
    }

    #[test]
    fn a_function_without_symmetry_is_fitted_on_both_sides() {
        let basis = PupilBasis::of_degree(6);
        let points = Sides::Both.points(&basis.samples);
        let values: Vec<f64> = points.iter().map(|p| function(*p)).collect();
        let p = basis.fit(&values, Sides::Both, Symmetry::Even);
        let checks = Sides::Both.points(&super::super::basis::check_points());
        for (found, at) in basis.at_checks(&p, Sides::Both).iter().zip(&checks) {
            assert!((found - function(*at)).abs() < 1e-12);
        }
        let [by_x, by_y] = basis.slopes(&p, Sides::Both);
        for (i, [x, y]) in points.into_iter().enumerate() {
            assert!((by_x[i] - (y - 1.4 * x * y + 0.6 * x * x)).abs() < 1e-11);
            assert!((by_y[i] - (x - 0.7 * x * x + 4.0 * y.powi(3))).abs() < 1e-11);
            let [at_x, at_y] = basis.slope(&p, [x, y]);
            assert!((at_x - by_x[i]).abs() < 1e-11 && (at_y - by_y[i]).abs() < 1e-11);
        }
    }

    #[test]
    fn pulling_back_is_the_transpose_on_both_sides() {
        let basis = PupilBasis::of_degree(6);
        let count = 2 * basis.samples.len();
        let wave = |i: usize| (i as f64 * 0.7).sin();
        let values: Vec<f64> = (0..count).map(wave).collect();
        let bars: [Vec<f64>; 2] = [3, 5].map(|k| (0..count).map(|i| wave(k * i + 1)).collect());
        let [by_x, by_y] = basis.slopes(&basis.fit(&values, Sides::Both, Symmetry::Odd), Sides::Both);
        let coefficients_bar = basis.pull_back_slopes([&bars[0], &bars[1]], Sides::Both, Symmetry::Odd);
        let mut values_bar = vec![0.0; count];
        basis.pull_back_fit(&coefficients_bar, Sides::Both, &mut values_bar);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let left = dot(&by_x, &bars[0]) + dot(&by_y, &bars[1]);
        let right = dot(&values, &values_bar);
        assert!((left - right).abs() < 1e-10 * left.abs().max(1.0), "{left} {right}");
    }
}
