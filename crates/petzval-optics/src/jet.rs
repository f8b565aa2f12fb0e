//! Numbers that carry derivatives: a formula written once gives its value, its slopes and its curvature.
//!
//! Formulas are generic over [`Real`]: an `f64`, the [`Lanes`] of several rays, or a number that carries derivatives.
//! [`Dual`] carries one first derivative, [`Jet`] the derivatives by x and y up to the second. A `Jet` of `Dual`s
//! carries the derivatives of slopes and curvature by one more number.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use crate::lanes::Lanes;

/// The operations that formulas of surfaces need.
pub(crate) trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// A constant of the same kind.
    fn constant(self, value: f64) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
}

impl Real for f64 {
    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
}

impl<S: Simd> Real for Lanes<S> {
    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Lanes::constant(self, value)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Lanes::sqrt(self)
    }
}

/// A value and its derivative by one number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dual<R> {
    pub value: R,
    pub by: R,
}

impl<R: Real> Dual<R> {
    /// The number by which the derivative is taken.
    #[inline(always)]
    pub fn variable(value: R) -> Self {
        Self { value, by: value.constant(1.0) }
    }

    /// A constant.
    #[inline(always)]
    pub fn fixed(value: R) -> Self {
        Self { value, by: value.constant(0.0) }
    }
}

impl<R: Real> Real for Dual<R> {
    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Self::fixed(self.value.constant(value))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Self { value: root, by: self.by * 0.5 / root }
    }
}

impl<R: Real> Add for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self { value: self.value + b.value, by: self.by + b.by }
    }
}

impl<R: Real> Sub for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self { value: self.value - b.value, by: self.by - b.by }
    }
}

impl<R: Real> Mul for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self { value: self.value * b.value, by: self.by * b.value + self.value * b.by }
    }
}

impl<R: Real> Div for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        let value = self.value / b.value;
        Self { value, by: (self.by - value * b.by) / b.value }
    }
}

impl<R: Real> Neg for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, by: -self.by }
    }
}

impl<R: Real> Add<f64> for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: f64) -> Self {
        Self { value: self.value + b, by: self.by }
    }
}

impl<R: Real> Sub<f64> for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: f64) -> Self {
        Self { value: self.value - b, by: self.by }
    }
}

impl<R: Real> Mul<f64> for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: f64) -> Self {
        Self { value: self.value * b, by: self.by * b }
    }
}

/// A function of x and y at a point, with its derivatives up to the second.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jet<R> {
    pub value: R,
    /// By x, by y.
    pub slope: [R; 2],
    /// By xx, xy, yy.
    pub second: [R; 3],
}

impl<R: Real> Jet<R> {
    /// The functions x and y at a point.
    #[inline(always)]
    pub fn axes([x, y]: [R; 2]) -> [Self; 2] {
        let (zero, one) = (x.constant(0.0), x.constant(1.0));
        [
            Self { value: x, slope: [one, zero], second: [zero; 3] },
            Self { value: y, slope: [zero, one], second: [zero; 3] },
        ]
    }

    /// A function f of the jet, from f, f' and f'' at its value.
    #[inline(always)]
    fn chain(self, f: R, first: R, second: R) -> Self {
        let [x, y] = self.slope;
        let [xx, xy, yy] = self.second;
        Self {
            value: f,
            slope: [first * x, first * y],
            second: [second * x * x + first * xx, second * x * y + first * xy, second * y * y + first * yy],
        }
    }
}

impl<R: Real> Jet<Dual<R>> {
    /// The derivative of the jet by the number of its dual parts.
    #[inline(always)]
    pub fn moved(self) -> Jet<R> {
        let [x, y] = self.slope;
        let [xx, xy, yy] = self.second;
        Jet { value: self.value.by, slope: [x.by, y.by], second: [xx.by, xy.by, yy.by] }
    }
}

impl<R: Real> Real for Jet<R> {
    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        let zero = self.value.constant(0.0);
        Self { value: self.value.constant(value), slope: [zero; 2], second: [zero; 3] }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        let first = self.value.constant(0.5) / root;
        self.chain(root, first, -(first * 0.5) / self.value)
    }
}

