//! A smooth curve through scattered points: cubic B-splines by least squares.
//!
//! The points are not binned. A penalty on the fourth differences of the coefficients, far below what the data say, bridges gaps between
//! the points as a spline of seventh degree would.

/// Knots in a pixel: the spline follows frequencies up to two cycles per pixel.
pub const KNOTS_PER_PIXEL: usize = 4;

/// Rows of the penalty: `c_i - 4 c_(i+1) + 6 c_(i+2) - 4 c_(i+3) + c_(i+4)`.
const DIFFERENCE: [f64; 5] = [1.0, -4.0, 6.0, -4.0, 1.0];

/// Band of the normal equations.
const BAND: usize = 5;

/// Uniform cubic splines over `-half..half` pixels.
#[derive(Clone, Copy, Debug)]
pub struct Basis {
    pub half: usize,
}

impl Basis {
    /// Number of coefficients.
    pub fn len(self) -> usize {
        2 * self.half * KNOTS_PER_PIXEL + 3
    }

    /// The first of the four splines at a place, and how far it lies between two knots; none outside.
    fn place(self, at: f64) -> Option<(usize, f64)> {
        let knots = (at + self.half as f64) * KNOTS_PER_PIXEL as f64;
        let first = knots.floor();
        let last = (2 * self.half * KNOTS_PER_PIXEL) as f64;
        if !(0.0..=last).contains(&knots) {
            return None;
        }
        let first = first.min(last - 1.0);
        Some((first as usize, knots - first))
    }

    /// The first of the four splines that are not zero at a place, and their values; none outside.
    pub fn values(self, at: f64) -> Option<(usize, [f64; 4])> {
        let (first, t) = self.place(at)?;
        let s = 1.0 - t;
        let middle = |t: f64| (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0;
        Some((first, [s * s * s / 6.0, middle(t), middle(s), t * t * t / 6.0]))
    }

    /// Their derivatives, per pixel.
    pub fn slopes(self, at: f64) -> Option<(usize, [f64; 4])> {
        let (first, t) = self.place(at)?;
        let (s, per_px) = (1.0 - t, KNOTS_PER_PIXEL as f64);
        let middle = |t: f64| -2.0 * t + 1.5 * t * t;
        Some((first, [-0.5 * s * s, middle(t), -middle(s), 0.5 * t * t].map(|v| per_px * v)))
    }

    /// Position of the middle of a spline. The coefficients of a straight line are its values at these positions.
    pub fn centre(self, coefficient: usize) -> f64 {
        (coefficient as f64 - 1.0) / KNOTS_PER_PIXEL as f64 - self.half as f64
    }
}

/// A curve.
#[derive(Clone, Debug)]
pub struct Spline {
    pub basis: Basis,
    pub coefficients: Vec<f64>,
}

impl Spline {
    pub fn at(&self, place: f64) -> Option<f64> {
        let (first, values) = self.basis.values(place)?;
        Some((0..4).map(|k| values[k] * self.coefficients[first + k]).sum())
    }

    pub fn slope(&self, place: f64) -> Option<f64> {
        let (first, slopes) = self.basis.slopes(place)?;
        Some((0..4).map(|k| slopes[k] * self.coefficients[first + k]).sum())
    }
}

/// The normal equations, factored: `G = sum_i B_i B_i^T + weight D^T D = L L^T`.
pub struct Factor {
    /// `L`, a band: entry `[i][k]` is in column `i - k`.
    lower: Vec<[f64; BAND]>,
}

impl Factor {
    /// The factor of the points at these places.
    pub fn of(basis: Basis, places: impl Iterator<Item = f64>, weight: f64) -> Self {
        let count = basis.len();
        let mut g = vec![[0.0; BAND]; count];
        for (first, values) in places.filter_map(|at| basis.values(at)) {
            for i in 0..4 {
                for j in 0..=i {
                    g[first + i][i - j] += values[i] * values[j];
                }
            }
        }
        for first in 0..count.saturating_sub(4) {
            for i in 0..5 {
                for j in 0..=i {
                    g[first + i][i - j] += weight * DIFFERENCE[i] * DIFFERENCE[j];
                }
            }
        }
        let floor = 1e-12 * g.iter().map(|row| row[0]).fold(1e-300, f64::max);
        for i in 0..count {
            for k in (0..BAND.min(i + 1)).rev() {
                let j = i - k;
                let done = (k + 1..BAND).filter(|m| *m <= i).map(|m| g[i][m] * g[j][m - k]).sum::<f64>();
                g[i][k] = if k > 0 { (g[i][k] - done) / g[j][0] } else { (g[i][0] - done).max(floor).sqrt() };
            }
        }
        Self { lower: g }
    }

    /// Solves `G c = right`.
    pub fn solve(&self, mut right: Vec<f64>) -> Vec<f64> {
        let count = right.len();
        for i in 0..count {
            let done: f64 = (1..BAND).filter(|k| *k <= i).map(|k| self.lower[i][k] * right[i - k]).sum();
            right[i] = (right[i] - done) / self.lower[i][0];
        }
        for i in (0..count).rev() {
            let done: f64 =
                (1..BAND).filter(|k| i + k < count).map(|k| self.lower[i + k][k] * right[i + k]).sum();
            right[i] = (right[i] - done) / self.lower[i][0];
        }
        right
    }
}

/// Sums `B_i v_i` of scattered values: the right-hand side of the normal equations.
pub fn gathered(basis: Basis, points: impl Iterator<Item = (f64, f64)>) -> Vec<f64> {
    let mut sums = vec![0.0; basis.len()];
    for (at, value) in points {
        if let Some((first, values)) = basis.values(at) {
            for k in 0..4 {
                sums[first + k] += values[k] * value;
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_comes_out_again_over_gaps() {
        let basis = Basis { half: 6 };
        let of = |x: f64| 1.0 + 0.5 * x - 0.03 * x * x + 0.004 * x * x * x;
        // Points 0.7 pixels apart, and none between 1 and 2.5.
        let places: Vec<f64> =
            (0..17).map(|i| -5.9 + 0.7 * f64::from(i)).filter(|x| !(1.0..2.5).contains(x)).collect();
        let factor = Factor::of(basis, places.iter().copied(), 1e-5);
        let right = gathered(basis, places.iter().map(|x| (*x, of(*x))));
        let spline = Spline { basis, coefficients: factor.solve(right) };
        for i in 0..40 {
            let x = -5.5 + 0.27 * f64::from(i);
            assert!((spline.at(x).unwrap() - of(x)).abs() < 1e-6, "{x}");
            let slope = 0.5 - 0.06 * x + 0.012 * x * x;
            assert!((spline.slope(x).unwrap() - slope).abs() < 1e-5, "{x}");
        }
        assert_eq!(spline.at(6.1), None);
    }
}
