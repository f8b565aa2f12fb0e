//! The kinds of warnings about usable captures: one row each.

use std::fmt;

use serde::{Serialize, Serializer};

use crate::emva::colour_name::colour_name;
use crate::emva::compressed::Compression;
use crate::emva::goodness::{FitTest, Verdict};
use crate::emva::measured::{Measured, Unresolved};
use crate::emva::shared_noise::SharedNoise;
use petzval_camera::sensor::Colour;

/// Declares the kinds. A row is `Kind at point ("name", severity NUMBER) { fields } => "text", arguments;`.
///
/// `at point` is for warnings about one point, which is then their first field. Severity compares warnings of one kind; without it all are
/// equally severe. The text and the severity see the fields by their names.
macro_rules! warnings {
    (@severity) => { 0.0 };
    (@severity $severity:expr) => { $severity };
    ($(
        #[doc = $about:literal]
        $kind:ident $(at $point:ident)? ($name:literal $(, severity $severity:expr)?) {
            $(#[doc = $meaning:literal] $field:ident: $type:ty,)*
        } => $text:literal $(, $argument:expr)*;
    )*) => {
        /// A warning, by name.
        #[derive(Debug, Clone, PartialEq)]
        pub enum Warning {
            $(#[doc = $about] $kind {
                $(#[doc = " The point."] $point: String,)?
                $(#[doc = $meaning] $field: $type,)*
            },)*
        }

        impl Warning {
            /// Every name, in the order of the rows.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Name of the warning.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$kind { .. } => $name,)* }
            }

            /// The point of a warning, if it has one.
            pub fn point(&self) -> Option<&str> {
                match self {
                    $($(Self::$kind { $point, .. } => Some($point),)?)*
                    _ => None,
                }
            }

            /// Severity of a warning among others of its kind; zero if all are equally severe.
            #[allow(unused_variables, reason = "a row may use any of its fields")]
            pub fn severity(&self) -> f64 {
                match self { $(Self::$kind { $($field,)* .. } => warnings!(@severity $($severity)?),)* }
            }
        }

        impl fmt::Display for Warning {
            #[allow(unused_variables, reason = "a row may use any of its fields")]
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}: ", self.name())?;
                match self {
                    $(Self::$kind { $($point,)? $($field,)* } => write!(f, $text $(, $argument)*),)*
                }
            }
        }
    };
}