impl<R: Real> Add for Jet<R> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        let ([x, y], [u, v]) = (self.slope, b.slope);
        let ([xx, xy, yy], [uu, uv, vv]) = (self.second, b.second);
        Self { value: self.value + b.value, slope: [x + u, y + v], second: [xx + uu, xy + uv, yy + vv] }
    }
}

impl<R: Real> Neg for Jet<R> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self * -1.0
    }
}

impl<R: Real> Sub for Jet<R> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self + -b
    }
}

impl<R: Real> Mul for Jet<R> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        let (f, g) = (self.value, b.value);
        let ([x, y], [u, v]) = (self.slope, b.slope);
        let ([xx, xy, yy], [uu, uv, vv]) = (self.second, b.second);
        Self {
            value: f * g,
            slope: [x * g + f * u, y * g + f * v],
            second: [
                xx * g + x * u * 2.0 + f * uu,
                xy * g + x * v + y * u + f * uv,
                yy * g + y * v * 2.0 + f * vv,
            ],
        }
    }
}

impl<R: Real> Div for Jet<R> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        let per = b.value.constant(1.0) / b.value;
        let square = per * per;
        self * b.chain(per, -square, square * per * 2.0)
    }
}

impl<R: Real> Add<f64> for Jet<R> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: f64) -> Self {
        Self { value: self.value + b, ..self }
    }
}

impl<R: Real> Sub<f64> for Jet<R> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: f64) -> Self {
        self + -b
    }
}

impl<R: Real> Mul<f64> for Jet<R> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: f64) -> Self {
        let [x, y] = self.slope;
        let [xx, xy, yy] = self.second;
        Self { value: self.value * b, slope: [x * b, y * b], second: [xx * b, xy * b, yy * b] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn formula<R: Real>(x: R, y: R) -> R {
        (x * x * y + 3.0 - x / (y + 2.0)).sqrt() * (y - 0.5) - x * 2.0
    }

    #[test]
    fn jets_match_central_differences() {
        let (at, h) = ([0.7, 0.4], 1e-4);
        let f = |i: f64, j: f64| formula(at[0] + i * h, at[1] + j * h);
        let [x, y] = Jet::axes(at);
        let jet = formula(x, y);
        assert!((jet.value - f(0.0, 0.0)).abs() < 1e-15);
        assert!((jet.slope[0] - (f(1.0, 0.0) - f(-1.0, 0.0)) / (2.0 * h)).abs() < 1e-7);
        assert!((jet.slope[1] - (f(0.0, 1.0) - f(0.0, -1.0)) / (2.0 * h)).abs() < 1e-7);
        let cross = (f(1.0, 1.0) - f(1.0, -1.0) - f(-1.0, 1.0) + f(-1.0, -1.0)) / (4.0 * h * h);
        let along = |a: f64, b: f64| (f(a, b) - 2.0 * f(0.0, 0.0) + f(-a, -b)) / (h * h);
        for (exact, numeric) in jet.second.into_iter().zip([along(1.0, 0.0), cross, along(0.0, 1.0)]) {
            assert!((exact - numeric).abs() < 1e-6, "{exact} {numeric}");
        }
    }

    #[test]
    fn a_jet_of_duals_says_how_the_jet_moves() {
        // d/dp of p^2 x sqrt(y) + p y and of its slopes.
        let (x, y, p) = (0.3, 1.7, 0.9);
        let lift = |v: f64| Dual::fixed(v);
        let [jx, jy] = Jet::axes([lift(x), lift(y)]);
        let number = Jet { value: Dual::variable(p), ..jx.constant(0.0) };
        let moved = (number * number * jx * jy.sqrt() + number * jy).moved();
        let root = y.sqrt();
        assert!((moved.value - (2.0 * p * x * root + y)).abs() < 1e-14);
        assert!((moved.slope[0] - 2.0 * p * root).abs() < 1e-14);
        assert!((moved.slope[1] - (p * x / root + 1.0)).abs() < 1e-14);
        assert!((moved.second[2] + 0.5 * p * x / (root * y)).abs() < 1e-14);
    }
}
