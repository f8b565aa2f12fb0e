//! Histograms of defects as in EMVA 1288: whole-number bins of equal width, compared with a normal distribution.

use schemars::JsonSchema;
use serde::Serialize;

/// Largest number of bins of a histogram.
pub const MOST_BINS: usize = 256;

/// A histogram and the normal distribution of the same mean and spread.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Histogram {
    /// Lower limit of each bin.
    pub bins: Vec<f64>,
    /// Pixels in the bin; percent of the pixels at or beyond the bin if it is accumulated.
    pub values: Vec<f64>,
    /// Pixels in the bin if the values were normally distributed.
    pub model: Vec<f64>,
}

/// Counts whole numbers in at most `most_bins` bins: `W = floor((max - min)/most_bins) + 1` wide (1 if the values fit),
/// from the least value on. The model is `N (max - min)/Q` times the normal density at the lower limit of each of the `Q` bins.
pub fn histogram(values: &[i64], most_bins: usize) -> Histogram {
    let (Some(min), Some(max)) = (values.iter().min().copied(), values.iter().max().copied()) else {
        return Histogram::default();
    };
    let range = (max - min) as u64;
    let width = if range < most_bins as u64 { 1 } else { range / most_bins as u64 + 1 };
    let count = (range / width + 1) as usize;
    let mut counts = vec![0u64; count];
    values.iter().for_each(|v| counts[((v - min) as u64 / width) as usize] += 1);

    let n = values.len() as f64;
    let mean = values.iter().map(|v| *v as f64).sum::<f64>() / n;
    let sigma = (values.iter().map(|v| (*v as f64 - mean).powi(2)).sum::<f64>() / n).sqrt();
    let bins: Vec<f64> = (0..count as i64).map(|q| (min + q * width as i64) as f64).collect();
    let height = range as f64 / count as f64 * n / ((2.0 * std::f64::consts::PI).sqrt() * sigma);
    let normal =
        |b: &f64| if sigma > 0.0 { height * (-0.5 * ((b - mean) / sigma).powi(2)).exp() } else { 0.0 };
    let model = bins.iter().map(normal).collect();
    Histogram { model, values: counts.into_iter().map(|c| c as f64).collect(), bins }
}

impl Histogram {
    /// Bins in another unit: `(bin / divisor) - offset`.
    pub fn rescaled(mut self, divisor: f64, offset: f64) -> Self {
        self.bins.iter_mut().for_each(|b| *b = *b / divisor - offset);
        self
    }
}

/// Percent of the pixels that deviate from the mean (cut to a whole number) by the bin or more.
pub fn accumulated(values: &[i64], most_bins: usize) -> Histogram {
    if values.is_empty() {
        return Histogram::default();
    }
    let mean = (values.iter().map(|v| *v as f64).sum::<f64>() / values.len() as f64) as i64;
    let deviations: Vec<i64> = values.iter().map(|v| (v - mean).abs()).collect();
    let mut found = histogram(&deviations, most_bins);
    let mut beyond = 0.0;
    for value in found.values.iter_mut().rev() {
        beyond += *value;
        *value = 100.0 * beyond / values.len() as f64;
    }
    found
}
