//! The exact distribution of the digital numbers of a uniformly lit pixel.
//!
//! ```text
//! p(y) = sum over n of Poisson(n; lambda) [Phi((y + 1/2 - m_n) / s) - Phi((y - 1/2 - m_n) / s)]
//! m_n  = K g (min(n, FWC) + mu_r) + BL + mu_el,    s^2 = (K g sigma_r)^2 + sigma_el^2
//! ```
//!
//! The lowest and the highest digital number take everything beyond them. The sums leave out terms below 1e-15;
//! `Phi` comes from a table that is good to 1e-11.
//!
//! Pixels that answer light with factors `1 + d`, `d` normal of variance `p^2` (PRNU), have the cumulants `lambda`,
//! `lambda + P` and `lambda + 3 P` with `P = (p lambda)^2`: a normal distribution of variance `P n / lambda` around every
//! count `n` has the same three. A fit to histograms that chance made narrower than shot noise needs `P < 0` to be free of
//! bias: there the counts are drawn together about their mean, to the variance `lambda + P`.

use std::sync::OnceLock;

/// The conversion of electrons of one exposure to digital numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// System gain at the linear gain, DN/e-.
    pub gain_dn_per_e: f64,
    /// Mean of the read noise, e-.
    pub read_noise_mean_e: f64,
    /// Standard deviation of the read noise, e-.
    pub read_noise_e: f64,
    /// Black level and mean of the electronics noise, DN.
    pub offset_dn: f64,
    /// Standard deviation of the electronics noise before the converter, DN.
    pub electronics_noise_dn: f64,
    /// Variance between pixels of the electrons of light, `(p lambda)^2` of the module's formulas, e-^2.
    pub pattern_variance_e2: f64,
    /// Full well, e-.
    pub full_well_e: f64,
    /// Largest digital number.
    pub max_dn: u32,
}

/// Standard deviations beyond which a normal distribution is left out.
const REACH_SIGMAS: f64 = 8.0;
/// Cells of the table per standard deviation.
const CELLS: f64 = 256.0;

/// Cumulative normal distribution by cubic interpolation between tabulated values and slopes.
fn normal_cdf(z: f64) -> f64 {
    static TABLE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        (0..=(2.0 * REACH_SIGMAS * CELLS) as usize)
            .map(|i| {
                let z = i as f64 / CELLS - REACH_SIGMAS;
                let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
                (0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2), density / CELLS)
            })
            .collect()
    });
    if z <= -REACH_SIGMAS {
        return 0.0;
    }
    if z >= REACH_SIGMAS {
        return 1.0;
    }
    let place = (z + REACH_SIGMAS) * CELLS;
    let cell = (place as usize).min(table.len() - 2);
    let t = place - cell as f64;
    let ((y0, d0), (y1, d1)) = (table[cell], table[cell + 1]);
    let rise = y1 - y0;
    y0 + t * (d0 + t * (3.0 * rise - 2.0 * d0 - d1 + t * (d0 + d1 - 2.0 * rise)))
}

/// Distance from its mean beyond which a Poisson count is left out.
fn poisson_reach(rate: f64) -> f64 {
    9.0 * rate.sqrt() + 20.0
}

/// Probabilities of a Poisson count of mean `rate`: the first count and its followers, down to 1e-16 of the peak.
fn poisson(rate: f64) -> (u64, Vec<f64>) {
    if rate <= 0.0 {
        return (0, vec![1.0]);
    }
    let spread = poisson_reach(rate);
    let (first, last) = ((rate - spread).max(0.0) as u64, (rate + spread) as u64);
    let peak = rate as u64;
    let at_peak = (peak as f64 * rate.ln() - rate - libm::lgamma(peak as f64 + 1.0)).exp();
    let mut p = vec![0.0; (last - first + 1) as usize];
    let at = |n: u64| (n - first) as usize;
    p[at(peak)] = at_peak;
    for n in peak + 1..=last {
        p[at(n)] = p[at(n - 1)] * rate / n as f64;
    }
    for n in (first..peak).rev() {
        p[at(n)] = p[at(n + 1)] * (n + 1) as f64 / rate;
    }
    (first, p)
}

