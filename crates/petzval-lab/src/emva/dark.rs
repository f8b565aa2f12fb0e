//! The dark series of one gain: the growth of mean and variance of dark frames with exposure time.
//!
//! ```text
//! mean     = K (mu_I t + mu_r) + BL + mu_el                  [DN]
//! variance = K^2 (mu_I t + sigma_r^2) + sigma_el^2 + g^2/12  [DN^2]
//! ```
//!
//! where digital numbers are `g` apart: 1 DN, but for compressed or left-aligned ones.

use schemars::JsonSchema;
use serde::Serialize;

use super::fit::{Line, TestedLine, tested_line};
use super::goodness::{Departure, FitTest, Verdict};
use super::measured::Unresolved;
use super::point::{LeftOut, Moments};
use super::rounding::RoundingError;

/// Dark frames of one exposure time.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DarkPoint {
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Mean, DN.
    pub mean_dn: f64,
    /// Its standard error, rounding included, DN.
    pub mean_se_dn: f64,
    /// Temporal variance, DN^2.
    pub variance_dn2: f64,
    /// Its standard error, rounding included, DN^2.
    pub variance_se_dn2: f64,
    /// Distance of the digital numbers in the dark, DN.
    #[serde(skip)]
    pub step_dn: f64,
}

impl DarkPoint {
    /// Makes a point from the moments of dark frames; `mean_difference` as in [`super::transfer::TransferPoint::new`]. Their
    /// numbers are `step_dn` apart. The noise of rows and columns that whole frames have in common is no flicker, and counts.
    pub fn new(exposure_s: f64, dark: &Moments, mean_difference: bool, step_dn: f64) -> Self {
        let rounding = RoundingError::of(dark.variance_dn2, step_dn);
        Self {
            exposure_s,
            mean_dn: dark.mean_dn,
            mean_se_dn: dark.mean_se_dn.hypot(rounding.mean_dn),
            variance_dn2: if mean_difference {
                dark.variance_dn2 + dark.lines_of_frame_dn2
            } else {
                dark.variance_uncorrected_dn2
            },
            variance_se_dn2: dark.variance_se_dn2.hypot(rounding.variance_dn2),
            step_dn,
        }
    }

    /// The point with the mean of the bulk of its pixels: hot pixels that fill bend no line through such points.
    pub(super) fn of_bulk(self, dark: &Moments) -> Self {
        Self { mean_dn: dark.bulk_mean_dn(), ..self }
    }

    /// The point without the pixels that answer neither light nor exposure time.
    pub(super) fn without(self, left_out: LeftOut) -> Self {
        Self {
            mean_dn: self.mean_dn + left_out.mean_dn,
            variance_dn2: self.variance_dn2 + left_out.variance_dn2,
            ..self
        }
    }
}

/// A dark series with its fitted lines.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DarkSeries {
    /// The points, exposure times ascending.
    pub points: Vec<DarkPoint>,
    /// Mean over exposure time: DN/s and DN.
    pub mean: Line,
    /// Variance over exposure time: DN^2/s and DN^2.
    pub variance: Line,
    /// Whether the means lie on their line.
    pub mean_test: FitTest,
    /// Whether the variances lie on theirs.
    pub variance_test: FitTest,
    /// The line of the mean with errors of noise alone: what a departure of the points is judged by.
    #[serde(skip)]
    pub mean_by_noise: Line,
    /// What the departure of the means from their line adds to the errors of intercept and slope.
    #[serde(skip)]
    pub mean_departure: Departure,
}

impl DarkSeries {
    /// Distance of the digital numbers in the dark, DN.
    pub(super) fn step_dn(&self) -> f64 {
        step_dn(&self.points)
    }

    /// Standard error that the departure of the means from their line adds to a slope between two points alone, `span_s` apart, DN/s: the
    /// scatter beyond noise at both ends, and the bend.
    pub(super) fn departure_of_ends(&self, span_s: f64) -> f64 {
        let squares: f64 = self.points.iter().map(|p| p.mean_se_dn.powi(2)).sum();
        let of_noise_dn = (squares / self.points.len().max(1) as f64).sqrt();
        self.mean_departure.error(1, 2.0_f64.sqrt() * of_noise_dn / span_s)
    }
}

