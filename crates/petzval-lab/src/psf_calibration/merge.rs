//! Exposures of several times as one rate per pixel, electrons per second, with its variance.
//!
//! Exposure k gives `r_k = (y_k - d_k) / (K g t_k)` with the variance of its mean over N frames
//!
//! ```text
//! v_k(r) = [ r t_k + mu_I t_k + h_k + q ] / (N t_k^2) + var(d_k) / (K g t_k)^2
//! q      = sigma_r^2 + sigma_row^2 + sigma_column^2 + (sigma_el^2 + 1/12) / (K g)^2
//! ```
//!
//! where `h_k` are the dark electrons that hot pixels have above the others. The sensor's fixed pattern does not average out:
//! without dark frames each pixel keeps its offset (DSNU, standard deviation s), with or without them its response (PRNU,
//! standard deviation p). The same offset is in all exposures, so it is counted once:
//!
//! ```text
//! w_k = 1 / (v_k(r) + s_k^2 / t_k^2),   s_k = s, or 0 where dark frames were subtracted
//! r = sum w_k r_k / W,   var r = sum w_k^2 v_k / W^2 + (sum w_k s_k / t_k / W)^2 + (p r)^2,   W = sum w_k
//! ```
//!
//! The variance is that of the *expected* signal. With the variance of each noisy value instead, low values would get
//! more weight, and the merged rate would be biased low. The expected signal starts as the pooled estimate
//! `sum N_k t_k r_k / sum N_k t_k` (which is the best one where shot noise dominates) and is then refined twice. A
//! pixel that reached the end of the converter or 98 % of the full well, dark electrons included, in any frame of an
//! exposure has no weight there. Noise that a row or a column shares is treated as independent from pixel to pixel.

use super::average::{Average, Dark};
use super::frame::Frame;
use petzval_base::statistics::median;
use petzval_camera::sensor::{Electronics, SensorModel};

/// The averaged frames of one exposure time, with their dark signal.
#[derive(Debug, Clone, PartialEq)]
pub struct ExposureMean {
    /// Exposure time, s.
    pub time_s: f64,
    /// Mean of the frames.
    pub light: Average,
    /// Dark signal to subtract.
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

/// Noise and dark signal of the sensor at one linear gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorNoise {
    /// Digital numbers per electron.
    pub gain_dn_per_e: f64,
    /// Dark current, electrons/s.
    pub dark_e_per_s: f64,
    /// Read noise, row and column noise, electronics and rounding of one frame, electrons squared.
    pub read_e2: f64,
    /// Temporal noise that the pixels of a row, and those of a column, share, electrons squared; also part of `read_e2`.
    pub shared_e2: [f64; 2],
    /// Standard deviation of the pixels' offsets, electrons.
    pub dsnu_e: f64,
    /// Standard deviation of the pixels' responses, 0.01 = one percent.
    pub prnu: f64,
}

/// Share of the full well from which a pixel counts as saturated.
const FULL: f64 = 0.98;

/// Number of refinements of the expected signal for the variance.
const REFINEMENTS: usize = 2;

/// Digital number from which a pixel counts as saturated: the end of the converter, or 98 % of the full well with the offset
/// that reading adds. Light and dark electrons fill the same well.
pub fn saturation_dn(sensor: &SensorModel, linear_gain: f64) -> f64 {
    let full_e = FULL * sensor.full_well_e + sensor.read_noise_mean_e;
    let zero_dn = sensor.black_level_dn + sensor.electronics_mean_dn;
    (zero_dn + sensor.gain_dn_per_e * linear_gain * full_e).min(sensor.max_dn())
}

