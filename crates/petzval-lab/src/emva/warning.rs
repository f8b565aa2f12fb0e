//! The kinds of warnings about usable captures.

use std::fmt;

use serde::{Serialize, Serializer};

use crate::emva::colour_name::colour_name;
use crate::emva::goodness::{FitTest, Verdict};
use crate::emva::measured::{Measured, Unresolved};
use petzval_camera::sensor::Colour;

/// A warning, by name.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// Flat points are clipped at the largest digital number, or lie beyond the peak of the noise.
    Saturated {
        /// Linear gain.
        linear_gain: f64,
        /// Number of such points.
        points: usize,
        /// Flat points in all.
        of: usize,
    },
    /// Samples are clipped at digital number 0, which biases mean and noise; the point is not used.
    ClippedAtZero {
        /// The point.
        point: String,
        /// Share of the samples.
        share: f64,
    },
    /// The light (or the offset) changes from frame to frame.
    Flicker {
        /// The point.
        point: String,
        /// Largest difference of the frames' means, DN.
        difference_dn: f64,
        /// Its standard error from noise alone, DN.
        standard_error_dn: f64,
    },
    /// A frame differs from the others of its point by more than noise in places: the scene or the camera moved.
    Moved {
        /// The point.
        point: String,
        /// The frame, counted from 1.
        frame: usize,
        /// Largest difference of a block's mean from that of the other frames, DN.
        difference_dn: f64,
        /// Its standard error from noise alone, DN.
        standard_error_dn: f64,
    },
    /// Pixels do not answer light; DSNU and PRNU leave them out.
    DefectPixels {
        /// Linear gain.
        linear_gain: f64,
        /// Colour.
        colour: Colour,
        /// How many.
        pixels: usize,
        /// Row and column of the first, from 0.
        first: [usize; 2],
        /// By how much pixels differ in the dark stack, without and with them, DN.
        dark_dn: [Measured; 2],
        /// By how much pixels differ in the flat stack, without and with them, DN.
        flat_dn: [Measured; 2],
    },
    /// Dark frames are brighter in places: light leaks in, or the sensor glows.
    LightLeak {
        /// The point.
        point: String,
        /// Largest difference of the means of two blocks, DN.
        difference_dn: f64,
    },
    /// The mean of dark frames is not straight over exposure time: light leaks in evenly, or the offset drifts.
    DarkNotLinear {
        /// Linear gain.
        linear_gain: f64,
        /// Exposure time of the point that is furthest off, ms.
        exposure_ms: f64,
        /// Its distance from the line, DN.
        off_dn: f64,
        /// Reduced chi-square of the line.
        reduced_chi2: f64,
    },
    /// Dark current from the mean differs from that from the noise: something else also grows with exposure time.
    DarkCurrentDisagrees {
        /// Dark current from the mean, e-/s.
        mean_e_per_s: f64,
        /// The same minus dark current from the variance, e-/s.
        difference_e_per_s: f64,
        /// Standard error of the difference, e-/s.
        standard_error_e_per_s: f64,
    },
    /// Hot pixels raise the mean dark current.
    HotPixels {
        /// Share of the pixels that are hot.
        share: f64,
        /// Their mean dark current above that of the others, e-/s.
        excess_e_per_s: f64,
        /// Dark current of the others, e-/s.
        ordinary_e_per_s: f64,
        /// Mean dark current of all pixels, e-/s.
        mean_e_per_s: f64,
    },
    /// The flat field is uneven, which raises PRNU without a high-pass.
    NotUniform {
        /// The point.
        point: String,
        /// Largest difference of two blocks' means, percent of the signal.
        percent: f64,
    },
    /// A flat point has no usable dark frames of its gain and exposure time, and is not used.
    NoDark {
        /// The point.
        point: String,
    },
    /// Flat frames are no brighter than the dark ones.
    NoSignal {
        /// The point.
        point: String,
        /// Their mean minus that of the dark ones, DN.
        signal_dn: f64,
        /// Its standard error, DN.
        standard_error_dn: f64,
    },
    /// A fit has few points.
    TooFewPoints {
        /// Linear gain.
        linear_gain: f64,
        /// Number of flat points.
        points: usize,
    },
    /// More light gives a smaller signal.
    NotMonotonic {
        /// The brighter point.
        point: String,
    },
    /// The system gain is not in proportion to the linear gain.
    GainNotProportional {
        /// Linear gain.
        linear_gain: f64,
        /// `K_g / g`, DN/e-.
        gain_dn_per_e: f64,
        /// The median of all gains, DN/e-.
        expected_dn_per_e: f64,
    },
    /// Dark noise is so small that rounding dominates the error of its variance.
    Rounding {
        /// Linear gain.
        linear_gain: f64,
        /// Dark noise, DN.
        noise_dn: f64,
        /// Standard error of its variance by rounding, DN^2.
        error_dn2: f64,
    },
    /// Dark noise is below the least that EMVA 1288 accepts as resolved by a converter.
    DarkNoiseLimit {
        /// Linear gain.
        linear_gain: f64,
    },
    /// The response is far from straight within its range.
    NotLinear {
        /// Linear gain.
        linear_gain: f64,
        /// Colour.
        colour: Colour,
        /// Deviation from the line, percent.
        percent: f64,
        /// Mean of the point that has it, DN.
        mean_dn: f64,
    },
    /// The full well that the list states differs from the measured one.
    FullWellDiffers {
        /// As stated, e-.
        stated_e: f64,
        /// As measured, e-.
        measured_e: f64,
        /// Its standard error, e-.
        standard_error_e: f64,
    },
    /// The dark histogram has a tail of bright pixels that the model lacks: DSNU or hot pixels.
    DarkTail {
        /// The point.
        point: String,
        /// Share of the pixels beyond what the model explains.
        share: f64,
        /// Their mean signal above the dark mean, DN.
        mean_dn: f64,
    },
    /// Dark histograms are wider than temporal noise: DSNU.
    WiderThanNoise {
        /// Standard deviation of the fitted dark histogram at the gain where the difference shows most, DN.
        fitted_dn: f64,
        /// Standard deviation of temporal noise, DN.
        temporal_dn: f64,
    },
    /// The fit to the histograms did not converge.
    HistogramFitStopped {
        /// Steps it took.
        steps: usize,
    },
    /// The histograms do not determine all parameters of the fit.
    HistogramFitAmbiguous,
    /// The fitted model does not describe the histograms.
    PoorHistogramFit {
        /// Mean reduced chi-square of the cores.
        mean_chi2: f64,
        /// The largest.
        worst_chi2: f64,
        /// The point that has it.
        point: String,
    },
    /// The fit to the histograms differs from the joint fit.
    HistogramFitDiffers {
        /// The parameter.
        parameter: &'static str,
        /// By the histograms.
        fitted: f64,
        /// By the joint fit.
        joint: f64,
        /// Standard error of the difference.
        standard_error: f64,
    },
    /// The histograms could not be fitted, because the joint fit lacks a number.
    NoHistogramFit {
        /// The number.
        lacks: &'static str,
    },
    /// Every sample is a multiple of a number: the frames are left-aligned, or were multiplied after the converter.
    CommonFactor {
        /// The number.
        factor: u32,
        /// Largest digital number of the stated bits.
        max_dn: u32,
    },
    /// No sample comes near the largest digital number of the stated bits, or samples pile up below it.
    TopNotReached {
        /// Largest sample, DN.
        largest_dn: u32,
        /// Largest digital number of the stated bits.
        max_dn: u32,
        /// Whether samples pile up at the largest.
        piled: bool,
    },
    /// More electrons than photons.
    QuantumEfficiencyAboveOne {
        /// Linear gain.
        linear_gain: f64,
        /// Colour.
        colour: Colour,
        /// Quantum efficiency, percent.
        percent: f64,
        /// Its standard error, percent.
        standard_error: f64,
    },
    /// The system gain is not resolved: there is no sensor to write.
    NoSensorFile {
        /// Why it is not.
        why: Unresolved,
    },
    /// More than one stack of a kind: only the first is evaluated.
    MoreStacks {
        /// The stack that is not evaluated.
        point: String,
    },
    /// The points of a fit do not lie on its model.
    FitDeparts {
        /// The fit.
        fit: &'static str,
        /// Its gain and colour; empty of fits to all gains.
        place: String,
        /// The test.
        test: FitTest,
        /// Error that the departure adds, as a share of the fitted number, if it is resolved.
        model_share: Option<f64>,
        /// Why the points depart, if the captures show it.
        cause: Option<&'static str>,
    },
    /// Stacks of one gain without a partner of the other kind and the same exposure time.
    LoneStack {
        /// The stack that is not evaluated.
        point: String,
    },
}