/// Distance of the digital numbers of points, DN.
fn step_dn(points: &[DarkPoint]) -> f64 {
    points.iter().map(|p| p.step_dn).fold(1.0, f64::max)
}

/// Least number of exposure times for a slope.
const EXPOSURES: usize = 3;

/// Fits ordinary least-squares lines through a dark series.
pub fn dark_series(mut points: Vec<DarkPoint>) -> DarkSeries {
    points.sort_by(|a, b| a.exposure_s.total_cmp(&b.exposure_s));
    let mut times: Vec<f64> = points.iter().map(|p| p.exposure_s).collect();
    let of = |f: fn(&DarkPoint) -> f64| points.iter().map(f).collect::<Vec<f64>>();
    let fit = |y: Vec<f64>, se: Vec<f64>| tested_line(&times, &y, &vec![1.0; times.len()], &se);
    let (mut mean, mut variance) = (
        fit(of(|p| p.mean_dn), of(|p| p.mean_se_dn)),
        fit(of(|p| p.variance_dn2), of(|p| p.variance_se_dn2)),
    );
    times.dedup();
    if times.len() < EXPOSURES {
        let line = Line::none(Unresolved::TooFewExposures { got: times.len(), need: EXPOSURES });
        for fit in [&mut mean, &mut variance] {
            let test = FitTest { verdict: Verdict::Untested, model_error: 0.0, ..fit.test };
            *fit = TestedLine { line, by_noise: line, test, ..*fit };
        }
    }
    let step_dn = step_dn(&points);
    // Rounding shifts all points alike if their means have the same fraction of a digital number; otherwise it bends
    // the lines.
    if let Some(noise) = variance.line.intercept.value() {
        let rounding = RoundingError::of(noise, step_dn);
        let span_s = times[times.len() - 1] - times[0];
        let bent = 2.0_f64.sqrt() / span_s;
        let with = |line: Line, error: f64| Line {
            slope: line.slope.with_error(bent * error),
            intercept: line.intercept.with_error(error),
        };
        mean.line = with(mean.line, rounding.mean_dn);
        mean.by_noise = with(mean.by_noise, rounding.mean_dn);
        variance.line = with(variance.line, rounding.variance_dn2);
    }
    DarkSeries {
        points,
        mean: mean.line,
        variance: variance.line,
        mean_test: mean.test,
        variance_test: variance.test,
        mean_by_noise: mean.by_noise,
        mean_departure: mean.departure,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_further_apart_add_no_error_where_noise_smooths_their_steps() {
        let point = |i: u32| DarkPoint {
            exposure_s: f64::from(i),
            mean_dn: 64.0,
            mean_se_dn: 0.01,
            variance_dn2: 64.0,
            variance_se_dn2: 0.01,
            step_dn: 4.0,
        };
        let intercept = dark_series((0..6).map(point).collect()).variance.intercept;
        assert!(intercept.standard_error().unwrap() < 0.02, "{intercept:?}");
    }

    #[test]
    fn points_off_their_line_count_at_both_ends() {
        let of = |off_dn: [f64; 6]| {
            let point = |(i, off): (usize, f64)| DarkPoint {
                exposure_s: i as f64,
                mean_dn: 64.0 + 2.0 * i as f64 + off,
                mean_se_dn: 0.01,
                variance_dn2: 4.0,
                variance_se_dn2: 0.01,
                step_dn: 1.0,
            };
            dark_series(off_dn.into_iter().enumerate().map(point).collect())
        };
        assert_eq!(of([0.0; 6]).departure_of_ends(5.0), 0.0);
        // Offsets of half a digital number make an error of 0.5 sqrt(2) / 5 s, and a fifth more for few points.
        let drifts = of([0.5, -0.5, -0.5, 0.5, -0.5, 0.5]);
        assert_eq!(drifts.mean_test.verdict, Verdict::Widened);
        let error = drifts.departure_of_ends(5.0);
        assert!((0.12..0.25).contains(&error), "{error}");
    }
}
