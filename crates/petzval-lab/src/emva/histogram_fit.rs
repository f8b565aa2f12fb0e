//! The paper's fourth step as an optimisation: the parameters with which simulated histograms match captured ones.
//!
//! Nothing is drawn at random: the exact distribution of digital numbers ([`pmf`](super::pmf)) is compared with the counts by
//! maximum likelihood (Fisher scoring with a damped step). Free are K, mu_r, mu_el, sigma_el, the noise of the dark in
//! electrons, mu_I, the ratios of the colours, the PRNU and the light of every gain, as far as the captures tell them: held
//! are the noise of the dark and mu_r where there is one gain, mu_I where there is one exposure time, the PRNU where all
//! light is alike, K where there is no flat frame.
//!
//! A histogram holds what differs from pixel to pixel beside what differs from frame to frame:
//!
//! ```text
//! variance = (K g)^2 (lambda + (p lambda)^2 + sigma_r^2 + DSNU^2) + sigma_el^2 + 1/12     [DN^2]
//! ```
//!
//! PRNU (`p`) grows with the square of the light, shot noise with the light, so the histograms tell them apart. DSNU they
//! cannot tell from read noise: the fit finds `sigma_r^2 + DSNU^2`, takes sigma_r from temporal noise (the [`JointFit`]) and
//! reports what is left as DSNU.
//!
//! What lies outside the core of a histogram (median +- 4 standard deviations by its quantiles) does not count in the fit: a
//! tail of hot pixels is not made into noise, but is reported ([`Warning::DarkTail`]). Nor do histograms count that reach
//! the full well or leave the range of photon transfer: they tell of saturation. The errors are those of chance with the
//! pixels of this sensor.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

use super::captures::{Kind, SensorFacts};
use super::characterize::PointHistogram;
use super::joint::JointFit;
use super::measured::{Measured, Unresolved};
use super::pmf::{Response, digital_numbers};
use super::point::Counts;
use super::warning::Warning;
use petzval_camera::sensor::Colour;

/// Parameters of the model that the fit starts from or ends with.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelParameters {
    /// K at linear gain 1, DN/e-.
    pub gain_dn_per_e: f64,
    /// mu_r, e-.
    pub read_noise_mean_e: f64,
    /// BL + mu_el, DN.
    pub dark_offset_dn: f64,
    /// sigma_el, DN.
    pub electronics_noise_dn: f64,
    /// Signal of red over green.
    pub red_over_green: f64,
    /// Signal of blue over green.
    pub blue_over_green: f64,
    /// sigma_r, e-; of a fit to histograms with DSNU in it, which they cannot tell from read noise.
    pub read_noise_e: f64,
    /// mu_I, e-/s.
    pub dark_current_e_per_s: f64,
    /// Full well, e-; always held.
    pub full_well_e: f64,
}

/// Electrons per unit of light in a green (or clear) pixel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LightLevel {
    /// Linear gain of the points.
    pub linear_gain: f64,
    /// Electrons per photon where photons are known, else per second; of a single point where neither tells points apart.
    pub electrons: Measured,
}

/// How well a distribution describes a histogram.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GoodnessOfFit {
    /// `sum (c - e)^2 / e` over bins of at least ten expected samples (or ten captured ones where less than one is expected),
    /// over their number less one.
    pub reduced_chi2: f64,
    /// Largest difference of the cumulative distributions (Kolmogorov-Smirnov), 0..1.
    pub kolmogorov_smirnov: f64,
    /// Half the sum of the absolute differences of the probabilities, 0..1.
    pub total_variation: f64,
}

/// A captured histogram beside the simulated ones.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HistogramComparison {
    /// Whether light fell on the sensor.
    pub kind: Kind,
    /// Linear gain.
    pub linear_gain: f64,
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Colour; `None` for dark frames.
    pub colour: Option<Colour>,
    /// First digital number of the three lists.
    pub first_dn: u32,
    /// Captured samples per digital number.
    pub captured: Vec<u64>,
    /// Expected samples with the parameters before the fit.
    pub expected_before: Vec<f64>,
    /// Expected samples with the fitted parameters.
    pub expected_after: Vec<f64>,
    /// Before the fit.
    pub before: GoodnessOfFit,
    /// After it.
    pub after: GoodnessOfFit,
    /// Reduced chi-square after the fit of the core alone, which tails do not touch.
    pub core_reduced_chi2: f64,
    /// Samples brighter than the core beyond what the model has there, as a share of all.
    pub tail_share: f64,
    /// Standard error of that share.
    pub tail_share_se: f64,
    /// Mean of the samples in the tail above the mean of the histogram, DN.
    pub tail_mean_dn: f64,
}