impl SensorNoise {
    /// The noise of a sensor at a linear gain.
    pub fn new(sensor: &SensorModel, linear_gain: f64) -> Self {
        let gain_dn_per_e = sensor.gain_dn_per_e * linear_gain;
        let roundings = if sensor.electronics == Electronics::AfterAdc { 2.0 } else { 1.0 };
        let dn2 = sensor.electronics_noise_dn.powi(2) + roundings / 12.0;
        let n = &sensor.nonuniformity;
        let shared_e2 = [n.row_noise_e.powi(2), n.column_noise_e.powi(2)];
        let square = |parts: [f64; 3]| parts.iter().map(|v| v * v).sum::<f64>();
        Self {
            gain_dn_per_e,
            dark_e_per_s: sensor.dark_current_e_per_s,
            read_e2: sensor.read_noise_e.powi(2)
                + shared_e2[0]
                + shared_e2[1]
                + dn2 / (gain_dn_per_e * gain_dn_per_e),
            shared_e2,
            dsnu_e: square([n.dsnu_pixel_e, n.dsnu_row_e, n.dsnu_column_e]).sqrt(),
            prnu: 0.01 * square([n.prnu_pixel_percent, n.prnu_row_percent, n.prnu_column_percent]).sqrt(),
        }
    }
}

impl ExposureMean {
    /// Rate of a pixel, electrons/s.
    pub fn rate(&self, pixel: usize, gain_dn_per_e: f64) -> f64 {
        (self.light.mean_dn[pixel] - self.dark.mean_dn[pixel]) / (gain_dn_per_e * self.time_s)
    }

    /// Whether a pixel of this exposure cannot be used.
    pub fn is_saturated(&self, pixel: usize) -> bool {
        self.light.clipped[pixel] || self.dark.clipped[pixel]
    }

    /// Variance of a pixel of one frame for an expected rate, electrons squared.
    pub fn frame_variance_e2(&self, pixel: usize, rate: f64, noise: &SensorNoise) -> f64 {
        let hot_e = self.dark.hot_dn[pixel] / noise.gain_dn_per_e;
        (rate.max(0.0) + noise.dark_e_per_s) * self.time_s + hot_e + noise.read_e2
    }

    /// Variance of the rate for an expected rate `rate`, that of the dark frames included and the fixed pattern left out.
    pub fn variance(&self, pixel: usize, rate: f64, noise: &SensorNoise) -> f64 {
        let hot_e = self.dark.hot_dn[pixel] / noise.gain_dn_per_e;
        let dark_e2 =
            self.dark.variance_dn2 / noise.gain_dn_per_e.powi(2) + hot_e / self.dark.frames.max(1) as f64;
        (self.frame_variance_e2(pixel, rate, noise) / self.light.frames as f64 + dark_e2)
            / self.time_s.powi(2)
    }

    /// Standard deviation of the rate by the pixels' offsets, electrons/s; zero where dark frames were subtracted.
    pub fn offset_e_per_s(&self, noise: &SensorNoise) -> f64 {
        if self.dark.frames > 0 { 0.0 } else { noise.dsnu_e / self.time_s }
    }

    /// Mean over the pixels of the frames' variance over the modelled one: 1 where sensor model and captures agree.
    /// Saturated pixels do not count; `None` for a single frame.
    pub fn variance_ratio(&self, merged: &Merged, sensor: &SensorModel, linear_gain: f64) -> Option<f64> {
        let noise = SensorNoise::new(sensor, linear_gain);
        let (mut sum, mut count) = (0.0, 0.0);
        for i in 0..merged.rate_e_per_s.len() {
            if self.is_saturated(i) {
                continue;
            }
            let modelled_e2 = self.frame_variance_e2(i, merged.rate_e_per_s[i], &noise);
            sum += self.light.variance_dn2(i)? / (noise.gain_dn_per_e.powi(2) * modelled_e2);
            count += 1.0;
        }
        (count > 0.0).then_some(sum / count)
    }
}

/// The weighted mean of exposures at one pixel.
struct Pooled {
    rate: f64,
    /// Temporal variance of the rate.
    variance: f64,
    /// Standard deviation of the rate by the pixel's offset, electrons/s.
    offset: f64,
}

