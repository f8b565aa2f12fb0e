//! Errors of mean and variance by rounding to whole digital numbers, beyond the `1/12` of the variance.
//!
//! Rounding a normal distribution of mean m and variance s^2 adds to its variance `1/12` and, by Poisson's summation formula,
//!
//! ```text
//! variance:  sum_k 4 (-1)^k exp(-2 pi^2 k^2 s^2) (s^2 + 1/(4 pi^2 k^2)) cos(2 pi k m)    [DN^2]
//! mean:      sum_k   (-1)^k exp(-2 pi^2 k^2 s^2) sin(2 pi k m) / (pi k)                  [DN]
//! ```
//!
//! (minus the square of the mean's part, which is smaller): zero at s = 1 DN, up to 0.017 DN^2 at 0.45 DN and 0.044 at
//! 0.37. The captures do not determine well enough where m lies between two whole numbers, so these are errors of random
//! phase.
//!
//! Rounding also changes by how much pixels or rows seem to differ: [`Steps`].
//!
//! Numbers that lie `g` apart, as compressed or left-aligned ones do, are whole numbers in units of `g`. Their rounding adds `g^2 / 12` to the
//! variance, which is subtracted in place of `1/12`.

/// Variance of rounding to whole digital numbers, DN^2.
pub const QUANTISATION_DN2: f64 = 1.0 / 12.0;
/// Temporal dark variance below which the noise of the converter dominates, DN^2 (release 3.1, Sec. 6.6).
pub(super) const LEAST_DARK_VARIANCE_DN2: f64 = 0.24;

/// Standard errors by rounding.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RoundingError {
    /// Standard error of a mean, DN.
    pub mean_dn: f64,
    /// Standard error of `variance - step^2 / 12` as the variance before rounding, DN^2.
    pub variance_dn2: f64,
}

impl RoundingError {
    /// Errors for frames with this temporal variance after rounding, DN^2, to numbers `step_dn` apart.
    pub fn of(variance_dn2: f64, step_dn: f64) -> Self {
        let unit_dn2 = step_dn * step_dn;
        let noise = least_noise_dn2(variance_dn2 / unit_dn2);
        Self { mean_dn: step_dn * of_mean_dn(noise), variance_dn2: unit_dn2 * of_variance_dn2(noise) }
    }
}

/// Variance of rounding to numbers `step_dn` apart, DN^2.
pub(super) fn rounding_dn2(step_dn: f64) -> f64 {
    step_dn * step_dn * QUANTISATION_DN2
}

/// Variance of rounding to numbers `step_dn` apart above that of whole numbers, DN^2.
pub(super) fn coarse_rounding_dn2(step_dn: f64) -> f64 {
    (step_dn * step_dn - 1.0) * QUANTISATION_DN2
}

/// The mean reading of a pixel over its level `x`, the steps of the converter smoothed by noise: `x + b(x)` with
/// `b(x) = sum_k c_k sin(2 pi k x)`, the mean's harmonics above.
///
/// Levels of the variance `v` that are normally distributed about `m` (those of pixels, or of one row from frame to frame) are read with
/// the variance
///
/// ```text
/// found(v, m) = v + 2 cov(x, b) + var(b)                 [DN^2]
/// ```
///
/// which is far below `v` where all levels are near one digital number, and far above it where they are half-way between two.
pub struct Steps {
    /// Distance of two numbers, DN: the unit of what follows.
    step_dn: f64,
    /// Variance of the noise before rounding, steps^2.
    noise_dn2: f64,
    /// c_k, steps.
    amplitudes: Vec<f64>,
}

/// Phases, evenly over the half of a step that is not a mirror image of the other half.
const PHASES: usize = 16;

/// Least noise of the model, DN^2: the steps behind 0.05 DN are as sharp as those behind none, and need [`HARMONICS`] terms.
const SHARPEST_DN2: f64 = 0.05 * 0.05;

impl Steps {
    /// The steps between numbers `step_dn` apart behind noise that has this variance after rounding, DN^2, as sharp as they may be.
    pub fn behind(variance_dn2: f64, step_dn: f64) -> Self {
        Self { step_dn, ..Self::behind_noise(least_noise_dn2(variance_dn2 / (step_dn * step_dn))) }
    }

    /// The steps between whole numbers behind noise of this variance before rounding, DN^2.
    fn behind_noise(noise_dn2: f64) -> Self {
        let amplitude = |k: i32| {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            let k = f64::from(k);
            sign * harmonic(k, noise_dn2.max(SHARPEST_DN2)) / (std::f64::consts::PI * k)
        };
        let amplitudes = (1..=HARMONICS).map(amplitude).take_while(|c| c.abs() > 1e-9).collect();
        Self { step_dn: 1.0, noise_dn2, amplitudes }
    }

