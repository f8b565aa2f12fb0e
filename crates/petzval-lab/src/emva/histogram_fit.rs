//! The paper's fourth step as an optimisation: the parameters with which simulated histograms match captured ones.
//!
//! The fit draws no random numbers: it compares the exact distribution of digital numbers ([`pmf`](super::pmf)) with
//! the counts by maximum likelihood (Fisher scoring with a damped step). Free parameters are K, mu_r, mu_el, sigma_el,
//! the dark noise in electrons, mu_I, the ratios of the colours, the PRNU and the light of every gain. A parameter that
//! the captures do not determine is held: dark noise and mu_r with one gain, mu_I with one exposure time, the PRNU with
//! one light level, K without flat frames.
//!
//! A histogram contains differences between pixels and differences between frames:
//!
//! ```text
//! variance = (K g)^2 (lambda + (p lambda)^2 + sigma_r^2 + DSNU^2) + sigma_el^2 + 1/12     [DN^2]
//! ```
//!
//! PRNU (`p`) grows with the square of the light, shot noise with the light, so the histograms separate them. They do not
//! separate DSNU from read noise: the fit finds `sigma_r^2 + DSNU^2`, takes sigma_r from temporal noise (the [`JointFit`]) and
//! reports the rest as DSNU.
//!
//! The fit uses the core of each histogram (median +- 4 standard deviations from its quantiles), so that a tail of hot
//! pixels is reported ([`DarkTail`](super::warning::Warning::DarkTail)) and not fitted as noise. Histograms that reach
//! the full well or leave the range of photon transfer are saturated and left out. Standard errors are those of
//! temporal noise, with the pixels of this sensor fixed; where the cores scatter by more than their counts say, they are as many times
//! larger.

mod comparison;
mod likelihood;
mod parameter;
mod result;
mod sample;

use petzval_base::Cancelled;
use rayon::prelude::*;

use super::captures::SensorFacts;
use super::counts::PointHistogram;
use super::goodness::Verdict;
use super::joint::JointFit;
use super::measured::{Measured, Unresolved};
use comparison::compare;
pub use comparison::{GoodnessOfFit, HistogramComparison, goodness};
pub use likelihood::Compared;
use likelihood::Score;
pub use parameter::{ModelParameters, Parameter};
pub(super) use result::mean_core_chi2;
pub use result::{FitFlags, HistogramFit, LightLevel};
use result::{describes, test_of};
use sample::{arrange, free_parameters, is_plausible, is_usable};

/// Largest number of steps of the fit.
const MOST_STEPS: usize = 40;

/// Fits from the results of the joint fit. `None` if it did not resolve gain, read noise or offset, or if no histogram
/// is usable.
pub fn fit_histograms(
    sensor: &SensorFacts,
    joint: &JointFit,
    histograms: &[PointHistogram],
    compared: Compared<'_>,
) -> Result<Option<HistogramFit>, Cancelled> {
    let Some(start) = start_of(sensor, joint) else { return Ok(None) };
    let Some(mut fit) = fit_histograms_from(&start, sensor.bits, histograms, compared)? else {
        return Ok(None);
    };
    // Read noise comes from differences between frames; the remaining width of dark histograms is DSNU.
    fit.read_noise_e = joint.read_noise_e;
    fit.dsnu_e = match fit.dark_noise_e.standard_error() {
        Some(_) => fit.dark_noise_e.squared().minus(joint.read_noise_e.squared()).if_above_noise().root(),
        None => Measured::none(Unresolved::FollowsFrom("the error of the dark noise")),
    };
    Ok(Some(fit))
}

/// The results of the joint fit as the parameters from which the histograms are fitted.
fn start_of(sensor: &SensorFacts, joint: &JointFit) -> Option<ModelParameters> {
    Some(ModelParameters {
        gain_dn_per_e: joint.gain_dn_per_e.value()?,
        read_noise_mean_e: joint.read_noise_mean_e.value()?,
        dark_offset_dn: joint.dark_offset_dn.value()?,
        electronics_noise_dn: joint.electronics_noise_dn.value().unwrap_or(0.1),
        red_over_green: joint.red_over_green.value().unwrap_or(1.0),
        blue_over_green: joint.blue_over_green.value().unwrap_or(1.0),
        read_noise_e: joint.read_noise_e.value()?,
        dark_current_e_per_s: joint.dark_current_e_per_s.value().unwrap_or(0.0),
        full_well_e: sensor.full_well_e.unwrap_or(f64::INFINITY),
    })
}

/// Fits from given parameters.
pub fn fit_histograms_from(
    start: &ModelParameters,
    bits: u32,
    histograms: &[PointHistogram],
    compared: Compared<'_>,
) -> Result<Option<HistogramFit>, Cancelled> {
    fit_in_steps(start, bits, histograms, MOST_STEPS, compared)
}