/// Result of the fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HistogramFit {
    /// Parameters before.
    pub start: ModelParameters,
    /// Parameters after.
    pub fitted: ModelParameters,
    /// K with its standard error, DN/e-.
    pub gain_dn_per_e: Measured,
    /// mu_r, e-.
    pub read_noise_mean_e: Measured,
    /// BL + mu_el, DN.
    pub dark_offset_dn: Measured,
    /// sigma_el, DN.
    pub electronics_noise_dn: Measured,
    /// alpha.
    pub red_over_green: Measured,
    /// beta.
    pub blue_over_green: Measured,
    /// `sqrt(sigma_r^2 + DSNU^2)`: what the histograms tell of the dark, e-.
    pub dark_noise_e: Measured,
    /// sigma_r, e-: of temporal noise where it is known, else with DSNU in it.
    pub read_noise_e: Measured,
    /// DSNU, e-: what the histograms have beyond temporal noise. The error is an upper bound, as both come from the same
    /// frames.
    pub dsnu_e: Measured,
    /// PRNU (with what is uneven in the light), percent.
    pub prnu_percent: Measured,
    /// mu_I, e-/s.
    pub dark_current_e_per_s: Measured,
    /// The light.
    pub light: Vec<LightLevel>,
    /// Steps taken.
    pub steps: usize,
    /// Whether the last step was smaller than a thousandth of the standard errors.
    pub converged: bool,
    /// Histograms that were left out: clipped, at the full well, or beyond the range of photon transfer.
    pub left_out: usize,
    /// Every histogram that was fitted.
    pub histograms: Vec<HistogramComparison>,
}

/// Mean reduced chi-square of the cores from which on the model does not describe the histograms. Pixels that differ count
/// twice in two frames, which alone makes up to 2.
const POOR_MEAN: f64 = 2.0;
/// The same for the worst of the histograms.
const POOR_WORST: f64 = 5.0;
/// Multiple of the standard error from which a difference from the joint fit is no chance.
const DIFFERENT_SIGMAS: f64 = 5.0;

impl HistogramFit {
    /// What is odd about the fit: tails, no convergence, no agreement with the histograms or with the joint fit.
    pub fn warnings(&self, joint: &JointFit) -> Vec<Warning> {
        let mut found = self.dark_tails();
        if !self.converged {
            found.push(Warning::HistogramFitStopped { steps: self.steps });
        }
        found.extend(self.poor());
        if self.is_sound() && self.dark_offset_dn.standard_error().is_none() {
            found.push(Warning::HistogramFitAmbiguous);
        }
        found.extend(self.differences(joint));
        found.extend(self.wider_than_noise(joint));
        found
    }

    /// Whether the fit arrived and describes the histograms. Errors of another would mean nothing.
    pub fn is_sound(&self) -> bool {
        self.converged && describes(&self.histograms)
    }

    /// Warnings of dark histograms with a tail that is no noise: more than five standard errors and 1e-5 of the pixels.
    pub fn dark_tails(&self) -> Vec<Warning> {
        let dark = self.histograms.iter().filter(|h| h.kind == Kind::Dark);
        dark.filter(|h| h.tail_share > 5.0 * h.tail_share_se && h.tail_share > 1e-5)
            .map(|h| Warning::DarkTail { point: h.label(), share: h.tail_share, mean_dn: h.tail_mean_dn })
            .collect()
    }

    /// A fit that does not describe the histograms.
    fn poor(&self) -> Option<Warning> {
        let worst =
            self.histograms.iter().max_by(|a, b| a.core_reduced_chi2.total_cmp(&b.core_reduced_chi2))?;
        (!describes(&self.histograms)).then(|| Warning::PoorHistogramFit {
            mean_chi2: mean_core_chi2(&self.histograms),
            worst_chi2: worst.core_reduced_chi2,
            point: worst.label(),
        })
    }

