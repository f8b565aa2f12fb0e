//! The response by frequency: the Fourier transform of the derivative of the profile.

use std::f64::consts::{PI, TAU};

use super::spline::{Basis, Spline};

/// Step of the frequencies, cycles per pixel; the last is 1.
pub const FREQUENCY_STEP: f64 = 0.01;

/// Frequencies from 0 to 1 cycle per pixel.
const FREQUENCIES: usize = 101;

/// Points of the line spread function in a pixel: their images lie where the spline has nothing.
const POINTS_PER_PIXEL: usize = 16;

/// Ratio of a window's flat half to the one before, and the narrowest, in standard deviations of the blur and pixels.
const WIDER: f64 = 1.5;
const NARROWEST_BLURS: f64 = 3.5;
const NARROWEST_PX: f64 = 2.0;

/// Flat share of a window; and the largest, of a window that holds no more than the blur.
const FLAT: f64 = 0.5;
const MOST_FLAT: f64 = 0.9;

/// A narrow window serves where it agrees with all wider ones: to so many standard errors of the difference, and to so much modulation.
const AGREE_SIGMAS: f64 = 4.0;
const AGREE: f64 = 2e-4;

/// Modulation over frequency, 1 at frequency 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Sfr {
    /// Modulation at `0, FREQUENCY_STEP, ...` cycles per pixel.
    pub modulation: Vec<f64>,
    /// Its standard errors, from the noise of the pixels.
    pub standard_error: Vec<f64>,
}

/// A frequency where the modulation has a certain value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Frequency, cycles per pixel.
    pub frequency: f64,
    /// Its standard error.
    pub standard_error: f64,
}

/// The modulation under one window, and how every band of rows pulls it.
struct Windowed {
    modulation: Vec<f64>,
    pulls: Vec<Vec<f64>>,
}

impl Sfr {
    /// The response of a profile E(d), and of the pulls of the bands on it.
    ///
    /// `SFR(f) = |S(f)| / |S(0)|` with `S(f) = integral w(d) E'(d) exp(-2 pi i f d) dd`. The window w is flat about the edge and falls as a
    /// cosine beyond. Of windows up to the whole profile the narrowest counts that agrees with all wider ones, since noise grows with the
    /// width. E is a spline, so that neither bins nor differences have a response to be undone.
    pub(super) fn of(profile: &Spline, pulls: &[Spline], scale: f64, blur_px: f64) -> Self {
        let whole = profile.basis.half as f64;
        let narrowest_flat = (NARROWEST_BLURS * blur_px).max(NARROWEST_PX);
        let mut flat = narrowest_flat;
        let mut windows = Vec::new();
        while WIDER * flat < FLAT * whole {
            windows.push(Windowed::of(profile, pulls, flat / FLAT, FLAT));
            flat *= WIDER;
        }
        // A profile that is short for its blur loses no more of it than it has to: a taper there would narrow the blur.
        let share = (narrowest_flat / whole).clamp(FLAT, MOST_FLAT);
        windows.push(Windowed::of(profile, pulls, whole, share));
        let agree = |a: &Windowed, b: &Windowed| {
            (0..=FREQUENCIES / 2).step_by(5).all(|k| {
                let pulls = a.pulls.iter().zip(&b.pulls).map(|(a, b)| (a[k] - b[k]).powi(2)).sum::<f64>();
                let noise = scale * pulls.sqrt();
                (a.modulation[k] - b.modulation[k]).abs() <= AGREE + AGREE_SIGMAS * noise
            })
        };
        let narrowest =
            (0..windows.len()).find(|i| windows[i + 1..].iter().all(|wider| agree(&windows[*i], wider)));
        let chosen = &windows[narrowest.unwrap_or(windows.len() - 1)];
        let error = |k: usize| scale * chosen.pulls.iter().map(|pull| pull[k] * pull[k]).sum::<f64>().sqrt();
        Self { modulation: chosen.modulation.clone(), standard_error: (0..FREQUENCIES).map(error).collect() }
    }

    /// The same response with errors that are not below those of another estimate.
    pub(super) fn with_errors_at_least(mut self, other: &Self) -> Self {
        for (own, least) in self.standard_error.iter_mut().zip(&other.standard_error) {
            *own = own.max(*least);
        }
        self
    }

    /// The mean of several responses, of independent pixels; none of none.
    pub fn mean(responses: &[&Self]) -> Option<Self> {
        let count = responses.len() as f64;
        let mean = |k: usize| responses.iter().map(|sfr| sfr.modulation[k]).sum::<f64>() / count;
        let error =
            |k: usize| responses.iter().map(|sfr| sfr.standard_error[k].powi(2)).sum::<f64>().sqrt() / count;
        (!responses.is_empty()).then(|| Self {
            modulation: (0..FREQUENCIES).map(mean).collect(),
            standard_error: (0..FREQUENCIES).map(error).collect(),
        })
    }