/// Ratio of the mean count to the range of the converter above which every pixel is clipped.
const CLIPPED_TIMES: f64 = 4.0;
/// If the fitted variance between pixels is negative, at least this share of the shot noise is kept.
const LEAST_SHOT_SHARE: f64 = 0.05;

/// Probabilities of the digital numbers `0..=max_dn` for electrons of mean `rate_e` (light and dark current).
pub fn digital_numbers(rate_e: f64, response: &Response) -> Vec<f64> {
    let top = response.max_dn as usize;
    let mut p = vec![0.0; top + 1];
    let gain = response.gain_dn_per_e;
    let dark_variance = (gain * response.read_noise_e).powi(2) + response.electronics_noise_dn.powi(2);
    let dark_sigma = dark_variance.sqrt().max(1e-9);

    // Light far beyond the range of the converter gives its largest number, however many electrons there are.
    let range_e = (top as f64 + 1.0 + REACH_SIGMAS * dark_sigma - response.offset_dn) / gain
        - response.read_noise_mean_e;
    if response.full_well_e > range_e && rate_e > CLIPPED_TIMES * range_e.max(0.0) + 1000.0 {
        p[top] = 1.0;
        return p;
    }

    // Where no count is below the full well, every pixel is full.
    let full = rate_e - poisson_reach(rate_e) > response.full_well_e;

    // More variance between pixels widens every count, less than none draws the counts together.
    let pattern = if rate_e > 0.0 { response.pattern_variance_e2 / rate_e } else { 0.0 };
    let together = (1.0 + pattern.min(0.0)).max(LEAST_SHOT_SHARE).sqrt();
    let (first, counts) = if full { (rate_e as u64, vec![1.0]) } else { poisson(rate_e) };
    for (i, weight) in counts.iter().enumerate() {
        if *weight < 1e-17 {
            continue;
        }
        let count = (first + i as u64) as f64;
        let electrons = (rate_e + together * (count - rate_e)).min(response.full_well_e);
        let mean = gain * (electrons + response.read_noise_mean_e) + response.offset_dn;
        // Full pixels have no shot noise.
        let sigma = if pattern > 0.0 && electrons < response.full_well_e {
            (dark_variance + gain * gain * pattern * count).sqrt().max(1e-9)
        } else {
            dark_sigma
        };
        spread(&mut p, *weight, mean, sigma);
    }
    p
}

/// Adds `weight` of a normal distribution, rounded to whole numbers and clipped to the range of `p`.
fn spread(p: &mut [f64], weight: f64, mean: f64, sigma: f64) {
    let top = p.len() - 1;
    let clip = |v: f64| v.clamp(0.0, top as f64) as usize;
    let (low, high) =
        (clip((mean - REACH_SIGMAS * sigma).round()), clip((mean + REACH_SIGMAS * sigma).round()));
    let mut below = 0.0;
    for (y, p) in p.iter_mut().enumerate().take(high).skip(low) {
        let up_to = normal_cdf((y as f64 + 0.5 - mean) / sigma);
        *p += weight * (up_to - below);
        below = up_to;
    }
    p[high] += weight * (1.0 - below);
}

#[cfg(test)]
mod tests {
    use super::*;
    use petzval_camera::image::{CHANNELS, LinearImage};
    use petzval_camera::render::Placement;
    use petzval_camera::sensor::{Capture, Electronics, Exposure, Noise, NoiseMode, SensorModel, expose};