    /// Parameters that differ from those of the joint fit, by more than five standard errors and more than matters.
    fn differences(&self, joint: &JointFit) -> Vec<Warning> {
        let relative = |m: Measured, share: f64| m.value().map_or(0.0, |v| share * v.abs());
        let pairs = [
            ("K", self.gain_dn_per_e, joint.gain_dn_per_e, relative(joint.gain_dn_per_e, 0.005)),
            ("mu_r", self.read_noise_mean_e, joint.read_noise_mean_e, 0.05),
            ("BL + mu_el", self.dark_offset_dn, joint.dark_offset_dn, 0.02),
            ("alpha", self.red_over_green, joint.red_over_green, relative(joint.red_over_green, 0.005)),
            ("beta", self.blue_over_green, joint.blue_over_green, relative(joint.blue_over_green, 0.005)),
            (
                "mu_I",
                self.dark_current_e_per_s,
                joint.dark_current_e_per_s,
                relative(joint.dark_current_e_per_s, 0.05),
            ),
        ];
        let mut found = Vec::new();
        for (parameter, fitted, joint, matters) in pairs {
            let (Some(value), Some(expected)) = (fitted.value(), joint.value()) else { continue };
            let standard_error = fitted.error_or_zero().hypot(joint.error_or_zero());
            if (value - expected).abs() > (DIFFERENT_SIGMAS * standard_error).max(matters) {
                found.push(Warning::HistogramFitDiffers {
                    parameter,
                    fitted: value,
                    joint: expected,
                    standard_error,
                });
            }
        }
        found
    }

    /// Dark histograms wider than temporal noise: by electrons, which shows best at the largest gain, or by digital numbers,
    /// at the least.
    fn wider_than_noise(&self, joint: &JointFit) -> Option<Warning> {
        let above = |fitted: Measured, temporal: Measured| {
            let (Some(f), Some(t)) = (fitted.value(), temporal.value()) else { return false };
            let se = fitted.error_or_zero().hypot(temporal.error_or_zero());
            f - t > DIFFERENT_SIGMAS * se && f > 1.02 * t
        };
        let gains = || joint.rows.iter().map(|r| r.linear_gain);
        let gain = match above(self.dark_noise_e, joint.read_noise_e) {
            true => gains().fold(0.0, f64::max),
            false if above(self.electronics_noise_dn, joint.electronics_noise_dn) => {
                gains().fold(f64::INFINITY, f64::min)
            }
            false => return None,
        };
        let dark_dn = |k: Measured, electrons: Measured, electronics: Measured| {
            Some((k.value()? * gain * electrons.value()?).hypot(electronics.value().unwrap_or(0.0)))
        };
        Some(Warning::WiderThanNoise {
            fitted_dn: dark_dn(self.gain_dn_per_e, self.dark_noise_e, self.electronics_noise_dn)?,
            temporal_dn: dark_dn(joint.gain_dn_per_e, joint.read_noise_e, joint.electronics_noise_dn)?,
        })
    }
}

impl HistogramComparison {
    /// The setting in words.
    fn label(&self) -> String {
        let (gain, ms) = (self.linear_gain, 1e3 * self.exposure_s);
        let colour = self.colour.map_or(String::new(), |c| format!(", {c:?}").to_lowercase());
        let kind = if self.kind == Kind::Flat { "flat" } else { "dark" };
        format!("{kind}, gain {gain}, {ms} ms{colour}")
    }
}

fn mean_core_chi2(histograms: &[HistogramComparison]) -> f64 {
    histograms.iter().map(|h| h.core_reduced_chi2).sum::<f64>() / histograms.len().max(1) as f64
}

/// Whether the model describes the cores of the histograms.
fn describes(histograms: &[HistogramComparison]) -> bool {
    let worst = histograms.iter().map(|h| h.core_reduced_chi2).fold(0.0, f64::max);
    mean_core_chi2(histograms) <= POOR_MEAN && worst <= POOR_WORST
}

/// Number of parameters before the light levels.
const SHARED: usize = 9;
/// Place of the square of the PRNU among them.
const PRNU: usize = 8;
/// Half width of the core of a histogram in standard deviations.
const CORE_SIGMAS: f64 = 4.0;
/// More electrons than a pixel holds: a step that goes there has lost its way.
const MOST_ELECTRONS: f64 = 1e8;
/// Steps after which the fit gives up.
const MOST_STEPS: usize = 40;

/// One histogram as the fit sees it.
struct Sample<'a> {
    histogram: &'a PointHistogram,
    /// Index of its light level among the parameters, and its light in units of the level.
    light: Option<(usize, f64)>,
    /// First and last digital number of the core.
    core: (u32, u32),
}

impl Sample<'_> {
    /// Mean electrons of light.
    fn electrons(&self, theta: &[f64]) -> f64 {
        self.light.map_or(0.0, |(i, unit)| theta[i] * unit * ratio(theta, self.histogram.colour))
    }
}