    /// Standard error by rounding of a measured variance that has another error as well, DN^2. It is the root mean square distance from the
    /// measured value to the true variances that would be measured like this, over all phases.
    ///
    /// It is not proportional to the variance that is found. Between two steps a small variance is not found at all, and its size stays
    /// unknown up to the width of the steps.
    pub fn error_of_variance(&self, found_dn2: f64, standard_error_dn2: f64) -> f64 {
        let unit_dn2 = self.step_dn * self.step_dn;
        let level = (found_dn2.max(0.0) + standard_error_dn2) / unit_dn2;
        let squares = self.variances_found_as(level).map(|v| (v - level).powi(2)).sum::<f64>();
        unit_dn2 * (squares / PHASES as f64).sqrt()
    }

    /// The steps for the mean over pixels whose levels vary with a measured variance, DN^2. This variance smooths the steps further. Of the
    /// true variances that would be measured like this, the least is taken.
    pub fn smoothed_by(&self, found_dn2: f64) -> Self {
        let found = found_dn2.max(0.0) / (self.step_dn * self.step_dn);
        let least = self.variances_found_as(found).fold(f64::INFINITY, f64::min);
        Self { step_dn: self.step_dn, ..Self::behind_noise(self.noise_dn2 + least) }
    }

    /// For each phase, the true variance that would be measured as `found_dn2`, steps^2.
    fn variances_found_as(&self, found_dn2: f64) -> impl Iterator<Item = f64> {
        let phase = |i: usize| 0.5 * (i as f64 + 0.5) / PHASES as f64;
        (0..PHASES).map(phase).map(move |phase| {
            // Readings are within half a step of the levels, and so is one standard deviation of the other.
            let (mut low, mut high) = (0.0, (found_dn2.sqrt() + 0.5).powi(2));
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                *(if self.found_dn2(middle, phase) > found_dn2 { &mut high } else { &mut low }) = middle;
            }
            0.5 * (low + high)
        })
    }

    /// `found(v, m)` of the formula above, steps^2.
    fn found_dn2(&self, v: f64, m: f64) -> f64 {
        let turn = std::f64::consts::TAU;
        let terms = 2 * self.amplitudes.len() + 1;
        // The mean of cos(2 pi k x) over the levels.
        let cosines: Vec<f64> =
            (0..terms).map(|k| k as f64).map(|k| harmonic(k, v) * (turn * k * m).cos()).collect();
        let (mut covariance, mut mean, mut square) = (0.0, 0.0, 0.0);
        for (j, c) in (1..).zip(&self.amplitudes) {
            let k = f64::from(j as u32);
            covariance += c * v * turn * k * cosines[j];
            mean += c * harmonic(k, v) * (turn * k * m).sin();
            for (l, other) in (1..).zip(&self.amplitudes) {
                square += 0.5 * c * other * (cosines[j.abs_diff(l)] - cosines[j + l]);
            }
        }
        v + 2.0 * covariance + square - mean * mean
    }
}

/// Number of harmonics in the sums: without noise the neglected rest is 3 %.
const HARMONICS: i32 = 20;

/// Standard error of the variance for normal noise of the variance `noise_dn2` before rounding, DN^2.
fn of_variance_dn2(noise_dn2: f64) -> f64 {
    of_random_phase(|k| {
        4.0 * harmonic(k, noise_dn2) * (noise_dn2 + (2.0 * std::f64::consts::PI * k).powi(-2))
    })
}

/// Standard error of the mean, DN.
fn of_mean_dn(noise_dn2: f64) -> f64 {
    of_random_phase(|k| harmonic(k, noise_dn2) / (std::f64::consts::PI * k))
}

/// `exp(-2 pi^2 k^2 s^2)`: amplitude of the k-th harmonic after smoothing by noise.
fn harmonic(k: f64, noise_dn2: f64) -> f64 {
    (-2.0 * (std::f64::consts::PI * k).powi(2) * noise_dn2).exp()
}

/// Root of the mean square of a sum of harmonics over the phase.
fn of_random_phase(amplitude: impl Fn(f64) -> f64) -> f64 {
    (1..=HARMONICS).map(|k| 0.5 * amplitude(f64::from(k)).powi(2)).sum::<f64>().sqrt()
}

