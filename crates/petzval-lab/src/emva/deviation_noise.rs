//! Noise of the deviations from the line of linearity, and what it adds to their extremes.
//!
//! The line is fitted to the points that it is compared with, so that the deviations are `d = 100 (1 - H) y / (H y)`, with the weights `H` of the
//! ordinates in the line. Their errors are those of `y` through `1 - H`: smaller than those of the points, and correlated.
//!
//! The largest of several deviations is above zero by noise alone, 1.3 standard errors of six points. It is freed of that by drawing: with the
//! response `r`, the mean of `max(r + noise) - max(r)` is what noise adds, and the scatter of `max(r + noise)` is the standard error. `r` is zero
//! where the points lie on the line within their noise, and otherwise `f d`: `f = 1 - 1 / reduced chi^2` is the share of the deviations that is
//! not noise (James and Stein 1961).
//!
//! The extremes of the points themselves are what EMVA 1288 states. The root mean square of `max(r + noise) - max(r)` is their standard error: it
//! contains what noise adds.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::goodness::{FitTest, Points};
use super::measured::{Measured, Unresolved};

/// The noise of the deviations of a series.
pub(super) struct DeviationNoise {
    /// Errors of the points.
    points: Points,
    /// By point: percent of deviation per unit of each ordinate.
    weights: Vec<Vec<f64>>,
    /// First and last point of the line.
    range: (usize, usize),
}

/// Least and largest deviation, percent.
pub(super) struct Extremes {
    /// Of the points; the errors contain what noise adds to extremes.
    pub of_points: [Measured; 2],
    /// Of the response. Unbiased, so that those of a straight response lie on either side of zero.
    pub of_response: [Measured; 2],
}

impl Extremes {
    /// No extremes.
    pub(super) fn none(why: Unresolved) -> Self {
        Self { of_points: [Measured::none(why); 2], of_response: [Measured::none(why); 2] }
    }
}

/// Draws of the noise. Their own scatter adds a thousandth to the standard error.
const DRAWS: usize = 500;

/// Probability of the points' deviations by noise below which the response has deviations of its own.
const DEPARTS: f64 = 0.01;

impl DeviationNoise {
    /// The noise of deviations of all points, signal over light, from the line `[offset, slope]` through the points of a range, with weights of one over the squared signal.
    pub(super) fn of(points: Points, range: (usize, usize), [offset_dn, slope]: [f64; 2]) -> Self {
        let (x, signal) = (&points.x, &points.y);
        let is_within = |j: usize| (range.0..=range.1).contains(&j);
        let w = |j: usize| if is_within(j) { signal[j].powi(-2) } else { 0.0 };
        let total: f64 = (0..x.len()).map(w).sum();
        let middle = (0..x.len()).map(|j| w(j) * x[j]).sum::<f64>() / total;
        let sxx: f64 = (0..x.len()).map(|j| w(j) * (x[j] - middle).powi(2)).sum();
        let of_line = |i: usize, j: usize| w(j) * (1.0 / total + (x[i] - middle) * (x[j] - middle) / sxx);
        let weights = (0..x.len())
            .map(|i| {
                let percent = match offset_dn + slope * x[i] {
                    0.0 => 0.0,
                    fitted => 100.0 / fitted,
                };
                let own = |j: usize| if i == j { 1.0 } else { 0.0 };
                (0..x.len()).map(|j| percent * (own(j) - of_line(i, j))).collect()
            })
            .collect();
        Self { points, weights, range }
    }

    /// Standard error of each deviation, percent.
    pub(super) fn errors(&self) -> Vec<f64> {
        self.weights.iter().map(|weights| self.points.error_of(weights)).collect()
    }

    /// Least and largest deviation, percent, from those of the points of the range and the test of their line.
    pub(super) fn extremes(&self, found_percent: &[f64], test: &FitTest) -> Extremes {
        let departs = test.p_value.min(test.curvature_p_value.unwrap_or(1.0)) < DEPARTS;
        let share = if departs { (1.0 - 1.0 / test.reduced_chi2).max(0.0) } else { 0.0 };
        let response: Vec<f64> = found_percent.iter().map(|d| share * d).collect();
        let extremes = |d: &mut dyn Iterator<Item = f64>| {
            d.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], d| [low.min(d), high.max(d)])
        };
        let of_response = extremes(&mut response.iter().copied());
        let found = extremes(&mut found_percent.iter().copied());

        // Draw the noise of the points, take it through the line, and see what it does to the extremes.
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let (mut sum, mut squares) = ([0.0; 2], [0.0; 2]);
        for _ in 0..DRAWS {
            let y = self.points.draw(&mut rng);
            let drawn = (self.range.0..=self.range.1).zip(&response).map(|(i, response)| {
                response + self.weights[i].iter().zip(&y).map(|(w, y)| w * y).sum::<f64>()
            });
            let drawn = extremes(&mut drawn.into_iter());
            for k in 0..2 {
                let added = drawn[k] - of_response[k];
                sum[k] += added;
                squares[k] += added * added;
            }
        }
        let draws = DRAWS as f64;
        let of_response = [0, 1].map(|k| {
            let added = sum[k] / draws;
            let error = (squares[k] / draws - added * added).max(0.0).sqrt();
            Measured::new(found[k] - added, error)
        });
        let of_points = [0, 1].map(|k| Measured::new(found[k], (squares[k] / draws).sqrt()));
        Extremes { of_points, of_response }
    }
}