/// Fits from what the joint fit found. `None` if it did not find gain, read noise or offset, or no histogram is usable.
pub fn fit_histograms(
    sensor: &SensorFacts,
    joint: &JointFit,
    histograms: &[PointHistogram],
) -> Option<HistogramFit> {
    let start = ModelParameters {
        gain_dn_per_e: joint.gain_dn_per_e.value()?,
        read_noise_mean_e: joint.read_noise_mean_e.value()?,
        dark_offset_dn: joint.dark_offset_dn.value()?,
        electronics_noise_dn: joint.electronics_noise_dn.value().unwrap_or(0.1),
        red_over_green: joint.red_over_green.value().unwrap_or(1.0),
        blue_over_green: joint.blue_over_green.value().unwrap_or(1.0),
        read_noise_e: joint.read_noise_e.value()?,
        dark_current_e_per_s: joint.dark_current_e_per_s.value().unwrap_or(0.0),
        full_well_e: sensor.full_well_e.unwrap_or(f64::INFINITY),
    };
    let mut fit = fit_histograms_from(&start, sensor.bits, histograms)?;
    // What differs from frame to frame is read noise; the rest of the dark histograms is what differs between pixels.
    fit.read_noise_e = joint.read_noise_e;
    fit.dsnu_e = match fit.dark_noise_e.standard_error() {
        Some(_) => fit.dark_noise_e.squared().minus(joint.read_noise_e.squared()).if_above_noise().root(),
        None => Measured::none(Unresolved::FollowsFrom("the error of the dark noise")),
    };
    Some(fit)
}

/// Fits from given parameters.
pub fn fit_histograms_from(
    start: &ModelParameters,
    bits: u32,
    histograms: &[PointHistogram],
) -> Option<HistogramFit> {
    fit_in_steps(start, bits, histograms, MOST_STEPS)
}

fn fit_in_steps(
    start: &ModelParameters,
    bits: u32,
    histograms: &[PointHistogram],
    most_steps: usize,
) -> Option<HistogramFit> {
    let max_dn = (1u32 << bits) - 1;
    let usable: Vec<&PointHistogram> = histograms.iter().filter(|h| is_usable(h, start, max_dn)).collect();
    let (samples, mut theta, level_gains) = arrange(start, &usable)?;
    if !plausible(&samples, &theta) {
        return None;
    }
    let free = free_parameters(&samples, &theta);

    // Fisher scoring: the step is the inverse information times the slope of the log likelihood.
    let first_theta = theta.clone();
    let mut state = score(start, max_dn, &samples, &theta);
    let (mut damping, mut steps, mut converged) = (0.0, 0, false);
    while steps < most_steps && !converged {
        steps += 1;
        let Some(step) = solve(&state, &free, damping) else {
            damping = if damping == 0.0 { 1e-4 } else { 10.0 * damping };
            continue;
        };
        let mut trial = theta.clone();
        free.iter().zip(step.iter()).for_each(|(i, d)| trial[*i] += d);
        if !plausible(&samples, &trial) {
            damping = if damping == 0.0 { 1e-3 } else { 10.0 * damping };
            continue;
        }
        let next = score(start, max_dn, &samples, &trial);
        let gain = next.log_likelihood - state.log_likelihood;
        if !gain.is_finite() || gain < -1e-6 * state.log_likelihood.abs().min(1.0) {
            damping = if damping == 0.0 { 1e-3 } else { 10.0 * damping };
            continue;
        }
        // The expected gain of the step is half its square in standard errors.
        let decrement: f64 = free.iter().zip(step.iter()).map(|(i, d)| state.slope[*i] * d).sum();
        converged = decrement < 1e-6;
        (theta, state, damping) = (trial, next, 0.1 * damping);
    }

    let comparisons: Vec<HistogramComparison> =
        samples.par_iter().map(|sample| compare(sample, start, max_dn, &first_theta, &theta)).collect();
    // Errors of a fit that did not arrive, or of a model that is not that of the histograms, would mean nothing.
    let is_sound = converged && describes(&comparisons);
    let covariance = is_sound.then(|| covariance(&state, &free)).flatten();
    let measured = |i: usize| match (free.iter().position(|f| *f == i), &covariance) {
        (Some(k), Some(c)) => Measured::new(theta[i], c[(k, k)].max(0.0).sqrt()),
        _ => Measured::exact(theta[i]),
    };
    let prnu = match free.contains(&PRNU) {
        true => measured(PRNU).if_above_noise().root().scale(100.0),
        false => Measured::none(Unresolved::TooFewExposures { got: 1, need: 2 }),
    };
    Some(HistogramFit {
        start: start.clone(),
        fitted: parameters(start, &theta),
        gain_dn_per_e: measured(0),
        read_noise_mean_e: measured(1),
        dark_offset_dn: measured(2),
        electronics_noise_dn: measured(3),
        red_over_green: measured(4),
        blue_over_green: measured(5),
        dark_noise_e: measured(6),
        read_noise_e: measured(6),
        dsnu_e: Measured::none(Unresolved::FollowsFrom("the temporal noise")),
        prnu_percent: prnu,
        dark_current_e_per_s: measured(7),
        light: level_gains
            .iter()
            .enumerate()
            .map(|(i, g)| LightLevel { linear_gain: *g, electrons: measured(SHARED + i) })
            .collect(),
        steps,
        converged,
        left_out: histograms.len() - usable.len(),
        histograms: comparisons,
    })
}