    fn imx249() -> SensorModel {
        petzval_files::parse_sensor(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml"))
            .unwrap()
    }

    /// Probabilities of the digital numbers of a sensor at a linear gain for electrons of mean `rate_e`, with its electronics
    /// noise before or after the converter. Non-uniformity is left out.
    fn sensor_digital_numbers(sensor: &SensorModel, linear_gain: f64, rate_e: f64) -> Vec<f64> {
        let before = sensor.electronics == Electronics::BeforeAdc;
        let (offset, noise) =
            if before { (sensor.electronics_mean_dn, sensor.electronics_noise_dn) } else { (0.0, 0.0) };
        let p = digital_numbers(
            rate_e,
            &Response {
                gain_dn_per_e: sensor.gain_dn_per_e * linear_gain,
                read_noise_mean_e: sensor.read_noise_mean_e,
                read_noise_e: sensor.read_noise_e,
                offset_dn: sensor.black_level_dn + offset,
                electronics_noise_dn: noise,
                pattern_variance_e2: 0.0,
                full_well_e: sensor.full_well_e,
                max_dn: sensor.max_dn() as u32,
            },
        );
        if before {
            return p;
        }
        let mut again = vec![0.0; p.len()];
        for (y, weight) in p.iter().enumerate().filter(|(_, w)| **w > 1e-17) {
            let sigma = sensor.electronics_noise_dn.max(1e-9);
            spread(&mut again, *weight, y as f64 + sensor.electronics_mean_dn, sigma);
        }
        again
    }

    #[test]
    fn the_table_equals_the_normal_distribution() {
        for i in -3999..4000 {
            let z = f64::from(i) * 0.002_01;
            let exact = 0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2);
            assert!((normal_cdf(z) - exact).abs() < 1e-11, "{z}");
        }
    }

    #[test]
    fn moments_equal_the_formulas() {
        let sensor = imx249();
        for (gain, rate) in [(1.0, 0.0), (1.0, 500.0), (10.0, 20.0), (31.62, 0.75), (1.0, 20_000.0)] {
            let p = sensor_digital_numbers(&sensor, gain, rate);
            let total: f64 = p.iter().sum();
            let mean: f64 = p.iter().enumerate().map(|(y, p)| y as f64 * p).sum();
            let variance: f64 = p.iter().enumerate().map(|(y, p)| (y as f64 - mean).powi(2) * p).sum();
            let k = 0.14 * gain;
            let (m, v) = (k * (rate + 3.25) + 120.15, k * k * (rate + 16.0) + 0.92 * 0.92 + 1.0 / 12.0);
            assert!((total - 1.0).abs() < 1e-10, "{gain} {rate}: {total}");
            // Rounding a spread of 1 DN has the variance 1/12 DN^2 to some 1e-8.
            assert!(
                (mean - m).abs() < 1e-5 && (variance / v - 1.0).abs() < 1e-5,
                "{mean} {m} {variance} {v}"
            );
        }
    }

    #[test]
    fn non_uniform_pixels_have_the_cumulants_of_the_formulas() {
        let (gain, rate, share) = (0.14, 9000.0, 0.01);
        let cumulants = |pattern_variance_e2: f64| {
            let response = Response {
                gain_dn_per_e: gain,
                read_noise_mean_e: 3.25,
                read_noise_e: 4.0,
                offset_dn: 120.15,
                electronics_noise_dn: 0.92,
                pattern_variance_e2,
                full_well_e: f64::INFINITY,
                max_dn: 4095,
            };
            let p = digital_numbers(rate, &response);
            let mean: f64 = p.iter().enumerate().map(|(y, p)| y as f64 * p).sum();
            let central = |k| p.iter().enumerate().map(|(y, p)| (y as f64 - mean).powi(k) * p).sum::<f64>();
            (mean, central(2), central(3))
        };
        let pattern = (share * rate) * (share * rate);
        let dark = gain * gain * 16.0 + 0.92 * 0.92 + 1.0 / 12.0;
        for pattern in [pattern, 0.0, -0.02 * rate] {
            let (mean, variance, third) = cumulants(pattern);
            let expected = gain * gain * (rate + pattern) + dark;
            assert!((mean - (gain * (rate + 3.25) + 120.15)).abs() < 1e-5, "{pattern}: mean {mean}");
            assert!((variance / expected - 1.0).abs() < 1e-5, "{pattern}: variance {variance}, {expected}");
            if pattern >= 0.0 {
                let expected = gain.powi(3) * (rate + 3.0 * pattern);
                assert!((third / expected - 1.0).abs() < 1e-3, "{pattern}: {third}, {expected}");
            }
        }
    }