fn fit_in_steps(
    start: &ModelParameters,
    bits: u32,
    histograms: &[PointHistogram],
    most_steps: usize,
    compared: Compared<'_>,
) -> Result<Option<HistogramFit>, Cancelled> {
    let max_dn = (1u32 << bits) - 1;
    let full_well_e = start.full_well_e;
    let usable: Vec<&PointHistogram> = histograms.iter().filter(|h| is_usable(h, start, max_dn)).collect();
    let Some((samples, first_numbers, level_gains)) = arrange(start, &usable) else { return Ok(None) };
    if !is_plausible(&samples, &first_numbers) {
        return Ok(None);
    }
    let free = free_parameters(&samples, &first_numbers);

    // Maximise the likelihood by Fisher scoring. Repeat a step with more damping if it fails, leaves the bounds or goes
    // down.
    let mut numbers = first_numbers.clone();
    let mut state = Score::of(&samples, full_well_e, max_dn, &numbers, compared)?;
    let (mut damping, mut steps, mut converged) = (0.0, 0, false);
    while steps < most_steps && !converged {
        steps += 1;
        let Some(step) = state.step(&free, damping) else {
            damping = if damping == 0.0 { 1e-4 } else { 10.0 * damping };
            continue;
        };
        let mut trial = numbers.clone();
        free.iter().zip(step.iter()).for_each(|(p, d)| trial[*p] += d);
        if !is_plausible(&samples, &trial) {
            damping = if damping == 0.0 { 1e-3 } else { 10.0 * damping };
            continue;
        }
        let next = Score::of(&samples, full_well_e, max_dn, &trial, compared)?;
        let gain = next.log_likelihood - state.log_likelihood;
        if !gain.is_finite() || gain < -1e-6 * state.log_likelihood.abs().min(1.0) {
            damping = if damping == 0.0 { 1e-3 } else { 10.0 * damping };
            continue;
        }
        // The expected gain of the step is half its square in standard errors.
        let decrement: f64 = free.iter().zip(step.iter()).map(|(p, d)| state.slope(*p) * d).sum();
        converged = decrement < 1e-6;
        (numbers, state, damping) = (trial, next, 0.1 * damping);
    }

    // Compare the histograms with the model before and after. Standard errors are valid only if the fit converged and the model
    // describes the histograms.
    let comparisons: Vec<HistogramComparison> = samples
        .par_iter()
        .map(|sample| {
            compared()?;
            Ok(compare(sample, full_well_e, max_dn, &first_numbers, &numbers))
        })
        .collect::<Result<_, Cancelled>>()?;
    let is_poor = !describes(&comparisons);
    let is_sound = converged && !is_poor;
    let covariance = is_sound.then(|| state.covariance(&free)).flatten();
    let mut test = test_of(&comparisons, free.len(), is_poor);
    let scatter = if test.verdict == Verdict::Widened { test.reduced_chi2.sqrt() } else { 1.0 };
    let measured = |p: Parameter| match (free.iter().position(|f| *f == p), &covariance) {
        (Some(k), Some(c)) => Measured::new(numbers[p], scatter * c[(k, k)].max(0.0).sqrt()),
        _ => Measured::exact(numbers[p]),
    };
    let prnu_percent = if free.contains(&Parameter::PrnuSquared) {
        measured(Parameter::PrnuSquared).if_above_noise().root().scale(100.0)
    } else {
        Measured::none(Unresolved::TooFewExposures { got: 1, need: 2 })
    };
    let dark_offset_dn = measured(Parameter::DarkOffset);
    let of_gain = measured(Parameter::Gain).error_or_zero();
    test.model_error = of_gain * (1.0 - 1.0 / (scatter * scatter)).sqrt();
    let is_ambiguous = is_sound && dark_offset_dn.standard_error().is_none();
    let level = |(i, gain): (usize, &f64)| LightLevel {
        linear_gain: *gain,
        electrons: measured(Parameter::Light(i)),
    };
    Ok(Some(HistogramFit {
        start: start.clone(),
        fitted: numbers.model(start),
        gain_dn_per_e: measured(Parameter::Gain),
        read_noise_mean_e: measured(Parameter::ReadNoiseMean),
        dark_offset_dn,
        electronics_noise_dn: measured(Parameter::ElectronicsNoise),
        red_over_green: measured(Parameter::RedOverGreen),
        blue_over_green: measured(Parameter::BlueOverGreen),
        dark_noise_e: measured(Parameter::DarkNoise),
        read_noise_e: measured(Parameter::DarkNoise),
        dsnu_e: Measured::none(Unresolved::FollowsFrom("the temporal noise")),
        prnu_percent,
        dark_current_e_per_s: measured(Parameter::DarkCurrent),
        light: level_gains.iter().enumerate().map(level).collect(),
        steps,
        converged,
        left_out: histograms.len() - usable.len(),
        test,
        flags: FitFlags { is_stopped: !converged, is_poor, is_ambiguous },
        histograms: comparisons,
    }))
}

#[cfg(test)]
mod tests;