/// Whether the core of a histogram is neither clipped by the converter nor by the full well. Whole samples do not matter, so
/// that no chance of the extremes chooses.
fn is_usable(h: &PointHistogram, start: &ModelParameters, max_dn: u32) -> bool {
    let (low, high) = core(&h.counts);
    let electrons = (f64::from(high) - start.dark_offset_dn) / (start.gain_dn_per_e * h.linear_gain)
        - start.read_noise_mean_e;
    let below_full = h.kind == Kind::Dark || electrons < start.full_well_e;
    h.counts.total() > 0 && h.in_range && low > 0 && high < max_dn && below_full
}

/// The samples, the parameters to start from, and the linear gain of each light level.
fn arrange<'a>(
    start: &ModelParameters,
    histograms: &[&'a PointHistogram],
) -> Option<(Vec<Sample<'a>>, Vec<f64>, Vec<f64>)> {
    let mut theta = vec![
        start.gain_dn_per_e,
        start.read_noise_mean_e,
        start.dark_offset_dn,
        start.electronics_noise_dn,
        start.red_over_green,
        start.blue_over_green,
        start.read_noise_e,
        start.dark_current_e_per_s,
        0.0,
    ];
    // Points of one gain share one level if their exposure times or photons say how their light compares; the colours of a point
    // always do.
    let mut levels: Vec<(f64, Option<usize>)> = Vec::new();
    let mut samples = Vec::new();
    for histogram in histograms {
        let light = match histogram.kind {
            Kind::Dark => None,
            Kind::Flat => {
                // Photons count where all points of the gain state them: seconds and photons do not compare.
                let of_gain =
                    |h: &&&PointHistogram| h.kind == Kind::Flat && h.linear_gain == histogram.linear_gain;
                let by_photons = histograms.iter().filter(of_gain).all(|h| h.photons.is_some());
                let told = |h: &PointHistogram| h.photons.filter(|_| by_photons).unwrap_or(h.exposure_s);
                let mean = mean_dn(&histogram.counts);
                let twins = |h: &&&PointHistogram| {
                    h.kind == Kind::Flat
                        && h.colour == histogram.colour
                        && h.linear_gain == histogram.linear_gain
                        && told(h) == told(histogram)
                };
                let alone = histograms.iter().filter(twins).count() > 1;
                let key = (histogram.linear_gain, alone.then_some(histogram.point));
                let unit = told(histogram).max(1e-12);
                let index = levels.iter().position(|l| *l == key).unwrap_or_else(|| {
                    let e = (mean - start.dark_offset_dn) / (start.gain_dn_per_e * histogram.linear_gain)
                        - start.read_noise_mean_e
                        - start.dark_current_e_per_s * histogram.exposure_s;
                    theta.push(e.max(1.0) / (unit * ratio(&theta, histogram.colour)));
                    levels.push(key);
                    levels.len() - 1
                });
                Some((SHARED + index, unit))
            }
        };
        samples.push(Sample { histogram, light, core: core(&histogram.counts) });
    }
    let gains = levels.iter().map(|l| l.0).collect();
    (!samples.is_empty()).then_some((samples, theta, gains))
}

fn ratio(theta: &[f64], colour: Option<Colour>) -> f64 {
    match colour {
        Some(Colour::Red) => theta[4],
        Some(Colour::Blue) => theta[5],
        _ => 1.0,
    }
}