    /// Modulation at a frequency of 0 to 1 cycle per pixel, linear between the steps.
    pub fn at(&self, frequency: f64) -> f64 {
        interpolated(&self.modulation, frequency)
    }

    /// Standard error of the modulation at a frequency.
    pub fn error_at(&self, frequency: f64) -> f64 {
        interpolated(&self.standard_error, frequency)
    }

    /// The least frequency at which the modulation falls to `level`; none if it stays above.
    ///
    /// Between two steps the logarithm of the modulation is linear in the square of the frequency, as that of a Gaussian is. Linear modulation
    /// would be off by 1 % at 0.02 cycles per pixel.
    pub fn crossing(&self, level: f64) -> Option<Crossing> {
        let k = self.modulation.windows(2).position(|pair| pair[0] >= level && pair[1] < level)?;
        let (above, below) = (self.modulation[k], self.modulation[k + 1]);
        let share = if below > 0.0 && level > 0.0 {
            (above / level).ln() / (above / below).ln()
        } else {
            (above - level) / (above - below)
        };
        let [from, to] = [k, k + 1].map(|k| (k as f64 * FREQUENCY_STEP).powi(2));
        let frequency = (from + share * (to - from)).sqrt();
        // The slope over a few steps: that of one step is noise.
        let (low, high) = (k.saturating_sub(2), (k + 3).min(FREQUENCIES - 1));
        let fall = (self.modulation[low] - self.modulation[high]) / ((high - low) as f64 * FREQUENCY_STEP);
        let standard_error = self.error_at(frequency) / fall.max(1e-9);
        Some(Crossing { frequency, standard_error })
    }

    /// MTF50: where half of the modulation is left.
    pub fn mtf50(&self) -> Option<Crossing> {
        self.crossing(0.5)
    }
}

fn interpolated(values: &[f64], frequency: f64) -> f64 {
    let place = (frequency / FREQUENCY_STEP).clamp(0.0, (FREQUENCIES - 1) as f64);
    let low = (place as usize).min(FREQUENCIES - 2);
    let share = place - low as f64;
    (1.0 - share) * values[low] + share * values[low + 1]
}

impl Windowed {
    /// The modulation under a window of half-width `end`. The window is 1 over the share `flat` of its width, in its middle, and falls to 0 at its ends.
    fn of(profile: &Spline, pulls: &[Spline], end: f64, flat: f64) -> Self {
        let steps = (end * POINTS_PER_PIXEL as f64) as i64;
        let distances = (-steps..=steps).map(|k| k as f64 / POINTS_PER_PIXEL as f64);
        let points: Vec<(f64, f64)> = distances.map(|at| (at, window(at / end, flat))).collect();
        let mut modulation = Vec::with_capacity(FREQUENCIES);
        let mut by_band = vec![Vec::with_capacity(FREQUENCIES); pulls.len()];
        let mut at_zero: Option<(f64, Vec<f64>)> = None;
        for k in 0..FREQUENCIES {
            let transform = functional(profile.basis, &points, k as f64 * FREQUENCY_STEP);
            let of = |spline: &Spline| {
                let sum = |part: usize| {
                    transform.iter().zip(&spline.coefficients).map(|(t, c)| t[part] * c).sum::<f64>()
                };
                [sum(0), sum(1)]
            };
            let [re, im] = of(profile);
            let pulled: Vec<[f64; 2]> = pulls.iter().map(of).collect();
            let (dc, dc_pulls) =
                at_zero.get_or_insert_with(|| (re.abs().max(1e-300), pulled.iter().map(|p| p[0]).collect()));
            let size = re.hypot(im);
            let m = size / *dc;
            modulation.push(m);
            for ((band, [re_pull, im_pull]), dc_pull) in by_band.iter_mut().zip(&pulled).zip(dc_pulls.iter())
            {
                let along = if size > 0.0 { (re * re_pull + im * im_pull) / size } else { 0.0 };
                band.push((along - m * dc_pull) / *dc);
            }
        }
        Self { modulation, pulls: by_band }
    }
}

/// What each coefficient of a profile adds to the real and the imaginary part of its transform.
fn functional(basis: Basis, points: &[(f64, f64)], frequency: f64) -> Vec<[f64; 2]> {
    let mut parts = vec![[0.0; 2]; basis.len()];
    for (at, weight) in points {
        if let Some((first, slopes)) = basis.slopes(*at) {
            let (sin, cos) = (TAU * frequency * at).sin_cos();
            for (k, slope) in slopes.iter().enumerate() {
                parts[first + k][0] += weight * slope * cos;
                parts[first + k][1] -= weight * slope * sin;
            }
        }
    }
    parts
}

/// Tukey's window: flat up to a share, and a cosine from there to zero at 1.
fn window(place: f64, flat: f64) -> f64 {
    let into_taper = (place.abs() - flat) / (1.0 - flat);
    if into_taper <= 0.0 { 1.0 } else { 0.5 * (1.0 + (PI * into_taper.min(1.0)).cos()) }
}
