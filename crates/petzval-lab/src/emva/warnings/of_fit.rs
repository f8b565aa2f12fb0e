//! Warnings about the fit to the histograms: tails, no convergence, no agreement with the histograms or with the joint fit.

use crate::emva::histogram_fit::{HistogramComparison, HistogramFit, Parameter, mean_core_chi2};
use crate::emva::joint::JointFit;
use crate::emva::measured::Measured;
use crate::emva::warning::Warning;

/// Multiple of the standard error above which a difference from the joint fit is not chance.
const DIFFERENT_SIGMAS: f64 = 5.0;

/// The warnings about a fit; `None` if the histograms could not be fitted.
pub fn fit_warnings(fit: Option<&HistogramFit>, joint: &JointFit) -> Vec<Warning> {
    let Some(fit) = fit else {
        return vec![Warning::NoHistogramFit { lacks: lacking(joint) }];
    };
    let tails = fit.histograms.iter().filter(|h| h.has_dark_tail());
    let mut found: Vec<Warning> = tails.map(dark_tail).collect();
    if fit.flags.is_stopped {
        found.push(Warning::HistogramFitStopped { steps: fit.steps });
    }
    if fit.flags.is_poor {
        found.extend(poor(fit));
    }
    if fit.flags.is_ambiguous {
        found.push(Warning::HistogramFitAmbiguous {});
    }
    found.extend(differences(fit, joint));
    found.extend(wider_than_noise(fit, joint));
    found
}

/// The first number that the fit to the histograms needs and the joint fit lacks.
fn lacking(joint: &JointFit) -> &'static str {
    let needed = [
        ("K", joint.gain_dn_per_e),
        ("the read noise", joint.read_noise_e),
        ("its mean", joint.read_noise_mean_e),
        ("the dark offset", joint.dark_offset_dn),
    ];
    let missing = needed.iter().find(|(_, m)| m.value().is_none());
    missing.map_or("a histogram of plausible light and without clipping", |(name, _)| *name)
}

/// The tail of a dark histogram.
fn dark_tail(h: &HistogramComparison) -> Warning {
    Warning::DarkTail { point: h.label(), share: h.tail_share, mean_dn: h.tail_mean_dn }
}

/// The histogram that the model describes worst.
fn poor(fit: &HistogramFit) -> Option<Warning> {
    let worst = fit.histograms.iter().max_by(|a, b| a.core_reduced_chi2.total_cmp(&b.core_reduced_chi2))?;
    Some(Warning::PoorHistogramFit {
        mean_chi2: mean_core_chi2(&fit.histograms),
        worst_chi2: worst.core_reduced_chi2,
        point: worst.label(),
    })
}

/// Parameters that differ from those of the joint fit, by more than five standard errors and by a relevant amount.
fn differences(fit: &HistogramFit, joint: &JointFit) -> Vec<Warning> {
    let share_of = |m: Measured, share: f64| m.value().map_or(0.0, |v| share * v.abs());
    let relative = |parameter, fitted, joint, share| (parameter, fitted, joint, share_of(joint, share));
    let pairs = [
        relative(Parameter::Gain, fit.gain_dn_per_e, joint.gain_dn_per_e, 0.005),
        (Parameter::ReadNoiseMean, fit.read_noise_mean_e, joint.read_noise_mean_e, 0.05),
        (Parameter::DarkOffset, fit.dark_offset_dn, joint.dark_offset_dn, 0.02),
        relative(Parameter::RedOverGreen, fit.red_over_green, joint.red_over_green, 0.005),
        relative(Parameter::BlueOverGreen, fit.blue_over_green, joint.blue_over_green, 0.005),
        relative(Parameter::DarkCurrent, fit.dark_current_e_per_s, joint.dark_current_e_per_s, 0.05),
    ];
    let mut found = Vec::new();
    for (parameter, fitted, joint, matters) in pairs {
        let (Some(value), Some(expected)) = (fitted.value(), joint.value()) else { continue };
        let standard_error = fitted.error_or_zero().hypot(joint.error_or_zero());
        if (value - expected).abs() > (DIFFERENT_SIGMAS * standard_error).max(matters) {
            let parameter = parameter.name();
            let (fitted, joint) = (value, expected);
            found.push(Warning::HistogramFitDiffers { parameter, fitted, joint, standard_error });
        }
    }
    found
}

/// Dark histograms wider than temporal noise. A width in electrons is clearest at the largest gain, one in digital
/// numbers at the smallest.
fn wider_than_noise(fit: &HistogramFit, joint: &JointFit) -> Option<Warning> {
    let above = |fitted: Measured, temporal: Measured| {
        let (Some(f), Some(t)) = (fitted.value(), temporal.value()) else { return false };
        let se = fitted.error_or_zero().hypot(temporal.error_or_zero());
        f - t > DIFFERENT_SIGMAS * se && f > 1.02 * t
    };
    let gains = || joint.rows.iter().map(|r| r.linear_gain);
    let gain = match above(fit.dark_noise_e, joint.read_noise_e) {
        true => gains().fold(0.0, f64::max),
        false if above(fit.electronics_noise_dn, joint.electronics_noise_dn) => {
            gains().fold(f64::INFINITY, f64::min)
        }
        false => return None,
    };
    let dark_dn = |k: Measured, electrons: Measured, electronics: Measured| {
        Some((k.value()? * gain * electrons.value()?).hypot(electronics.value().unwrap_or(0.0)))
    };
    Some(Warning::WiderThanNoise {
        fitted_dn: dark_dn(fit.gain_dn_per_e, fit.dark_noise_e, fit.electronics_noise_dn)?,
        temporal_dn: dark_dn(joint.gain_dn_per_e, joint.read_noise_e, joint.electronics_noise_dn)?,
    })
}