fn pool(exposures: &[&ExposureMean], pixel: usize, expected: f64, noise: &SensorNoise) -> Pooled {
    let (mut rate, mut square, mut offset, mut weights) = (0.0, 0.0, 0.0, 0.0);
    for e in exposures {
        let (variance, of_offset) = (e.variance(pixel, expected, noise), e.offset_e_per_s(noise));
        let weight = 1.0 / (variance + of_offset * of_offset);
        rate += weight * e.rate(pixel, noise.gain_dn_per_e);
        square += weight * weight * variance;
        offset += weight * of_offset;
        weights += weight;
    }
    Pooled { rate: rate / weights, variance: square / (weights * weights), offset: offset / weights }
}

/// Merges exposures, the shortest first. All have the same number of pixels.
pub fn merge(exposures: &[ExposureMean], sensor: &SensorModel, linear_gain: f64) -> Merged {
    let pixels = exposures.first().map_or(0, |e| e.light.mean_dn.len());
    let noise = SensorNoise::new(sensor, linear_gain);
    let mut merged = Merged {
        rate_e_per_s: Vec::with_capacity(pixels),
        variance: Vec::with_capacity(pixels),
        time_s: Vec::with_capacity(pixels),
        saturated: Vec::with_capacity(pixels),
    };
    for i in 0..pixels {
        let mut good: Vec<&ExposureMean> = exposures.iter().filter(|e| !e.is_saturated(i)).collect();
        let saturated = good.is_empty();
        if saturated {
            good = exposures[..1].iter().collect();
        }
        // Start with all electrons over all time, the best estimate where shot noise dominates.
        let time = |e: &ExposureMean| e.light.frames as f64 * e.time_s;
        let total: f64 = good.iter().map(|e| time(e)).sum();
        let all = good.iter().map(|e| time(e) * e.rate(i, noise.gain_dn_per_e)).sum::<f64>() / total;
        let mut pooled = pool(&good, i, all, &noise);
        for _ in 1..REFINEMENTS {
            pooled = pool(&good, i, pooled.rate, &noise);
        }
        let response = noise.prnu * pooled.rate;
        merged.rate_e_per_s.push(pooled.rate);
        merged.variance.push(pooled.variance + pooled.offset.powi(2) + response * response);
        merged.time_s.push(total);
        merged.saturated.push(saturated);
    }
    merged
}

/// Comparison of one exposure with all others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    /// Mean squared difference of the rates over its variance: 1 where the exposures show the same light.
    pub chi2: f64,
    /// Light of this exposure over that of the others.
    pub ratio: f64,
    /// Bright pixels that were compared.
    pub pixels: usize,
}

/// Standard deviations of the difference from which the rate of a pixel counts as bright.
const BRIGHT_SIGMAS: f64 = 5.0;

/// Least number of bright pixels for a comparison.
const LEAST_PIXELS: usize = 8;

/// Compares exposure number `index` with the merged rates of all others, where both are bright and none is saturated; `None`
/// if there is nothing to compare. The response of a pixel is the same in both and cancels.
pub fn agreement(
    exposures: &[ExposureMean],
    index: usize,
    merged: &Merged,
    noise: &SensorNoise,
) -> Option<Agreement> {
    let one = &exposures[index];
    let (mut square, mut pixels, mut light, mut light_others) = (0.0, 0, 0.0, 0.0);
    for (i, expected) in merged.rate_e_per_s.iter().copied().enumerate() {
        let others: Vec<&ExposureMean> =
            (0..exposures.len()).filter(|k| *k != index).map(|k| &exposures[k]).collect();
        let good: Vec<&ExposureMean> = others.into_iter().filter(|e| !e.is_saturated(i)).collect();
        if one.is_saturated(i) || good.is_empty() {
            continue;
        }
        let (rate, pooled) = (one.rate(i, noise.gain_dn_per_e), pool(&good, i, expected, noise));
        let offset = one.offset_e_per_s(noise) - pooled.offset;
        let variance = one.variance(i, expected, noise) + pooled.variance + offset * offset;
        if expected > BRIGHT_SIGMAS * variance.sqrt() {
            square += (rate - pooled.rate).powi(2) / variance;
            light += rate;
            light_others += pooled.rate;
            pixels += 1;
        }
    }
    (pixels >= LEAST_PIXELS && light_others > 0.0).then(|| Agreement {
        chi2: square / pixels as f64,
        ratio: light / light_others,
        pixels,
    })
}

