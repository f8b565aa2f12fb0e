//! The way of an edge through its region: a straight line or a smooth curve, and the distances of pixels from it.

/// `x = sum_k c_k u^k` with `u = (y - middle) / half`: a polynomial along the edge, in pixels.
#[derive(Clone, Debug)]
pub struct Path {
    pub coefficients: Vec<f64>,
    middle: f64,
    half: f64,
}

/// Where a point lies beside a path.
#[derive(Clone, Copy, Debug)]
pub struct Beside {
    /// Distance, perpendicular to the path, pixels; positive to the right.
    pub distance: f64,
    /// `u` of the nearest point of the path.
    pub u: f64,
    /// Pixels of distance that a pixel of shift in x makes: the cosine of the path's inclination there.
    pub cosine: f64,
}

impl Path {
    /// The straight path through `x` in the middle of so many rows.
    pub fn straight(x: f64, slope: f64, rows: usize) -> Self {
        let half = 0.5 * rows as f64;
        Self { coefficients: vec![x, slope * half], middle: half, half }
    }

    /// The path with other coefficients.
    pub fn with(&self, coefficients: &[f64]) -> Self {
        Self { coefficients: coefficients.to_vec(), ..*self }
    }

    /// Degree of the polynomial.
    pub fn degree(&self) -> usize {
        self.coefficients.len() - 1
    }

    /// Value and first two derivatives by `y`.
    fn derivatives(&self, y: f64) -> [f64; 3] {
        let u = (y - self.middle) / self.half;
        let mut of_u = [0.0; 3];
        for c in self.coefficients.iter().rev() {
            of_u[2] = of_u[2] * u + of_u[1];
            of_u[1] = of_u[1] * u + of_u[0];
            of_u[0] = of_u[0] * u + c;
        }
        [of_u[0], of_u[1] / self.half, 2.0 * of_u[2] / (self.half * self.half)]
    }

    /// Where the path crosses a row.
    pub fn at(&self, y: f64) -> f64 {
        self.derivatives(y)[0]
    }

    /// Slope in the middle of the region, dx / dy.
    pub fn slope(&self) -> f64 {
        self.derivatives(self.middle)[1]
    }

    /// Place of a point beside the path. The foot of the perpendicular solves `(x - p(t)) p'(t) + y - t = 0`.
    pub fn beside(&self, [x, y]: [f64; 2]) -> Beside {
        let mut t = y;
        let steps = if self.degree() > 1 { 3 } else { 1 };
        for _ in 0..steps {
            let [p, slope, bend] = self.derivatives(t);
            let change = -1.0 - slope * slope + (x - p) * bend;
            // Far from a strong curve the foot is not unique: stay with the straight guess.
            let change = if change < -0.2 { change } else { -1.0 - slope * slope };
            t -= ((x - p) * slope + y - t) / change;
        }
        let [p, slope, _] = self.derivatives(t);
        let cosine = 1.0 / (1.0 + slope * slope).sqrt();
        Beside { distance: (x - p) / cosine, u: (t - self.middle) / self.half, cosine }
    }

    /// Side of the path on which a point lies; `None` if it may lie within `px` of the path. The foot of the perpendicular is not computed:
    /// the steepest slope bounds the distance.
    pub fn side_beyond(&self, [x, y]: [f64; 2], px: f64) -> Option<f64> {
        // No slope within the rows is greater than the sum of all terms' slopes there.
        let terms = self.coefficients.iter().enumerate();
        let steepest = terms.map(|(k, c)| k as f64 * c.abs()).sum::<f64>() / self.half;
        let shift = x - self.at(y);
        (shift * shift > px * px * (1.0 + steepest * steepest)).then(|| shift.signum())
    }

    /// Largest distance of the path from the chord between its ends, pixels.
    pub fn sagitta(&self) -> f64 {
        let ends = [self.middle - self.half, self.middle + self.half].map(|y| self.at(y));
        let cosine = 1.0 / ((ends[1] - ends[0]) / (2.0 * self.half)).hypot(1.0);
        let of = |k: usize| {
            let share = k as f64 / 32.0;
            let y = self.middle + self.half * (2.0 * share - 1.0);
            ((self.at(y) - ends[0] - share * (ends[1] - ends[0])) * cosine).abs()
        };
        (0..=32).map(of).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_from_lines_and_circles_are_known() {
        let line = Path::straight(20.0, 0.5, 40);
        let beside = line.beside([25.0, 22.0]);
        assert!((beside.distance - 4.0 / 1.25_f64.sqrt()).abs() < 1e-12, "{beside:?}");
        // A parabola with the curvature of a circle of radius 500 px.
        let curve = line.with(&[20.0, 0.0, 20.0 * 20.0 / 1000.0]);
        assert!((curve.sagitta() - 0.4).abs() < 1e-9);
        for [x, y] in [[30.0, 10.0], [8.0, 35.0]] {
            let from_centre = (x - 520.0_f64).hypot(y - 20.0);
            let distance = 500.0 - from_centre;
            assert!((curve.beside([x, y]).distance - distance).abs() < 2e-3, "{x} {y}");
            assert_eq!(curve.side_beyond([x, y], distance.abs() + 0.1), None);
            assert_eq!(curve.side_beyond([x, y], 0.9 * distance.abs()), Some(distance.signum()));
        }
    }
}