impl Warning {
    /// Name of the warning.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Saturated { .. } => "saturated",
            Self::ClippedAtZero { .. } => "clipped-at-zero",
            Self::Flicker { .. } => "flicker",
            Self::Moved { .. } => "moved",
            Self::DefectPixels { .. } => "defect-pixels",
            Self::LightLeak { .. } => "light-leak",
            Self::DarkNotLinear { .. } => "dark-not-linear",
            Self::DarkCurrentDisagrees { .. } => "dark-current-disagrees",
            Self::HotPixels { .. } => "hot-pixels",
            Self::NotUniform { .. } => "not-uniform",
            Self::NoDark { .. } => "no-dark",
            Self::NoSignal { .. } => "no-signal",
            Self::TooFewPoints { .. } => "too-few-points",
            Self::NotMonotonic { .. } => "not-monotonic",
            Self::GainNotProportional { .. } => "gain-not-proportional",
            Self::Rounding { .. } => "rounding",
            Self::DarkNoiseLimit { .. } => "dark-noise-limit",
            Self::NotLinear { .. } => "not-linear",
            Self::FullWellDiffers { .. } => "full-well-differs",
            Self::DarkTail { .. } => "dark-tail",
            Self::WiderThanNoise { .. } => "wider-than-noise",
            Self::HistogramFitStopped { .. } => "histogram-fit-stopped",
            Self::HistogramFitAmbiguous => "histogram-fit-ambiguous",
            Self::PoorHistogramFit { .. } => "poor-histogram-fit",
            Self::HistogramFitDiffers { .. } => "histogram-fit-differs",
            Self::NoHistogramFit { .. } => "no-histogram-fit",
            Self::CommonFactor { .. } => "common-factor",
            Self::TopNotReached { .. } => "top-not-reached",
            Self::QuantumEfficiencyAboveOne { .. } => "quantum-efficiency-above-one",
            Self::NoSensorFile { .. } => "no-sensor-file",
            Self::MoreStacks { .. } => "more-stacks",
            Self::LoneStack { .. } => "lone-stack",
            Self::FitDeparts { .. } => "fit-departs",
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.name())?;
        match self {
            Self::Saturated { linear_gain, points, of } => {
                write!(
                    f,
                    "at gain {linear_gain} {points} of {of} flat points are clipped at the largest digital number or beyond the \
                     peak of the noise"
                )
            }
            Self::ClippedAtZero { point, share } => {
                write!(
                    f,
                    "{point}: {:.2} % of the samples are 0, the point does not count; raise the black level",
                    100.0 * share
                )
            }
            Self::Flicker { point, difference_dn, standard_error_dn } => write!(
                f,
                "{point}: the means of the frames differ by {difference_dn:.3} DN, noise explains {standard_error_dn:.3}"
            ),
            Self::DefectPixels { linear_gain, colour, pixels, first: [row, column], dark_dn, flat_dn } => {
                let by = |spread: &Measured| match spread.value() {
                    Some(dn) => format!("by {dn:.3} DN"),
                    None => "by less than is resolved".to_owned(),
                };
                let spread =
                    |[without, with]: &[Measured; 2]| format!("{} without them and {} with them", by(without), by(with));
                let of_colour = match colour {
                    Colour::Clear => String::new(),
                    filtered => format!("{} ", filtered.name()),
                };
                let (noun, verb) = if *pixels == 1 { ("pixel", "does") } else { ("pixels", "do") };
                write!(
                    f,
                    "at gain {linear_gain}, {pixels} {of_colour}{noun} {verb} not answer light, the first in row {row}, column {column}; \
                     results.json lists them. DSNU and PRNU leave them out: pixels differ in the dark {}, in the light {}",
                    spread(dark_dn),
                    spread(flat_dn)
                )
            }
            Self::Moved { point, frame, difference_dn, standard_error_dn } => write!(
                f,
                "{point}: frame {frame} differs from the others by {difference_dn:.2} DN in a part of the picture, noise \
                 explains {standard_error_dn:.3}; something moved, and the point does not count for K and the dark series"
            ),
            Self::DarkNotLinear { linear_gain, exposure_ms, off_dn, reduced_chi2 } => write!(
                f,
                "at gain {linear_gain} the dark frames of {exposure_ms} ms are {off_dn:+.3} DN off the line over exposure time \
                 (reduced chi^2 {reduced_chi2:.1}); light leaks in, or the offset drifts"
            ),
            Self::DarkCurrentDisagrees { mean_e_per_s, difference_e_per_s, standard_error_e_per_s } => {
                write!(
                    f,
                    "the dark current of the mean, {mean_e_per_s:.4} e-/s, is {difference_e_per_s:+.4} +- \
                 {standard_error_e_per_s:.2} e-/s off that of the noise; light leaks in, or the offset drifts"
                )
            }
            Self::LightLeak { point, difference_dn } => write!(
                f,
                "{point}: parts of the dark frames differ by {difference_dn:.2} DN; light leaks in, or the sensor glows"
            ),
            Self::HotPixels { share, excess_e_per_s, ordinary_e_per_s, mean_e_per_s } => write!(
                f,
                "{:.3} % of the pixels are hot, by {excess_e_per_s:.1} e-/s on average; the others have {ordinary_e_per_s:.3} \
                 e-/s, the mean of all is {mean_e_per_s:.3} e-/s",
                100.0 * share
            ),
            Self::NotUniform { point, percent } => {
                write!(f, "{point}: parts of the flat field differ by {percent:.1} %")
            }
            Self::NoDark { point } => {
                write!(
                    f,
                    "{point}: no usable dark frames of this gain and exposure time; the point does not count"
                )
            }
            Self::NoSignal { point, signal_dn, standard_error_dn } => write!(
                f,
                "{point}: no brighter than the dark frames ({signal_dn:+.3} +- {standard_error_dn:.3} DN); the point does not \
                 count"
            ),
            Self::TooFewPoints { linear_gain, points } => {
                write!(
                    f,
                    "at gain {linear_gain} there are {points} flat points; 50 are usual, 3 the least for a straight line"
                )
            }
            Self::NotMonotonic { point } => write!(f, "{point}: darker than a point with less light"),
            Self::GainNotProportional { linear_gain, gain_dn_per_e, expected_dn_per_e } => write!(
                f,
                "at linear gain {linear_gain} the system gain is {gain_dn_per_e:.5} DN/e- per unit of linear gain, the \
                 median of all gains is {expected_dn_per_e:.5}"
            ),
            Self::Rounding { linear_gain, noise_dn, error_dn2 } => write!(
                f,
                "at gain {linear_gain} dark noise is {noise_dn:.2} DN: rounding to whole digital numbers dominates the error of its \
                 variance, {error_dn2:.4} DN^2, which counts in the errors of K, dark current, read noise, electronics noise, noise of rows and columns, \
                 DSNU and PRNU"
            ),
            Self::DarkNoiseLimit { linear_gain } => write!(
                f,
                "at gain {linear_gain} dark noise is below 0.49 DN, the least that EMVA 1288 accepts as resolved by a converter: \
                 sigma_d, u_e_min and u_p_min are upper limits, DR is a lower one"
            ),
            Self::NotLinear { linear_gain, colour, percent, mean_dn } => write!(
                f,
                "at gain {linear_gain} the {} point of {mean_dn:.0} DN is {percent:+.1} % off the straight line: are photons and \
                 exposure times of the list right?",
                colour.name()
            ),
            Self::FullWellDiffers { stated_e, measured_e, standard_error_e } => write!(
                f,
                "the list states a full well of {stated_e} e-, and the signal ends at {measured_e:.0} +- {standard_error_e:.0} e-; \
                 sensor.toml holds what is stated"
            ),
            Self::DarkTail { point, share, mean_dn } => write!(
                f,
                "{point}: {:.3} % of the pixels are brighter than the model of the noise explains, by {mean_dn:.1} DN on \
                 average: hot pixels or dark signal non-uniformity, which the fit leaves out",
                100.0 * share
            ),
            Self::WiderThanNoise { fitted_dn, temporal_dn } => write!(
                f,
                "dark histograms spread by {fitted_dn:.4} DN, temporal noise by {temporal_dn:.4}; pixels differ by DSNU"
            ),
            Self::HistogramFitStopped { steps } => write!(
                f,
                "the fit to the histograms had not converged after {steps} steps; its numbers have no standard errors"
            ),
            Self::HistogramFitAmbiguous => f.write_str(
                "the histograms do not determine all parameters of the fit; its numbers have no standard errors",
            ),
            Self::PoorHistogramFit { mean_chi2, worst_chi2, point } => write!(
                f,
                "the fitted model does not describe the histograms: reduced chi^2 is {mean_chi2:.2} on average and \
                 {worst_chi2:.2} at {point}; its numbers have no standard errors"
            ),
            Self::HistogramFitDiffers { parameter, fitted, joint, standard_error } => write!(
                f,
                "the histograms give {parameter} = {fitted:.5}, the joint fit {joint:.5}; chance explains \
                 {standard_error:.5}"
            ),
            Self::NoHistogramFit { lacks } => {
                write!(
                    f,
                    "the histograms are not fitted: {lacks} is not resolved; it takes three gains or more"
                )
            }
            Self::CommonFactor { factor, max_dn } => {
                write!(f, "every sample is a multiple of {factor}: ")?;
                if !factor.is_power_of_two() {
                    return f.write_str(
                        "they were multiplied after the converter, and K, means and noise with them",
                    );
                }
                let (bits, most) = (bits_of(max_dn / factor), bits_of(*max_dn));
                let shift = factor.trailing_zeros();
                write!(
                    f,
                    "are the frames left-aligned, {bits} bits in {most}? Shift them down by {shift} bits and set `bits`; K, \
                     means and noise are {factor} times too large"
                )
            }
            Self::TopNotReached { largest_dn, max_dn, piled } => {
                write!(f, "no sample is above {largest_dn} of {max_dn}")?;
                if *piled {
                    write!(f, ", where samples pile up")?;
                }
                write!(f, ": is `bits` = {} right, and the light not too weak? ", bits_of(*max_dn))?;
                match bits_of(*largest_dn) {
                    fewer if fewer < bits_of(*max_dn) => write!(f, "{fewer} bits hold all samples"),
                    _ => write!(f, "what is clipped there does not count"),
                }
            }
            Self::QuantumEfficiencyAboveOne { linear_gain, colour, percent, standard_error } => write!(
                f,
                "at gain {linear_gain}, {}, the quantum efficiency is {percent:.1} +- {standard_error:.1} %, more electrons than \
                 photons; are `photons` those of one pixel and one exposure?",
                colour_name(*colour)
            ),
            Self::NoSensorFile { why } => {
                write!(
                    f,
                    "K is not resolved ({why}), so there is no sensor to write; sensor.toml is left out"
                )
            }
            Self::MoreStacks { point } => {
                write!(f, "{point}: another stack of this gain is evaluated already")
            }
            Self::FitDeparts { fit, place, test, model_share, cause } => {
                let at = if place.is_empty() { String::new() } else { format!("{place}: ") };
                write!(
                    f,
                    "{at}the points of the fit of {fit} depart from its model (reduced chi^2 {:.2} at {} degrees of freedom",
                    test.reduced_chi2, test.degrees_of_freedom
                )?;
                if let Some(sigmas) = test.curvature_sigmas {
                    write!(f, ", curvature {sigmas:+.1} standard errors")?;
                }
                if let Some(cause) = cause {
                    write!(f, ", {cause}")?;
                }
                match (test.verdict, model_share) {
                    (Verdict::Withdrawn, _) => write!(f, "); its numbers are withdrawn"),
                    (_, Some(share)) => write!(f, "); the errors contain {:.1} % for it", 100.0 * share),
                    (_, None) => write!(f, "); the errors contain it"),
                }
            }
            Self::LoneStack { point } => {
                write!(
                    f,
                    "{point}: no stack of the other kind with this gain and exposure time; it is not evaluated"
                )
            }
        }
    }
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Bits that hold a digital number.
fn bits_of(dn: u32) -> u32 {
    u32::BITS - dn.leading_zeros()
}