/// The least variance before rounding that agrees with this variance after rounding, DN^2.
fn least_noise_dn2(variance_dn2: f64) -> f64 {
    let mut least = 0.0_f64;
    for _ in 0..50 {
        let most_off = 2.0_f64.sqrt() * of_variance_dn2(least);
        least = (variance_dn2 - QUANTISATION_DN2 - most_off).max(0.0);
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and variance of a normal distribution after rounding to whole numbers.
    fn rounded(mean: f64, sigma: f64) -> (f64, f64) {
        let below = |z: f64| 0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2);
        let p = |y: f64| below((y + 0.5 - mean) / sigma) - below((y - 0.5 - mean) / sigma);
        let moments = |f: fn(f64) -> f64| (-20..=20).map(|y| f(f64::from(y)) * p(f64::from(y))).sum::<f64>();
        let first = moments(|y| y);
        (first, moments(|y| y * y) - first * first)
    }

    #[test]
    fn the_variance_of_rounded_levels_is_that_of_their_readings() {
        for (sigma, spread, mean) in [(0.2, 0.1, 0.0), (0.2, 0.1, 0.5), (0.1, 0.3, 0.2), (0.3, 0.6, 0.9)] {
            // Levels at even quantiles of the normal distribution, by bisection of its distribution function.
            let below = |z: f64| 0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2);
            let quantile = |q: f64| {
                let (mut low, mut high) = (-8.0, 8.0);
                for _ in 0..50 {
                    let middle = 0.5 * (low + high);
                    *(if below(middle) > q { &mut high } else { &mut low }) = middle;
                }
                low
            };
            let n = 4000;
            let level = |i: i32| mean + spread * quantile((f64::from(i) + 0.5) / f64::from(n));
            let readings: Vec<f64> = (0..n).map(|i| rounded(level(i), sigma).0).collect();
            let middle = readings.iter().sum::<f64>() / f64::from(n);
            let variance = readings.iter().map(|r| (r - middle).powi(2)).sum::<f64>() / f64::from(n);
            let found = Steps::behind_noise(sigma * sigma).found_dn2(spread * spread, mean);
            assert!((found / variance - 1.0).abs() < 0.01, "{sigma} {spread} {mean}: {found} {variance}");
        }
    }

    #[test]
    fn numbers_further_apart_are_whole_numbers_of_another_unit() {
        for variance_dn2 in [0.1, 0.2, 0.5] {
            let (whole, coarse) =
                (RoundingError::of(variance_dn2, 1.0), RoundingError::of(16.0 * variance_dn2, 4.0));
            assert!((coarse.mean_dn - 4.0 * whole.mean_dn).abs() < 1e-12, "{variance_dn2}");
            assert!((coarse.variance_dn2 - 16.0 * whole.variance_dn2).abs() < 1e-12, "{variance_dn2}");
            let (fine, wide) = (Steps::behind(variance_dn2, 1.0), Steps::behind(16.0 * variance_dn2, 4.0));
            let (one, other) = (fine.error_of_variance(0.1, 0.01), wide.error_of_variance(1.6, 0.16));
            assert!((other - 16.0 * one).abs() < 1e-9, "{variance_dn2}: {one} {other}");
            let (one, other) = (fine.smoothed_by(0.1), wide.smoothed_by(1.6));
            let [one, other] = [one.error_of_variance(0.1, 0.01), other.error_of_variance(1.6, 0.16)];
            assert!((other - 16.0 * one).abs() < 1e-9, "{variance_dn2}: {one} {other}");
        }
        assert!(rounding_dn2(1.0) == QUANTISATION_DN2 && (rounding_dn2(6.0) - 3.0).abs() < 1e-12);
        assert!(coarse_rounding_dn2(1.0) == 0.0 && (coarse_rounding_dn2(5.0) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_error_of_a_variance_covers_every_phase_however_little_is_found() {
        for sigma in [0.0, 0.1, 0.2, 0.3, 0.4] {
            for spread in [0.02, 0.1, 0.3, 0.6, 1.0] {
                let v: f64 = spread * spread;
                let steps = Steps::behind_noise(sigma * sigma);
                let found = (0..20).map(|i| steps.found_dn2(v, f64::from(i) / 20.0));
                for found in found {
                    let sampling = 0.02 * v;
                    let error = steps.error_of_variance(found, sampling).hypot(sampling);
                    assert!((found - v).abs() < 3.0 * error, "{sigma} {spread}: {found} +- {error}");
                }
            }
        }
        assert!(Steps::behind_noise(1.0).error_of_variance(0.04, 0.001) < 1e-6);
    }

    #[test]
    fn rounding_errors_equal_the_average_over_phases() {
        for sigma in [0.3, 0.37, 0.45, 0.6, 0.8] {
            let phases = 200;
            let (mut of_mean, mut of_variance, mut least) = (0.0, 0.0, f64::INFINITY);
            for i in 0..phases {
                let mean = f64::from(i) / f64::from(phases);
                let (found, variance) = rounded(mean, sigma);
                of_mean += (found - mean).powi(2) / f64::from(phases);
                of_variance += (variance - QUANTISATION_DN2 - sigma * sigma).powi(2) / f64::from(phases);
                least = least.min(sigma * sigma - least_noise_dn2(variance));
            }
            let (of_mean, of_variance) = (of_mean.sqrt(), of_variance.sqrt());
            let (mean, variance) = (of_mean_dn(sigma * sigma), of_variance_dn2(sigma * sigma));
            assert!((mean / of_mean - 1.0).abs() < 1e-6, "{sigma}: mean {mean}, {of_mean}");
            // The square of the mean's part is left out: a tenth of the whole where noise is least.
            assert!(
                (variance / of_variance - 1.0).abs() < 0.12,
                "{sigma}: variance {variance}, {of_variance}"
            );
            assert!(least > -0.1 * sigma * sigma, "{sigma}: the least noise is above the noise by {least}");
        }
        assert!(of_variance_dn2(1.0) < 1e-8);
    }
}