/// Mean of a histogram, DN.
fn mean_dn(counts: &Counts) -> f64 {
    let sum: f64 = counts.counts.iter().enumerate().map(|(i, c)| i as f64 * *c as f64).sum();
    f64::from(counts.first_dn) + sum / counts.total().max(1) as f64
}

/// Median +- so many standard deviations, half the distance of the 16 % and 84 % quantiles.
fn core(counts: &Counts) -> (u32, u32) {
    let total = counts.total() as f64;
    let quantile = |share: f64| {
        let mut below = 0.0;
        for (i, c) in counts.counts.iter().enumerate() {
            // Within a bin the samples are taken as evenly spread.
            if below + *c as f64 >= share * total {
                return f64::from(counts.first_dn) + i as f64 - 0.5
                    + (share * total - below) / (*c as f64).max(1.0);
            }
            below += *c as f64;
        }
        f64::from(counts.last_dn())
    };
    let (median, sigma) = (quantile(0.5), 0.5 * (quantile(0.8413) - quantile(0.1587)));
    let reach = CORE_SIGMAS * sigma.max(0.5);
    // Not cut to what occurs: the extremes are chance, and limits that follow them would make the noise too small.
    ((median - reach).floor().max(0.0) as u32, (median + reach).ceil() as u32)
}

/// Which parameters the histograms can tell: K and light need flat frames, mu_r and sigma_r a second gain, mu_I a second
/// exposure time of dark frames, the ratios their colours, PRNU light of twice the strength of other light.
fn free_parameters(samples: &[Sample<'_>], theta: &[f64]) -> Vec<usize> {
    let flat = samples.iter().any(|s| s.light.is_some());
    let has = |colour| samples.iter().any(|s| s.histogram.colour == Some(colour));
    let green = has(Colour::Green);
    let several = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.dedup();
        values.len() > 1
    };
    let gains = several(samples.iter().map(|s| s.histogram.linear_gain).collect());
    let dark = samples.iter().filter(|s| s.light.is_none());
    let times = several(dark.map(|s| s.histogram.exposure_s).collect()) && theta[7] > 0.0;
    let (red, blue) = (green && has(Colour::Red), green && has(Colour::Blue));
    let lights: Vec<f64> = samples.iter().filter(|s| s.light.is_some()).map(|s| s.electrons(theta)).collect();
    let brightest = lights.iter().copied().fold(0.0, f64::max);
    let contrast = lights.iter().any(|l| 2.0 * l < brightest);
    let told = [flat, gains, true, true, red, blue, gains, times, contrast];
    (0..theta.len()).filter(|i| told.get(*i).copied().unwrap_or(true)).collect()
}