    #[test]
    fn extreme_light_is_clipped_without_a_sum() {
        let response = Response {
            gain_dn_per_e: 0.14,
            read_noise_mean_e: 3.25,
            read_noise_e: 4.0,
            offset_dn: 120.15,
            electronics_noise_dn: 0.92,
            pattern_variance_e2: 1e16,
            full_well_e: f64::INFINITY,
            max_dn: 4095,
        };
        // A list of the counts of 1e22 electrons would not fit in any memory.
        for rate in [1e10, 1e22] {
            let p = digital_numbers(rate, &response);
            assert_eq!((p[4095], p.iter().sum::<f64>()), (1.0, 1.0));
            // A full well within the range: every pixel is full, and differs by the noise of the dark alone.
            for pattern_variance_e2 in [1e16, 0.0, -0.5 * rate] {
                let p = digital_numbers(
                    rate,
                    &Response { full_well_e: 15_000.0, pattern_variance_e2, ..response },
                );
                let mean: f64 = p.iter().enumerate().map(|(y, p)| y as f64 * p).sum();
                let variance: f64 = p.iter().enumerate().map(|(y, p)| (y as f64 - mean).powi(2) * p).sum();
                assert!((mean - (0.14 * 15_003.25 + 120.15)).abs() < 1e-6, "{rate}: {mean}");
                assert!((variance - (0.56 * 0.56 + 0.92 * 0.92 + 1.0 / 12.0)).abs() < 1e-4, "{variance}");
            }
        }
    }

    #[test]
    fn simulated_frames_have_this_distribution() {
        for electronics in [Electronics::BeforeAdc, Electronics::AfterAdc] {
            for (frame, gain, white_e, full_well_e) in
                [(0, 1.0, 300.0, 33723.0), (1, 10.0, 5.0, 33723.0), (2, 1.0, 900.0, 900.0)]
            {
                let sensor = SensorModel { electronics, full_well_e, relative_qe: [1.0; 3], ..imx249() };
                let exposure = Exposure { white_e, time_s: 0.01, linear_gain: gain };
                let capture = Capture { exposure, placement: Placement::default(), frame };
                let noise = Noise { mode: NoiseMode::Exact, seed: 8 };
                let raw =
                    expose(&LinearImage::filled(CHANNELS, 500, 600, 1.0), &sensor, &capture, &noise).unwrap();
                let n = raw.dn.len() as f64;
                let rate = f64::from(white_e) + 25.0 * f64::from(exposure.time_s);
                let p = sensor_digital_numbers(&sensor, f64::from(gain), rate);
                let mut counts = vec![0.0; p.len()];
                raw.dn.iter().for_each(|v| counts[*v as usize] += 1.0);
                let bins: Vec<(f64, f64)> =
                    p.iter().zip(&counts).map(|(p, c)| (n * p, *c)).filter(|(e, _)| *e >= 10.0).collect();
                let chi2: f64 = bins.iter().map(|(e, c)| (c - e).powi(2) / e).sum();
                // Wilson and Hilferty: the cube root of chi^2/f is nearly normal. Six tests, alpha 1e-4 in all.
                let f = bins.len() as f64 - 1.0;
                let z = ((chi2 / f).cbrt() - (1.0 - 2.0 / (9.0 * f))) / (2.0 / (9.0 * f)).sqrt();
                assert!(z.abs() < 4.3, "{electronics:?} frame {frame}: chi2 {chi2} of {f}, z {z}");
            }
        }
    }
}