/// Standard deviations of a hot pixel above the median of the 5x5 pixels around it.
const HOT_SIGMAS: f64 = 8.0;

/// Largest height of the neighbours above the median, relative to that of the hot pixel. The brightest neighbour is
/// exempt, because it may be hot as well.
const HOT_NEIGHBOURS: f64 = 0.25;

/// Distance from the source within which a single bright pixel may be its peak, px.
const HOT_DISTANCE_PX: f64 = 3.0;

/// Finds single bright pixels away from the `source` and replaces them by the median of their colour's neighbours, whose
/// scatter is then their variance. Returns them in the order of the pixels.
///
/// With r the rate of a pixel, sigma its standard deviation, m the median of the up to 24 pixels around it and r2 the second
/// brightest of them, whatever their colours, a pixel is hot where
///
/// ```text
/// r - m > 8 sigma   and   r2 - m < (r - m) / 4
/// ```
///
/// Light through a lens falls on neighbours too: a round spot in the middle of a pixel, at least 1.2 px wide at half
/// height, gives four neighbours a quarter of the pixel's share or more. The nearest neighbours have other colours, but
/// filters overlap. (In 153 simulated captures of the nominal triplet, no pixel 8 sigma above m has an r2 below m +
/// 0.45 (r - m).) On the flank of a PSF the neighbours nearer to the source are bright as well, so a hot pixel is found
/// there only if it is four times as bright. Weaker hot pixels stay, because they cannot be distinguished from light.
pub fn mask_hot_pixels(merged: &mut Merged, frame: &Frame, source: [f64; 2]) -> Vec<usize> {
    let inside = |at: usize, step: isize, len: usize| at.checked_add_signed(step).filter(|v| *v < len);
    let around = |i: usize| -> Vec<usize> {
        let (row, col) = (i / frame.width, i % frame.width);
        let steps = (0..25isize).filter(|s| *s != 12).map(|s| (s / 5 - 2, s % 5 - 2));
        steps
            .filter_map(|(down, right)| {
                Some(inside(row, down, frame.height)? * frame.width + inside(col, right, frame.width)?)
            })
            .collect()
    };
    let rates = &merged.rate_e_per_s;
    let is_hot = |i: &usize| {
        if frame.distance(*i, source) <= HOT_DISTANCE_PX {
            return false;
        }
        let mut near: Vec<f64> = around(*i).into_iter().map(|n| rates[n]).collect();
        near.sort_by(f64::total_cmp);
        let [.., second, _] = near[..] else { return false };
        let middle = near[near.len() / 2];
        let excess = rates[*i] - middle;
        excess > HOT_SIGMAS * merged.variance[*i].sqrt() && second - middle < HOT_NEIGHBOURS * excess
    };
    let hot: Vec<usize> = (0..rates.len()).filter(is_hot).collect();
    let replaced: Vec<(usize, f64, f64)> = hot
        .iter()
        .filter_map(|i| {
            let channel = (0..3).find(|c| frame.is_colour(*i, *c));
            let same = |n: &usize| channel.is_some_and(|c| frame.is_colour(*n, c)) && !hot.contains(n);
            let near: Vec<usize> = around(*i).into_iter().filter(same).collect();
            if near.is_empty() {
                return None;
            }
            let middle = median(near.iter().map(|n| rates[*n]));
            let count = near.len() as f64;
            let scatter = near.iter().map(|n| (rates[*n] - middle).powi(2)).sum::<f64>() / count;
            let noise = near.iter().map(|n| merged.variance[*n]).sum::<f64>() / count;
            Some((*i, middle, scatter.max(noise)))
        })
        .collect();
    for (i, rate, variance) in replaced {
        (merged.rate_e_per_s[i], merged.variance[i], merged.saturated[i]) = (rate, variance, false);
    }
    hot
}
