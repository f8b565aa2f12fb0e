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

/// Variance of rounding to whole digital numbers, DN^2.
pub const QUANTISATION_DN2: f64 = 1.0 / 12.0;
/// Temporal dark variance below which the noise of the converter dominates, DN^2 (release 3.1, Sec. 6.6).
pub(super) const LEAST_DARK_VARIANCE_DN2: f64 = 0.24;

/// Standard errors by rounding.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RoundingError {
    /// Standard error of a mean, DN.
    pub mean_dn: f64,
    /// Standard error of `variance - 1/12` as the variance before rounding, DN^2.
    pub variance_dn2: f64,
}

impl RoundingError {
    /// Errors for frames with this temporal variance after rounding, DN^2.
    pub fn of(variance_dn2: f64) -> Self {
        let noise_dn2 = least_noise_dn2(variance_dn2);
        Self { mean_dn: of_mean_dn(noise_dn2), variance_dn2: of_variance_dn2(noise_dn2) }
    }
}

/// Standard errors by rounding of a variance over pixels that is `spatial_dn2`, of frames with this temporal variance after rounding:
/// a share of the variance, and a variance that adds to it, DN^2.
///
/// The mean `x` of a pixel becomes `x + b(x)` with the sum `b` of the mean's harmonics above. Over pixels of the variance `v` that are
/// normally distributed, the first harmonic adds `2 cov(x, b) = -4 v h cos(2 pi m)` with `h = exp(-2 pi^2 (s^2 + v))`: pixels that lie
/// between the same two numbers move together or apart. And `b` has a variance of its own, up to half the square of its amplitude,
/// which pixels that differ by little do not reach.
pub fn of_spatial(temporal_dn2: f64, spatial_dn2: f64) -> [f64; 2] {
    let (noise_dn2, spatial_dn2) = (least_noise_dn2(temporal_dn2), spatial_dn2.max(0.0));
    let share = of_random_phase(|k| if k == 1.0 { 4.0 * harmonic(k, noise_dn2 + spatial_dn2) } else { 0.0 });
    let reached = 1.0 - harmonic(1.0, 2.0 * spatial_dn2);
    [share, reached * of_mean_dn(noise_dn2).powi(2)]
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
