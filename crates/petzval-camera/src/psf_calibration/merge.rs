//! Exposures of several times as one rate per pixel, electrons per second, with its variance.
//!
//! Exposure k gives `r_k = (y_k - d_k) / (K g t_k)` with the variance of its mean over N frames
//!
//! ```text
//! v_k(r) = [ r t_k + mu_I t_k + sigma_r^2 + q / (K g)^2 ] / (N t_k^2) + var(d_k) / (K g t_k)^2,   q = sigma_el^2 + 1/12
//! r = sum r_k / v_k(r) / sum 1 / v_k(r),    var r = 1 / sum 1 / v_k(r)
//! ```
//!
//! The variance is that of the *expected* signal. With the variance of each noisy value instead, values that came out low
//! would weigh more, and the merged rate would be biased low. The expected signal starts as the pooled estimate
//! `sum N_k t_k r_k / sum N_k t_k` (which is the best one where shot noise rules) and is then refined twice. A pixel that
//! met the end of the converter or 98 % of the full well in any frame of an exposure has no weight there.

use super::average::{Average, Dark};
use crate::sensor::{Electronics, SensorModel};

/// The averaged frames of one exposure time, with their dark signal.
#[derive(Debug, Clone, PartialEq)]
pub struct ExposureMean {
    /// Exposure time, s.
    pub time_s: f64,
    /// Mean of the frames.
    pub light: Average,
    /// What to take off.
    pub dark: Dark,
}

/// Light on every pixel of the mosaic.
#[derive(Debug, Clone, PartialEq)]
pub struct Merged {
    /// Electrons per second; noise may take it below 0.
    pub rate_e_per_s: Vec<f64>,
    /// Variance of the rate.
    pub variance: Vec<f64>,
    /// Time over which each pixel gathered light, all frames together, s.
    pub time_s: Vec<f64>,
    /// Pixels that were saturated in every exposure; their rate is a lower bound from the shortest one.
    pub saturated: Vec<bool>,
}

/// Share of the full well from which a pixel counts as saturated.
const FULL: f64 = 0.98;

/// Signal from which a pixel counts as full, DN above dark.
pub fn full_dn(sensor: &SensorModel, linear_gain: f64) -> f64 {
    FULL * sensor.full_well_e * sensor.gain_dn_per_e * linear_gain
}

/// How often the expected signal behind the variance is refined.
const REFINEMENTS: usize = 2;

/// Read noise, electronics and rounding of one frame, electrons squared.
pub fn read_variance_e2(sensor: &SensorModel, linear_gain: f64) -> f64 {
    let roundings = if sensor.electronics == Electronics::AfterAdc { 2.0 } else { 1.0 };
    let dn2 = sensor.electronics_noise_dn.powi(2) + roundings / 12.0;
    sensor.read_noise_e.powi(2) + dn2 / (sensor.gain_dn_per_e * linear_gain).powi(2)
}

impl ExposureMean {
    /// Rate of a pixel, electrons/s.
    pub fn rate(&self, pixel: usize, gain_dn_per_e: f64) -> f64 {
        (self.light.mean_dn[pixel] - self.dark.mean_dn[pixel]) / (gain_dn_per_e * self.time_s)
    }

    /// Whether a pixel of this exposure cannot be used.
    pub fn is_saturated(&self, pixel: usize, full_dn: f64) -> bool {
        self.light.clipped[pixel] || self.light.mean_dn[pixel] - self.dark.mean_dn[pixel] >= full_dn
    }

    /// Variance of the rate for an expected rate `rate`.
    pub fn variance(&self, rate: f64, dark_e_per_s: f64, read_e2: f64, gain_dn_per_e: f64) -> f64 {
        let t = self.time_s;
        let electrons2 = (rate.max(0.0) + dark_e_per_s) * t + read_e2;
        electrons2 / (self.light.frames as f64 * t * t) + self.dark.variance_dn2 / (gain_dn_per_e * t).powi(2)
    }

    /// Mean over the pixels of the frames' variance over the modelled one: 1 where sensor model and captures agree.
    /// Saturated pixels do not count; `None` for a single frame.
    pub fn variance_ratio(&self, merged: &Merged, sensor: &SensorModel, linear_gain: f64) -> Option<f64> {
        let gain = sensor.gain_dn_per_e * linear_gain;
        let read = read_variance_e2(sensor, linear_gain);
        let (mut sum, mut count) = (0.0, 0.0);
        for i in 0..merged.rate_e_per_s.len() {
            if self.is_saturated(i, full_dn(sensor, linear_gain)) {
                continue;
            }
            let rate = merged.rate_e_per_s[i].max(0.0) + sensor.dark_current_e_per_s;
            sum += self.light.variance_dn2(i)? / (gain * gain * (rate * self.time_s + read));
            count += 1.0;
        }
        (count > 0.0).then_some(sum / count)
    }
}

/// Merges exposures, the shortest first. All have the same number of pixels.
pub fn merge(exposures: &[ExposureMean], sensor: &SensorModel, linear_gain: f64) -> Merged {
    let pixels = exposures.first().map_or(0, |e| e.light.mean_dn.len());
    let gain = sensor.gain_dn_per_e * linear_gain;
    let full_dn = full_dn(sensor, linear_gain);
    let read = read_variance_e2(sensor, linear_gain);
    let variance = |e: &ExposureMean, rate: f64| e.variance(rate, sensor.dark_current_e_per_s, read, gain);
    let mut merged = Merged {
        rate_e_per_s: Vec::with_capacity(pixels),
        variance: Vec::with_capacity(pixels),
        time_s: Vec::with_capacity(pixels),
        saturated: Vec::with_capacity(pixels),
    };
    for i in 0..pixels {
        let mut good: Vec<&ExposureMean> = exposures.iter().filter(|e| !e.is_saturated(i, full_dn)).collect();
        let saturated = good.is_empty();
        if saturated {
            good = exposures[..1].iter().collect();
        }
        // Where shot noise rules, the best estimate is all electrons over all time.
        let time = |e: &ExposureMean| e.light.frames as f64 * e.time_s;
        let total: f64 = good.iter().map(|e| time(e)).sum();
        let mut rate = good.iter().map(|e| time(e) * e.rate(i, gain)).sum::<f64>() / total;
        let mut precision = 0.0;
        for _ in 0..REFINEMENTS {
            let (mut weighted, mut weights) = (0.0, 0.0);
            for e in &good {
                let weight = 1.0 / variance(e, rate);
                weighted += weight * e.rate(i, gain);
                weights += weight;
            }
            rate = weighted / weights;
            precision = weights;
        }
        merged.rate_e_per_s.push(rate);
        merged.variance.push(1.0 / precision);
        merged.time_s.push(total);
        merged.saturated.push(saturated);
    }
    merged
}