fn plausible(samples: &[Sample<'_>], theta: &[f64]) -> bool {
    let positive = |i: usize| theta[i] > 0.0;
    theta.iter().all(|t| t.is_finite())
        && [0, 3, 4, 5, 6].into_iter().all(positive)
        && theta[7] >= 0.0
        && (SHARED..theta.len()).all(positive)
        && samples.iter().all(|s| s.electrons(theta) < MOST_ELECTRONS)
}

fn parameters(start: &ModelParameters, theta: &[f64]) -> ModelParameters {
    ModelParameters {
        gain_dn_per_e: theta[0],
        read_noise_mean_e: theta[1],
        dark_offset_dn: theta[2],
        electronics_noise_dn: theta[3],
        red_over_green: theta[4],
        blue_over_green: theta[5],
        read_noise_e: theta[6],
        dark_current_e_per_s: theta[7],
        full_well_e: start.full_well_e,
    }
}

/// Distribution of a sample under the parameters.
fn distribution(sample: &Sample<'_>, held: &ModelParameters, max_dn: u32, theta: &[f64]) -> Vec<f64> {
    let h = sample.histogram;
    let light = sample.electrons(theta);
    let response = Response {
        gain_dn_per_e: theta[0] * h.linear_gain,
        read_noise_mean_e: theta[1],
        read_noise_e: theta[6],
        offset_dn: theta[2],
        electronics_noise_dn: theta[3],
        pattern_variance_e2: theta[PRNU] * light * light,
        full_well_e: held.full_well_e,
        max_dn,
    };
    digital_numbers(light + theta[7] * h.exposure_s, &response)
}

/// Log likelihood of the cores, its slope and its information.
struct Score {
    log_likelihood: f64,
    slope: Vec<f64>,
    information: DMatrix<f64>,
}

fn score(held: &ModelParameters, max_dn: u32, samples: &[Sample<'_>], theta: &[f64]) -> Score {
    let parts: Vec<Core> = samples.par_iter().map(|s| derivatives(s, held, max_dn, theta)).collect();
    let n = theta.len();
    let mut total = Score { log_likelihood: 0.0, slope: vec![0.0; n], information: DMatrix::zeros(n, n) };
    for (sample, Core { log_likelihood, slopes, p }) in samples.iter().zip(&parts) {
        total.log_likelihood += log_likelihood;
        let counts = |k: usize| sample.histogram.counts.at(i64::from(sample.core.0) + k as i64) as f64;
        let all: f64 = (0..p.len()).map(counts).sum();
        for (i, di) in slopes {
            total.slope[*i] += di.iter().enumerate().map(|(k, d)| counts(k) * d).sum::<f64>();
            for (j, dj) in slopes {
                total.information[(*i, *j)] +=
                    all * p.iter().zip(di.iter().zip(dj)).map(|(p, (a, b))| p * a * b).sum::<f64>();
            }
        }
    }
    total
}

/// The core of one histogram under the parameters.
struct Core {
    log_likelihood: f64,
    /// Per parameter that it depends on: the derivative of the logarithm of each probability.
    slopes: Vec<(usize, Vec<f64>)>,
    /// Probability of each digital number, given that it lies in the core.
    p: Vec<f64>,
}

fn derivatives(sample: &Sample<'_>, held: &ModelParameters, max_dn: u32, theta: &[f64]) -> Core {
    let (low, high) = (sample.core.0 as usize, sample.core.1 as usize);
    let within = |theta: &[f64]| {
        let p = distribution(sample, held, max_dn, theta);
        let total: f64 = p[low..=high].iter().sum::<f64>().max(1e-300);
        p[low..=high].iter().map(|p| (p / total).max(1e-300)).collect::<Vec<f64>>()
    };
    let p = within(theta);
    let log_likelihood =
        p.iter().enumerate().map(|(k, p)| sample.histogram.counts.at((low + k) as i64) as f64 * p.ln()).sum();
    let mut touched = vec![0, 1, 2, 3, 6, 7];
    if let Some((level, _)) = sample.light {
        touched.extend([level, PRNU]);
        match sample.histogram.colour {
            Some(Colour::Red) => touched.push(4),
            Some(Colour::Blue) => touched.push(5),
            _ => {}
        }
    }
    let slopes = touched
        .into_iter()
        .map(|i| {
            // Central differences: the distribution is smooth and good to 1e-11.
            let step = match i {
                1..=3 | 6 => 1e-4,
                7 => 1e-3 * theta[i].abs().max(1.0),
                // A ten thousandth of the variance of shot noise.
                PRNU => 1e-4 / sample.electrons(theta).max(1.0),
                _ => 1e-5 * theta[i].abs(),
            };
            let at = |d: f64| {
                let mut moved = theta.to_vec();
                moved[i] += d;
                within(&moved)
            };
            let (up, down) = (at(step), at(-step));
            (i, up.iter().zip(&down).map(|(u, d)| (u.ln() - d.ln()) / (2.0 * step)).collect())
        })
        .collect();
    Core { log_likelihood, slopes, p }
}

fn information(state: &Score, free: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(free.len(), free.len(), |i, j| state.information[(free[i], free[j])])
}

/// Inverse of the information, by way of a unit diagonal: the parameters' units span many powers of ten.
fn covariance(state: &Score, free: &[usize]) -> Option<DMatrix<f64>> {
    let raw = information(state, free);
    let scale: Vec<f64> = (0..free.len()).map(|i| raw[(i, i)].sqrt()).collect();
    let unit = DMatrix::from_fn(free.len(), free.len(), |i, j| raw[(i, j)] / (scale[i] * scale[j]));
    let inverse = unit.cholesky()?.inverse();
    Some(DMatrix::from_fn(free.len(), free.len(), |i, j| inverse[(i, j)] / (scale[i] * scale[j])))
}

/// Solves for a step, with the diagonal raised by the damping.
fn solve(state: &Score, free: &[usize], damping: f64) -> Option<DVector<f64>> {
    // Scaled to a unit diagonal, so that the units of the parameters do not matter.
    let raw = information(state, free);
    let scale: Vec<f64> = (0..free.len()).map(|i| raw[(i, i)].sqrt()).collect();
    if scale.iter().any(|s| !s.is_finite() || *s == 0.0) {
        return None;
    }
    let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| {
        raw[(i, j)] / (scale[i] * scale[j]) + if i == j { damping } else { 0.0 }
    });
    let slope = DVector::from_fn(free.len(), |i, _| state.slope[free[i]] / scale[i]);
    let step = matrix.cholesky()?.solve(&slope);
    Some(DVector::from_fn(free.len(), |i, _| step[i] / scale[i]))
}

fn compare(
    sample: &Sample<'_>,
    held: &ModelParameters,
    max_dn: u32,
    before: &[f64],
    after: &[f64],
) -> HistogramComparison {
    let h = sample.histogram;
    let n = h.counts.total() as f64;
    let [p_before, p_after] = [before, after].map(|theta| distribution(sample, held, max_dn, theta));
    // What the model has beyond the captured range belongs to the picture too.
    let visible = |p: &f64| n * p >= 0.5;
    let first = (h.counts.first_dn as usize).min(p_after.iter().position(visible).unwrap_or(usize::MAX));
    let last = (h.counts.last_dn() as usize).max(p_after.iter().rposition(visible).unwrap_or(0));
    let captured: Vec<u64> = (first..=last).map(|y| h.counts.at(y as i64)).collect();
    let expected = |p: &[f64]| p[first..=last].iter().map(|p| n * p).collect::<Vec<f64>>();
    let (expected_before, expected_after) = (expected(&p_before), expected(&p_after));

    let (low, high) = (sample.core.0 as usize, sample.core.1 as usize);
    let within: Vec<u64> = (low..=high).map(|y| h.counts.at(y as i64)).collect();
    let n_within = within.iter().sum::<u64>() as f64;
    let share = p_after[low..=high].iter().sum::<f64>().max(1e-300);
    let expected_within: Vec<f64> = p_after[low..=high].iter().map(|p| n_within * p / share).collect();

    let beyond = high + 1;
    let in_tail: Vec<(f64, f64)> =
        (beyond..=last.max(beyond)).map(|y| (y as f64, h.counts.at(y as i64) as f64)).collect();
    let (found, mean) = (in_tail.iter().map(|(_, c)| c).sum::<f64>(), mean_dn(&h.counts));
    let explained: f64 = n * p_after.iter().skip(beyond).sum::<f64>();
    let above: f64 = in_tail.iter().map(|(y, c)| (y - mean) * c).sum();
    HistogramComparison {
        kind: h.kind,
        linear_gain: h.linear_gain,
        exposure_s: h.exposure_s,
        colour: h.colour,
        first_dn: first as u32,
        before: goodness(&captured, &expected_before, n),
        after: goodness(&captured, &expected_after, n),
        core_reduced_chi2: goodness(&within, &expected_within, n_within).reduced_chi2,
        captured,
        expected_before,
        expected_after,
        tail_share: (found - explained) / n,
        tail_share_se: (explained + 1.0).sqrt() / n,
        tail_mean_dn: if found > 0.0 { above / found } else { 0.0 },
    }
}

/// Compares counts with expected counts of the same digital numbers; `n` samples in all.
pub fn goodness(captured: &[u64], expected: &[f64], n: f64) -> GoodnessOfFit {
    let mut bins: Vec<(f64, f64)> = Vec::new();
    let (mut c_bin, mut e_bin) = (0.0, 0.0);
    let (mut c_sum, mut e_sum, mut ks, mut variation) = (0.0, 0.0, 0.0_f64, 0.0);
    for (c, e) in captured.iter().map(|c| *c as f64).zip(expected) {
        c_sum += c;
        e_sum += e;
        ks = ks.max((c_sum - e_sum).abs() / n);
        variation += 0.5 * (c - e).abs() / n;
        // Neighbouring digital numbers share a bin until ten samples are expected, or are there where the model has none.
        c_bin += c;
        e_bin += e;
        if e_bin >= 10.0 || (c_bin >= 10.0 && e_bin < 1.0) {
            bins.push((c_bin, e_bin));
            (c_bin, e_bin) = (0.0, 0.0);
        }
    }
    // What is left at the end belongs to the last bin: alone it would be divided by next to nothing.
    match bins.last_mut() {
        Some((c, e)) => (*c, *e) = (*c + c_bin, *e + e_bin),
        None => bins.push((c_bin, e_bin)),
    }
    let chi2: f64 = bins.iter().map(|(c, e)| (c - e).powi(2) / e.max(1e-3)).sum();
    GoodnessOfFit {
        reduced_chi2: chi2 / bins.len().saturating_sub(1).max(1) as f64,
        kolmogorov_smirnov: ks,
        total_variation: variation,
    }
}

#[cfg(test)]
mod tests;