warnings! {
    /// Flat points are clipped at the largest digital number, or lie beyond the peak of the noise.
    Saturated("saturated", severity *points as f64 / *of as f64) {
        /// Linear gain.
        linear_gain: f64,
        /// Number of such points.
        points: usize,
        /// Flat points in all.
        of: usize,
    } => "at gain {linear_gain} {points} of {of} flat points are clipped at the largest digital number or beyond the peak of the noise";

    /// Samples are clipped at digital number 0, which biases mean and noise; the point is not used.
    ClippedAtZero at point ("clipped-at-zero", severity *share) {
        /// Share of the samples.
        share: f64,
    } => "{point}: {:.2} % of the samples are 0, the point does not count; raise the black level", 100.0 * share;

    /// The light (or the offset) changes from frame to frame.
    Flicker at point ("flicker", severity difference_dn.abs()) {
        /// Largest difference of the frames' means, DN.
        difference_dn: f64,
        /// Its standard error from noise alone, DN.
        standard_error_dn: f64,
    } => "{point}: the means of the frames differ by {difference_dn:.3} DN, noise explains {standard_error_dn:.3}";

    /// A frame differs from the others of its point by more than noise in places: the scene or the camera moved.
    Moved at point ("moved", severity difference_dn.abs()) {
        /// The frame, counted from 1.
        frame: usize,
        /// Largest difference of a block's mean from that of the other frames, DN.
        difference_dn: f64,
        /// Its standard error from noise alone, DN.
        standard_error_dn: f64,
    } => "{point}: frame {frame} differs from the others by {difference_dn:.2} DN in a part of the picture, noise explains {standard_error_dn:.3}; something moved, and the point does not count for K and the dark series";

    /// Pixels do not answer light; DSNU and PRNU leave them out.
    DefectPixels("defect-pixels") {
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
        /// Error that they add to the mean signal of all pixels, percent.
        bias_percent: Option<f64>,
        /// Figures of the others that are means over all pixels in the standard: name, value, unit.
        of_others: Vec<(&'static str, f64, &'static str)>,
    } => "{}{}", defect_pixels(linear_gain, *colour, *pixels, first, [dark_dn, flat_dn]), signal_bias(*bias_percent, of_others);

    /// Pixels answer neither light nor exposure time; the dark series leaves them out.
    DarkDefects("dark-defects", severity mean_dn.abs()) {
        /// Linear gain.
        linear_gain: f64,
        /// How many.
        pixels: usize,
        /// Mean of the shortest dark frames with them less that without them, DN.
        mean_dn: f64,
    } => "at gain {linear_gain}, dark frames count without pixels that answer neither light nor exposure time ({pixels}): with them their mean is {mean_dn:+.3} DN off; BL + mu_el, mu_r, sigma_r, sigma_el and mu_I of all gains are those of the other pixels";

    /// Dark frames have several black levels by the place of a pixel in the colour filter array.
    BlackLevelsOfColours("black-levels-of-colours", severity range(levels_dn)) {
        /// Linear gain.
        linear_gain: f64,
        /// Colour filter array.
        cfa: String,
        /// Level of each place of its tile in the shortest dark frames, row by row, DN.
        levels_dn: Vec<f64>,
    } => "at gain {linear_gain}, dark frames have a level of their own at each place of {cfa}, row by row: {} DN. BL + mu_el, the black level of sensor.toml and mu_el are the mean of all; sidecars of raw frames take one `black_level_dn` for each place", in_list(levels_dn);

    /// Pixels are bright in dark frames of every exposure time.
    BrightPixels("bright-pixels", severity *pixels as f64) {
        /// Linear gain.
        linear_gain: f64,
        /// How many.
        pixels: usize,
        /// Their median offset above the other pixels, DN.
        offset_dn: f64,
        /// By how much pixels differ in the dark stack, with and without them, DN; `None` without stacks.
        dark_dn: Option<[Measured; 2]>,
    } => "{}", bright_pixels(linear_gain, *pixels, *offset_dn, dark_dn.as_ref());

    /// Dark frames are brighter in places: light leaks in, or the sensor glows.
    LightLeak at point ("light-leak", severity difference_dn.abs()) {
        /// Largest difference of the means of two blocks, DN.
        difference_dn: f64,
    } => "{point}: parts of the dark frames differ by {difference_dn:.2} DN; light leaks in, or the sensor glows";

    /// The mean of dark frames is not straight over exposure time: light leaks in evenly, or the offset drifts.
    DarkNotLinear("dark-not-linear", severity off_dn.abs()) {
        /// Linear gain.
        linear_gain: f64,
        /// Exposure time of the point that is furthest off, ms.
        exposure_ms: f64,
        /// Its distance from the line, DN.
        off_dn: f64,
        /// Reduced chi-square of the line.
        reduced_chi2: f64,
    } => "at gain {linear_gain} the dark frames of {exposure_ms} ms are {off_dn:+.3} DN off the line over exposure time (reduced chi^2 {reduced_chi2:.1}); light leaks in, or the offset drifts";

    /// Dark current from the mean differs from that from the noise: something else also grows with exposure time.
    DarkCurrentDisagrees("dark-current-disagrees") {
        /// Dark current from the mean, e-/s.
        mean_e_per_s: f64,
        /// The same minus dark current from the variance, e-/s.
        difference_e_per_s: f64,
        /// Standard error of the difference, e-/s.
        standard_error_e_per_s: f64,
    } => "the dark current of the mean, {mean_e_per_s:.4} e-/s, is {difference_e_per_s:+.4} +- {standard_error_e_per_s:.2} e-/s off that of the noise; light leaks in, or the offset drifts";

    /// Hot pixels raise the mean dark current.
    HotPixels("hot-pixels") {
        /// Share of the pixels that are hot.
        share: f64,
        /// Their mean dark current above that of the others, e-/s.
        excess_e_per_s: f64,
        /// Dark current of the others, e-/s.
        ordinary_e_per_s: f64,
        /// Mean dark current of all pixels, e-/s.
        mean_e_per_s: f64,
    } => "{:.3} % of the pixels are hot, by {excess_e_per_s:.1} e-/s on average; the others have {ordinary_e_per_s:.3} e-/s, the mean of all is {mean_e_per_s:.3} e-/s", 100.0 * share;

    /// The flat field is uneven, which raises PRNU without a high-pass.
    NotUniform at point ("not-uniform", severity *percent) {
        /// Largest difference of two blocks' means, percent of the signal.
        percent: f64,
    } => "{point}: parts of the flat field differ by {percent:.1} %";

    /// Pixels of one colour differ by their place in a tile, and there is no stack in which the test of the PRNU says so.
    OtherMosaic("other-mosaic", severity *percent) {
        /// Linear gain.
        linear_gain: f64,
        /// Largest difference of two places, percent of the signal.
        percent: f64,
    } => "at gain {linear_gain} pixels of one colour differ by {percent:.0} % of the signal by their place in a tile of 4x4 pixels, as if they have colour filters of another mosaic; if so, state it in `cfa`";

    /// A flat point has no usable dark frames of its gain and exposure time, and is not used.
    NoDark at point ("no-dark") {} =>
        "{point}: no usable dark frames of this gain and exposure time; the point does not count";

    /// Flat frames are no brighter than the dark ones.
    NoSignal at point ("no-signal", severity -signal_dn) {
        /// Their mean minus that of the dark ones, DN.
        signal_dn: f64,
        /// Its standard error, DN.
        standard_error_dn: f64,
    } => "{point}: no brighter than the dark frames ({signal_dn:+.3} +- {standard_error_dn:.3} DN); the point does not count";

    /// A fit has few points.
    TooFewPoints("too-few-points") {
        /// Linear gain.
        linear_gain: f64,
        /// Number of flat points.
        points: usize,
    } => "at gain {linear_gain} there {}; 50 are usual, 3 the least for a straight line{}", flat_points(*points), one_exposure(*points);

    /// More light gives a smaller signal.
    NotMonotonic at point ("not-monotonic") {} => "{point}: darker than a point with less light";

    /// The system gain is not in proportion to the linear gain.
    GainNotProportional("gain-not-proportional", severity (gain_dn_per_e / expected_dn_per_e - 1.0).abs()) {
        /// Linear gain.
        linear_gain: f64,
        /// `K_g / g`, DN/e-.
        gain_dn_per_e: f64,
        /// The median of all gains, DN/e-.
        expected_dn_per_e: f64,
    } => "at linear gain {linear_gain} the system gain is {gain_dn_per_e:.5} DN/e- per unit of linear gain, the median of all gains is {expected_dn_per_e:.5}";

    /// Dark noise is so small that rounding dominates the error of its variance.
    Rounding("rounding") {
        /// Linear gain.
        linear_gain: f64,
        /// Dark noise, DN.
        noise_dn: f64,
        /// Standard error of its variance by rounding, DN^2.
        error_dn2: f64,
    } => "at gain {linear_gain} dark noise is {noise_dn:.2} DN: rounding to whole digital numbers dominates the error of its variance, {error_dn2:.4} DN^2, which counts in the errors of K, dark current, read noise, electronics noise, noise of rows and columns, DSNU and PRNU";

    /// Dark noise is below the least that EMVA 1288 accepts as resolved by a converter.
    DarkNoiseLimit("dark-noise-limit") {
        /// Linear gain.
        linear_gain: f64,
    } => "at gain {linear_gain} dark noise is below 0.49 DN, the least that EMVA 1288 accepts as resolved by a converter: sigma_d, u_e_min and u_p_min are upper limits, DR is a lower one";

    /// The response is far from straight within its range.
    NotLinear("not-linear", severity percent.abs()) {
        /// Linear gain.
        linear_gain: f64,
        /// Colour.
        colour: Colour,
        /// Deviation from the line, percent.
        percent: f64,
        /// Mean of the point that has it, DN.
        mean_dn: f64,
    } => "at gain {linear_gain} the {} point of {mean_dn:.0} DN is {percent:+.1} % off the straight line: are photons and exposure times of the list right?", colour.name();

    /// The full well that the list states differs from the measured one.
    FullWellDiffers("full-well-differs") {
        /// As stated, e-.
        stated_e: f64,
        /// As measured, e-.
        measured_e: f64,
        /// Its standard error, e-.
        standard_error_e: f64,
    } => "the list states a full well of {stated_e} e-, and the signal ends at {measured_e:.0} +- {standard_error_e:.0} e-; sensor.toml holds what is stated";

    /// The black level that the list states is not that of the dark frames.
    BlackLevelDiffers("black-level-differs", severity (measured_dn - stated_dn).abs()) {
        /// Linear gain.
        linear_gain: f64,
        /// As stated, DN.
        stated_dn: f64,
        /// Level of the dark frames without dark current, DN.
        measured_dn: f64,
    } => "at gain {linear_gain} the list states a black level of {stated_dn} DN, and dark frames lie at {measured_dn:.2} DN: is `black_level_dn` right? sensor.toml holds what is stated, and the difference as electronics_mean_dn";

    /// The dark histogram has a tail of bright pixels that the model lacks: DSNU or hot pixels.
    DarkTail at point ("dark-tail", severity share * mean_dn) {
        /// Share of the pixels beyond what the model explains.
        share: f64,
        /// Their mean signal above the dark mean, DN.
        mean_dn: f64,
    } => "{point}: {:.3} % of the pixels are brighter than the model of the noise explains, by {mean_dn:.1} DN on average: hot pixels or dark signal non-uniformity, which the fit leaves out", 100.0 * share;

    /// Dark histograms are wider than temporal noise: DSNU.
    WiderThanNoise("wider-than-noise") {
        /// Standard deviation of the fitted dark histogram at the gain where the difference shows most, DN.
        fitted_dn: f64,
        /// Standard deviation of temporal noise, DN.
        temporal_dn: f64,
    } => "dark histograms spread by {fitted_dn:.4} DN, temporal noise by {temporal_dn:.4}; pixels differ by DSNU";

    /// The fit to the histograms did not converge.
    HistogramFitStopped("histogram-fit-stopped") {
        /// Steps it took.
        steps: usize,
    } => "the fit to the histograms had not converged after {steps} steps; its numbers have no standard errors";

    /// The histograms do not determine all parameters of the fit.
    HistogramFitAmbiguous("histogram-fit-ambiguous") {} =>
        "the histograms do not determine all parameters of the fit; its numbers have no standard errors";

    /// The fitted model does not describe the histograms.
    PoorHistogramFit("poor-histogram-fit") {
        /// Mean reduced chi-square of the cores.
        mean_chi2: f64,
        /// The largest.
        worst_chi2: f64,
        /// The point that has it.
        point: String,
    } => "the fitted model does not describe the histograms: reduced chi^2 is {mean_chi2:.2} on average and {worst_chi2:.2} at {point}; its numbers have no standard errors";

    /// The fit to the histograms differs from the joint fit.
    HistogramFitDiffers("histogram-fit-differs", severity ((fitted - joint) / standard_error).abs()) {
        /// The parameter.
        parameter: &'static str,
        /// By the histograms.
        fitted: f64,
        /// By the joint fit.
        joint: f64,
        /// Standard error of the difference.
        standard_error: f64,
    } => "the histograms give {parameter} = {fitted:.5}, the joint fit {joint:.5}; chance explains {standard_error:.5}";

    /// The histograms could not be fitted, because the joint fit lacks a number.
    NoHistogramFit("no-histogram-fit") {
        /// The number.
        lacks: &'static str,
    } => "the histograms are not fitted: {lacks} is not resolved; it takes three gains or more";

    /// Every sample is a multiple of a number: the frames are left-aligned, or were multiplied after the converter.
    CommonFactor("common-factor") {
        /// The number.
        factor: u32,
        /// Largest digital number of the stated bits.
        max_dn: u32,
    } => "{}", common_factor(*factor, *max_dn);

    /// No sample comes near the largest digital number of the stated bits, or samples pile up below it.
    TopNotReached("top-not-reached") {
        /// Largest sample, DN.
        largest_dn: u32,
        /// Largest digital number of the stated bits.
        max_dn: u32,
        /// Whether samples pile up at the largest.
        piled: bool,
    } => "{}", top_not_reached(*largest_dn, *max_dn, *piled);

    /// More electrons than photons.
    QuantumEfficiencyAboveOne("quantum-efficiency-above-one", severity *percent) {
        /// Linear gain.
        linear_gain: f64,
        /// Colour.
        colour: Colour,
        /// Quantum efficiency, percent.
        percent: f64,
        /// Its standard error, percent.
        standard_error: f64,
    } => "at gain {linear_gain}, {}, the quantum efficiency is {percent:.1} +- {standard_error:.1} %, more electrons than photons; are `photons` those of one pixel and one exposure?", colour_name(*colour);

    /// The system gain is not resolved: there is no sensor to write.
    NoSensorFile("no-sensor-file") {
        /// Why it is not.
        why: Unresolved,
    } => "K is not resolved ({why}), so there is no sensor to write; sensor.toml is left out";

    /// More than one stack of a kind: only the first is evaluated.
    MoreStacks at point ("more-stacks") {} => "{point}: another stack of this gain is evaluated already";

    /// The points of a fit do not lie on its model.
    FitDeparts("fit-departs", severity model_share.unwrap_or(f64::INFINITY)) {
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
    } => "{}", fit_departs(fit, place, test, *model_share, *cause);

    /// Stacks of one gain without a partner of the other kind and the same exposure time.
    LoneStack at point ("lone-stack") {} =>
        "{point}: no stack of the other kind with this gain and exposure time; it is not evaluated";

    /// Neighbouring pixels, or frames that follow each other, share temporal noise, as after a filter in the camera.
    SharedNoise("shared-noise", severity found.missing_share().abs()) {
        /// Linear gain.
        linear_gain: f64,
        /// Colour.
        colour: Colour,
        /// The correlations.
        found: SharedNoise,
    } => "at gain {linear_gain}, {}, {}", colour_name(*colour), shared_noise(found);

    /// Dark samples are cut off from below, which biases mean and noise; the point is not used.
    Clamped at point ("clamped", severity *share) {
        /// Digital number at which they are.
        level_dn: u32,
        /// Share of the samples there.
        share: f64,
    } => "{point}: {:.2} % of the samples pile up at {level_dn} DN, the least that occurs: the noise below it is cut off, and the point does not count; raise the black level, or switch the clamp off", 100.0 * share;

    /// The steps between digital numbers grow with the level: they were compressed in the camera.
    Compressed("compressed", severity found.high_step_dn) {
        /// Linear gain.
        linear_gain: f64,
        /// Colour.
        colour: Colour,
        /// The steps.
        found: Compression,
        /// Error that they add to K, percent; `None` where K is not resolved.
        percent: Option<f64>,
    } => "at gain {linear_gain}, {}, numbers are missing between those that occur, in steps from {:.1} to {:.1} DN that grow with the level, as after a lossy compression{}{}; capture uncompressed raw frames", colour_name(*colour), found.low_step_dn, found.high_step_dn, error_of_steps(*percent), in_the_dark(found.dark_step_dn);

    /// Rows of flat frames share noise that dark frames lack: the light flickers while a rolling shutter reads.
    RowFlicker("row-flicker", severity *percent) {
        /// Linear gain.
        linear_gain: f64,
        /// Colour.
        colour: Colour,
        /// Flat points that have it.
        points: usize,
        /// Largest share of it in the variance above dark, percent.
        percent: f64,
    } => "at gain {linear_gain}, {}, rows of {points} flat points share noise that dark frames lack, up to {percent:.1} % of the noise of light, as if the light flickers while a rolling shutter reads; K leaves it out", colour_name(*colour);
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A spread in words.
fn by(spread: &Measured) -> String {
    match spread.value() {
        Some(dn) => format!("by {dn:.3} DN"),
        None => "by less than is resolved".to_owned(),
    }
}

fn bright_pixels(
    linear_gain: &f64,
    pixels: usize,
    offset_dn: f64,
    dark_dn: Option<&[Measured; 2]>,
) -> String {
    let (noun, verb, pronoun) = if pixels == 1 { ("pixel", "is", "it") } else { ("pixels", "are", "them") };
    let dsnu = dark_dn.map_or(String::new(), |[with, without]| {
        format!(
            ". DSNU contains {pronoun}: pixels differ in the dark {} with {pronoun} and {} without {pronoun}",
            by(with),
            by(without)
        )
    });
    format!(
        "at gain {linear_gain}, {pixels} {noun} {verb} brighter than the others in dark frames of every exposure time, by {offset_dn:.1} DN \
         (median): an offset, not dark current, so not hot{dsnu}"
    )
}

fn signal_bias(percent: Option<f64>, of_others: &[(&str, f64, &str)]) -> String {
    let Some(percent) = percent.filter(|p| p.abs() >= LEAST_BIAS_PERCENT) else { return String::new() };
    let figures =
        of_others.iter().map(|(name, value, unit)| format!("{name} {} {unit}", significant(*value)));
    let figures: Vec<String> = figures.collect();
    let of_others =
        if figures.is_empty() { String::new() } else { format!("; without them {}", figures.join(", ")) };
    let direction = if percent < 0.0 { "low" } else { "high" };
    format!(
        ". EMVA 1288 averages signals over all pixels: R, QE and u_e_sat are {:.2} % too {direction} by them{of_others}",
        percent.abs()
    )
}

/// Bias of a mean signal below which the warning leaves it out, percent.
const LEAST_BIAS_PERCENT: f64 = 0.005;

/// A number with five significant digits.
fn significant(value: f64) -> String {
    let digits = if value == 0.0 { 0 } else { 4 - value.abs().log10().floor() as i32 };
    format!("{value:.*}", digits.max(0) as usize)
}

fn defect_pixels(
    linear_gain: &f64,
    colour: Colour,
    pixels: usize,
    [row, column]: &[usize; 2],
    [dark_dn, flat_dn]: [&[Measured; 2]; 2],
) -> String {
    let spread =
        |[without, with]: &[Measured; 2]| format!("{} without them and {} with them", by(without), by(with));
    let of_colour = match colour {
        Colour::Clear => String::new(),
        filtered => format!("{} ", filtered.name()),
    };
    let (noun, verb) = if pixels == 1 { ("pixel", "does") } else { ("pixels", "do") };
    format!(
        "at gain {linear_gain}, {pixels} {of_colour}{noun} {verb} not answer light, the first in row {row}, column {column}; \
         results.json lists them. DSNU and PRNU leave them out: pixels differ in the dark {}, in the light {}",
        spread(dark_dn),
        spread(flat_dn)
    )
}

/// Largest less least.
fn range(values: &[f64]) -> f64 {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    high - low
}

fn in_list(levels_dn: &[f64]) -> String {
    levels_dn.iter().map(|dn| format!("{dn:.2}")).collect::<Vec<_>>().join(", ")
}

fn common_factor(factor: u32, max_dn: u32) -> String {
    let found = format!("every sample is a multiple of {factor}");
    if !factor.is_power_of_two() {
        return format!(
            "{found}: they were multiplied after the converter, and K, means and noise with them"
        );
    }
    let (bits, most, shift) = (bits_of(max_dn / factor), bits_of(max_dn), factor.trailing_zeros());
    format!(
        "{found}: are the frames left-aligned, {bits} bits in {most}? Shift them down by {shift} bits and set `bits`; K, means and noise \
         are {factor} times too large"
    )
}

fn top_not_reached(largest_dn: u32, max_dn: u32, piled: bool) -> String {
    let (bits, most) = (bits_of(largest_dn), bits_of(max_dn));
    let piles = if piled { ", where samples pile up" } else { "" };
    let consequence = if bits < most {
        format!("{bits} bits hold all samples")
    } else {
        "what is clipped there does not count".to_owned()
    };
    format!(
        "no sample is above {largest_dn} of {max_dn}{piles}: is `bits` = {most} right, and the light not too weak? {consequence}"
    )
}

fn fit_departs(
    fit: &str,
    place: &str,
    test: &FitTest,
    model_share: Option<f64>,
    cause: Option<&str>,
) -> String {
    let at = if place.is_empty() { String::new() } else { format!("{place}: ") };
    let bend =
        test.curvature_sigmas.map_or(String::new(), |s| format!(", curvature {s:+.1} standard errors"));
    let cause = cause.map_or(String::new(), |cause| format!(", {cause}"));
    let consequence = match (test.verdict, model_share) {
        (Verdict::Withdrawn, _) => "its numbers are withdrawn".to_owned(),
        (_, Some(share)) => format!("the errors contain {:.1} % for it", 100.0 * share),
        (_, None) => "the errors contain it".to_owned(),
    };
    format!(
        "{at}the points of the fit of {fit} depart from its model (reduced chi^2 {:.2} at {} degrees of freedom{bend}{cause}); {consequence}",
        test.reduced_chi2, test.degrees_of_freedom
    )
}

fn shared_noise(found: &SharedNoise) -> String {
    let mut shared = Vec::new();
    if found.is_spatial() {
        let ways = [
            (found.along_rows, "along rows"),
            (found.along_columns, "along columns"),
            (found.diagonal, "on diagonals"),
        ];
        let known = ways.iter().filter(|(correlation, _)| *correlation != 0.0);
        let known: Vec<String> = known.map(|(correlation, way)| format!("{correlation:+.2} {way}")).collect();
        shared.push(format!("neighbouring pixels share noise (correlation {})", known.join(", ")));
    }
    if found.between_frames != 0.0 {
        shared.push(format!(
            "frames share noise with the frame before (correlation {:+.2})",
            found.between_frames
        ));
    }
    let percent = 100.0 * found.missing_share() / (1.0 + found.missing_share());
    let low_or_high = if percent < 0.0 { "high" } else { "low" };
    let far_off = if found.is_beyond_measure() {
        "at least 10 times too high".to_owned()
    } else {
        format!("about {:.0} % too {low_or_high}", percent.abs())
    };
    let consequence = if found.is_far() {
        "K and what follows from it are withdrawn, and so are DSNU and PRNU where pixels share noise"
    } else {
        "the errors of K and of what follows from it contain it"
    };
    format!(
        "{}, as after a filter, a correction of defects or image lag in the camera: the variance is {far_off}; {consequence}. \
         Capture raw frames without it",
        shared.join(", and ")
    )
}

fn error_of_steps(percent: Option<f64>) -> String {
    percent.map_or(String::new(), |percent| {
        format!(": their rounding is in the noise, and the error of K contains {percent:.1} % for it")
    })
}

fn flat_points(points: usize) -> String {
    if points == 1 { "is 1 flat point".to_owned() } else { format!("are {points} flat points") }
}

/// What the errors of one flat point lack.
fn one_exposure(points: usize) -> &'static str {
    if points == 1 {
        ". One exposure does not show whether the response bends: the errors of K, R and QE are those of noise alone"
    } else {
        ""
    }
}

/// Step in the dark from which on its rounding is worth a word, DN.
const COARSE_STEP_DN: f64 = 1.05;

fn in_the_dark(step_dn: f64) -> String {
    if step_dn < COARSE_STEP_DN {
        return String::new();
    }
    format!(
        ". In the dark the steps are {step_dn:.1} DN, and the errors of K, dark current, read noise, noise of rows and columns and DSNU contain their \
         rounding"
    )
}

/// Bits that hold a digital number.
fn bits_of(dn: u32) -> u32 {
    u32::BITS - dn.leading_zeros()
}
