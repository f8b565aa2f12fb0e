//! The response by frequency: the Fourier transform of the derivative of the profile.

use std::f64::consts::{PI, TAU};

use super::profile::{BINS_PER_PIXEL, Profile};

/// Step of the frequencies, cycles per pixel; the last is 1.
pub const FREQUENCY_STEP: f64 = 0.01;

/// Frequencies from 0 to 1 cycle per pixel.
const FREQUENCIES: usize = 101;

/// Share of the line spread function on either side of the edge that the window leaves as it is.
const FLAT_SHARE: f64 = 0.5;

/// Modulation over frequency, 1 at frequency 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Sfr {
    /// Modulation at `0, FREQUENCY_STEP, ...` cycles per pixel.
    pub modulation: Vec<f64>,
}

impl Sfr {
    /// The response of a profile.
    ///
    /// With bins of `d = 1/4` pixel, `L_i = (E_(i+1) - E_(i-1)) / 2`, and `SFR(f) = |sum_i w_i L_i exp(-2 pi i f d k)| / (|sum_i w_i L_i| c(f))`.
    /// The window w of Tukey leaves the inner half as it is. c undoes what sampling did to the modulation: the difference over two bins
    /// multiplies it by `sinc(2 f d)`, the mean over each by `sinc(f d)`.
    pub fn of(profile: &Profile) -> Self {
        let line: Vec<f64> = profile
            .bins
            .windows(3)
            .enumerate()
            .map(|(i, bins)| 0.5 * (bins[2] - bins[0]) * window(i + 1, profile.bins.len()))
            .collect();
        let transform = |frequency: f64| {
            let (mut re, mut im) = (0.0, 0.0);
            for (i, v) in line.iter().enumerate() {
                let (sin, cos) = (TAU * frequency * i as f64 / BINS_PER_PIXEL as f64).sin_cos();
                re += v * cos;
                im -= v * sin;
            }
            re.hypot(im)
        };
        let (bin, dc) = (1.0 / BINS_PER_PIXEL as f64, transform(0.0));
        let modulation = (0..FREQUENCIES)
            .map(|k| k as f64 * FREQUENCY_STEP)
            .map(|f| transform(f) / (dc * sinc(2.0 * f * bin) * sinc(f * bin)))
            .collect();
        Self { modulation }
    }

    /// The mean of several responses; none of none.
    pub fn mean(responses: &[&Self]) -> Option<Self> {
        let count = responses.len() as f64;
        let mean = |k: usize| responses.iter().map(|sfr| sfr.modulation[k]).sum::<f64>() / count;
        (!responses.is_empty()).then(|| Self { modulation: (0..FREQUENCIES).map(mean).collect() })
    }

    /// Modulation at a frequency of 0 to 1 cycle per pixel, linear between the steps.
    pub fn at(&self, frequency: f64) -> f64 {
        let place = (frequency / FREQUENCY_STEP).clamp(0.0, (FREQUENCIES - 1) as f64);
        let low = (place as usize).min(FREQUENCIES - 2);
        let share = place - low as f64;
        (1.0 - share) * self.modulation[low] + share * self.modulation[low + 1]
    }

    /// The least frequency at which the modulation falls to `level`, cycles per pixel; none if it stays above.
    pub fn frequency_at(&self, level: f64) -> Option<f64> {
        let k = self.modulation.windows(2).position(|pair| pair[0] >= level && pair[1] < level)?;
        let (above, below) = (self.modulation[k], self.modulation[k + 1]);
        Some((k as f64 + (above - level) / (above - below)) * FREQUENCY_STEP)
    }

    /// MTF50: where half of the modulation is left, cycles per pixel.
    pub fn mtf50(&self) -> Option<f64> {
        self.frequency_at(0.5)
    }
}

/// Tukey's window over `count` bins, whose middle is the edge.
fn window(i: usize, count: usize) -> f64 {
    let from_middle = ((i as f64 + 0.5) / (0.5 * count as f64) - 1.0).abs();
    let into_taper = (from_middle - FLAT_SHARE) / (1.0 - FLAT_SHARE);
    if into_taper <= 0.0 { 1.0 } else { 0.5 * (1.0 + (PI * into_taper.min(1.0)).cos()) }
}

/// `sin(pi x) / (pi x)`.
fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) }
}
