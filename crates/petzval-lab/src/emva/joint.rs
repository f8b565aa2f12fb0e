//! All gains together: read noise, electronics noise, dark current, and the ratios of the colours.
//!
//! Electronics noise does not grow with the gain, read noise does. So the intercepts of the dark series over the gains
//! separate them:
//!
//! ```text
//! I_g = sigma_r^2 K_g^2 + (sigma_el^2 + 1/12)        intercept of the dark variance [DN^2]
//! M_g = mu_r K_g + (BL_g + mu_el)                    intercept of the dark mean     [DN]
//! ```
//!
//! The temporal noise of rows and columns is a part of the read noise and grows with the gain as it does: its variance over `K_g^2` is
//! averaged over the gains. Each of the two is a line with weights `1/s^2`, where `s` includes the errors of the intercept, of `K_g` and of
//! rounding. (Rounding adds 1/12 only to noise that spreads over several digital numbers, see [`super::rounding`]. For numbers `s` apart it adds
//! `s^2/12`, and what that is above 1/12 is subtracted from I_g first.) Averages over single
//! gains (Tseng et al. 2021, supplement 2.3.2) cannot separate them. Captures show only the sum of BL and mu_el: BL is taken from the
//! setting of the camera. Where black levels are stated gain by gain, their differences to that of the lowest gain are subtracted first.
//!
//! Some gains follow another model: their black levels differ and are not stated, or they have a second conversion gain. Their points do not lie on these
//! lines. The errors contain this scatter; if the points are far off, the figures of the line are withdrawn. An error that all gains share,
//! as that of K by a response that bends, does not become smaller with their number.

use schemars::JsonSchema;
use serde::Serialize;

use super::dark::DarkSeries;
use super::fit::{Line, TestedLine, TestedMean, tested_line, tested_mean, weighted_mean};
use super::goodness::{FitTest, Model, Points, Verdict, test};
use super::hot_pixels::PixelDarkCurrents;
use super::line_noise::LineNoise;
use super::measured::{Measured, Unresolved};
use super::rounding::{QUANTISATION_DN2, RoundingError, coarse_rounding_dn2, rounding_dn2};
use super::transfer_point::TransferPoint;
use petzval_camera::sensor::Colour;

/// Contribution of one linear gain.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct GainRow {
    /// Linear gain g.
    pub linear_gain: f64,
    /// K_g, DN/e-: the weighted mean of the colours.
    pub gain_dn_per_e: Measured,
    /// The part of its error that is no noise: the response bends, or the variance departs from its line, DN/e-.
    pub gain_model_error_dn_per_e: f64,
    /// `K_g / g`, DN/e-.
    pub gain_at_unit_dn_per_e: Measured,
    /// Dark current from the mean, e-/s.
    pub dark_current_mean_e_per_s: Measured,
    /// Dark current from the variance, e-/s.
    pub dark_current_variance_e_per_s: Measured,
    /// Intercept of the dark variance, DN^2; its error includes rounding.
    pub dark_variance_dn2: Measured,
    /// Intercept of the dark mean, DN; its error includes rounding.
    pub dark_mean_dn: Measured,
    /// Black level of this gain above that of the lowest gain, DN, as stated; 0 where it is not.
    pub black_shift_dn: f64,
    /// Error of the dark variance by rounding alone, DN^2.
    pub rounding_error_dn2: f64,
    /// `(I_g - 1/12) / K_g^2`, e-^2: read noise if there were no electronics noise. For numbers `s` apart, `s^2/12` takes the place of 1/12.
    pub naive_read_variance_e2: Measured,
    /// Distance of the digital numbers in the dark, DN.
    #[serde(skip)]
    pub step_dn: f64,
    /// Dark current from the mean less that from the variance, with the errors of noise alone, e-/s.
    #[serde(skip)]
    pub dark_current_difference_e_per_s: Measured,
}

impl GainRow {
    /// Error of K_g by noise alone, DN/e-.
    fn gain_noise_error(&self) -> Option<f64> {
        by_noise(self.gain_dn_per_e, self.gain_model_error_dn_per_e).standard_error()
    }

    /// K_g with that error: what all gains share is added to their mean.
    fn gain_by_noise(&self) -> Measured {
        by_noise(self.gain_dn_per_e, self.gain_model_error_dn_per_e)
    }
}

/// A gain with the error of noise alone, without the part `of_model` of its error, DN/e-.
fn by_noise(gain: Measured, of_model: f64) -> Measured {
    match (gain.value(), gain.standard_error()) {
        (Some(value), Some(se)) => Measured::new(value, (se * se - of_model * of_model).max(0.0).sqrt()),
        _ => gain,
    }
}

/// Whether the gains agree with the model of all of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct JointTests {
    /// `K_g / g` is the same at all gains.
    pub gain: FitTest,
    /// The dark current from the mean is the same.
    pub dark_current: FitTest,
    /// The dark variances lie on their line over `K_g^2`.
    pub variance_line: FitTest,
    /// The dark means lie on theirs over `K_g`.
    pub mean_line: FitTest,
}

/// The joint fit.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct JointFit {
    /// The gains.
    pub rows: Vec<GainRow>,
    /// Whether they agree with this model.
    pub tests: JointTests,
    /// K at linear gain 1, DN/e-.
    pub gain_dn_per_e: Measured,
    /// mu_I from the mean of dark frames, e-/s.
    pub dark_current_e_per_s: Measured,
    /// mu_I from their variance, e-/s.
    pub dark_current_variance_e_per_s: Measured,
    /// Mean over the gains of the first minus the second, e-/s: zero within its error unless light leaks in or the offset drifts.
    pub dark_current_difference_e_per_s: Measured,
    /// Median of the pixels' dark currents, e-/s: EMVA's mu_I is the mean, which hot pixels raise.
    pub dark_current_median_e_per_s: Measured,
    /// Mean dark current of the pixels that are not hot, e-/s.
    pub dark_current_ordinary_e_per_s: Measured,
    /// Share of the pixels that are hot.
    pub hot_pixel_share: Measured,
    /// Mean dark current of hot pixels above that of the others, e-/s.
    pub hot_pixel_e_per_s: Measured,
    /// Line of dark variance over `K_g^2`: slope e-^2, intercept DN^2.
    pub variance_line: Line,
    /// Line of dark mean over `K_g`: slope e-, intercept DN.
    pub mean_line: Line,
    /// sigma_r^2, e-^2.
    pub read_variance_e2: Measured,
    /// sigma_r, e-.
    pub read_noise_e: Measured,
    /// Temporal noise that the pixels of a row have in common, e-; a part of sigma_r.
    pub row_noise_e: Measured,
    /// Temporal noise that the pixels of a column have in common, e-; a part of sigma_r.
    pub column_noise_e: Measured,
    /// mu_r, e-.
    pub read_noise_mean_e: Measured,
    /// sigma_el, DN.
    pub electronics_noise_dn: Measured,
    /// BL + mu_el, DN; of the lowest gain, where the gains have different BL.
    pub dark_offset_dn: Measured,
    /// BL as the camera is set, DN; of the lowest gain.
    pub black_level_dn: Option<f64>,
    /// mu_el, DN, if BL is known.
    pub electronics_mean_dn: Measured,
    /// Signal of red over that of green in the light of the captures, alpha.
    pub red_over_green: Measured,
    /// Signal of blue over that of green, beta.
    pub blue_over_green: Measured,
}

/// Input of one gain to the joint fit.
pub struct GainInput<'a> {
    /// Linear gain.
    pub linear_gain: f64,
    /// Black level of this gain above that of the lowest gain, DN, as stated; 0 where it is not.
    pub black_shift_dn: f64,
    /// K_g of each colour, and the part of its error that is no noise, DN/e-.
    pub gains: Vec<(Measured, f64)>,
    /// Dark series over the pixels that answer light or exposure time.
    pub dark: &'a DarkSeries,
    /// Temporal noise of rows and columns in its dark frames.
    pub line_noise: LineNoise,
    /// Dark currents of the pixels, or why they are not known.
    pub pixels: Result<&'a PixelDarkCurrents, Unresolved>,
    /// Points of each colour within its photon transfer: none of them is clipped or near saturation.
    pub points: Vec<(Colour, &'a [TransferPoint])>,
}

/// Least number of gains for a line over the gains: two points fit any line.
pub const GAINS: usize = 3;

/// Fits all gains together.
pub fn joint_fit(inputs: &[GainInput<'_>], black_level_dn: Option<f64>) -> JointFit {
    let rows: Vec<GainRow> = inputs.iter().map(row).collect();
    let at_unit = |r: &GainRow| (r.gain_at_unit_dn_per_e, r.gain_model_error_dn_per_e / r.linear_gain);
    let (gain, _) = mean_of_gains(rows.iter().map(at_unit));
    let gain_dn_per_e = gain.mean;
    let common = common_error(&rows);
    let from_mean = tested_mean(rows.iter().map(|r| r.dark_current_mean_e_per_s));
    let (dark_current_test, from_mean) = (from_mean.test, with_share(from_mean.mean, common));
    let of_variances = weighted_mean(rows.iter().map(|r| r.dark_current_variance_e_per_s));
    let from_variance = with_share(of_variances, 2.0 * common);
    // A departure of the mean from its line is what this difference is to show: judge it by noise.
    let difference = weighted_mean(rows.iter().map(|r| r.dark_current_difference_e_per_s));
    let dark_current_difference_e_per_s = difference.with_error(common * from_mean.value().unwrap_or(0.0));

    let pixels = pixel_dark_currents_e(inputs, &rows, common);

    let far_variance = |off: &[(f64, f64)]| off.iter().any(|(off, y)| off.abs() > FAR_OFF_SHARE * y.abs());
    let far_mean = |off: &[(f64, f64)]| {
        let (low, high) =
            off.iter().fold((0.0, 0.0), |(low, high), (off, _)| (f64::min(low, *off), f64::max(high, *off)));
        high - low > FAR_OFF_DN
    };
    let variance = line_over_gains(&rows, 2, of_whole_numbers, &far_variance);
    let over_black = |r: &GainRow| r.dark_mean_dn.minus(Measured::exact(r.black_shift_dn));
    let mean = line_over_gains(&rows, 1, over_black, &far_mean);
    let with_common = |fitted: TestedLine, power: f64| Line {
        slope: with_share(fitted.line.slope, power * common),
        ..fitted.line
    };
    let (variance_line, mean_line) = (with_common(variance, 2.0), with_common(mean, 1.0));
    let tests = JointTests {
        gain: gain.test,
        dark_current: dark_current_test,
        variance_line: variance.test,
        mean_line: mean.test,
    };
    let read_variance_e2 = variance_line.slope.if_above_noise();
    let electronics = variance_line.intercept.map(|v| v - QUANTISATION_DN2, |_| 1.0).if_above_noise();
    let of_lines = |of: fn(&LineNoise) -> Measured| {
        let of_gain = |(input, row): (&GainInput<'_>, &GainRow)| {
            of(&input.line_noise).over(row.gain_dn_per_e.squared())
        };
        with_share(weighted_mean(inputs.iter().zip(&rows).map(of_gain)), 2.0 * common).if_above_noise().root()
    };
    let dark_offset_dn = mean_line.intercept;
    let electronics_mean_dn = match black_level_dn {
        Some(black) => dark_offset_dn.map(|v| v - black, |_| 1.0),
        None => Measured::none(Unresolved::NotStated("black_level_dn")),
    };
    JointFit {
        tests,
        gain_dn_per_e,
        dark_current_e_per_s: from_mean.if_above_noise(),
        dark_current_variance_e_per_s: from_variance.if_above_noise(),
        dark_current_difference_e_per_s,
        dark_current_median_e_per_s: pixels.median.if_above_noise(),
        dark_current_ordinary_e_per_s: pixels.ordinary.if_above_noise(),
        hot_pixel_share: pixels.hot_share,
        hot_pixel_e_per_s: pixels.hot_excess,
        variance_line,
        mean_line,
        read_variance_e2,
        read_noise_e: read_variance_e2.root(),
        row_noise_e: of_lines(|n| n.row_dn2),
        column_noise_e: of_lines(|n| n.column_dn2),
        read_noise_mean_e: mean_line.slope,
        electronics_noise_dn: electronics.root(),
        dark_offset_dn,
        black_level_dn,
        electronics_mean_dn,
        red_over_green: ratio(inputs, Colour::Red),
        blue_over_green: ratio(inputs, Colour::Blue),
        rows,
    }
}

/// Dark currents of the pixels in electrons.
struct PixelDarkCurrentsE {
    median: Measured,
    ordinary: Measured,
    hot_share: Measured,
    hot_excess: Measured,
}

/// Converts the dark currents of the pixels to electrons. Noise differs from gain to gain, so median and mean of the ordinary
/// pixels are weighted means; `common` is the share of K that is off at all gains alike. All gains see the same hot pixels: use the most precise gain,
/// do not average.
fn pixel_dark_currents_e(inputs: &[GainInput<'_>], rows: &[GainRow], common: f64) -> PixelDarkCurrentsE {
    let known: Vec<(&PixelDarkCurrents, &GainRow)> =
        inputs.iter().zip(rows).filter_map(|(i, r)| Some((i.pixels.ok()?, r))).collect();
    let Some(first) = known.first() else {
        let why = inputs.iter().find_map(|i| i.pixels.err()).unwrap_or(Unresolved::NoStack);
        let none = Measured::none(why);
        return PixelDarkCurrentsE { median: none, ordinary: none, hot_share: none, hot_excess: none };
    };
    let error = |p: &PixelDarkCurrents| p.hot_relative_error().unwrap_or(f64::INFINITY);
    let (hot, row) =
        known.iter().fold(first, |best, one| if error(one.0) < error(best.0) { one } else { best });
    let mean = |f: fn(&PixelDarkCurrents) -> Measured| {
        let of_gains = weighted_mean(known.iter().map(|(p, row)| f(p).over(row.gain_by_noise())));
        with_share(of_gains, common)
    };
    PixelDarkCurrentsE {
        median: mean(|p| p.median_dn_per_s),
        ordinary: mean(|p| p.ordinary_dn_per_s),
        hot_share: hot.hot_share,
        hot_excess: hot.hot_excess_dn_per_s.over(row.gain_dn_per_e),
    }
}

/// Mean over gains. The second number of each is the part of its error that is systematic and shared by all gains, so that averaging does
/// not reduce it. The systematic part of the mean is returned beside the mean.
fn mean_of_gains(gains: impl IntoIterator<Item = (Measured, f64)>) -> (TestedMean, f64) {
    let all: Vec<(Measured, f64)> = gains.into_iter().collect();
    let noise = |(gain, of_model): &(Measured, f64)| {
        let gain = by_noise(*gain, *of_model);
        (gain.value(), gain.standard_error())
    };
    // Weigh by all of the error, so that a gain that departs from its model counts less.
    let (mut weight, mut of_noise, mut of_model) = (0.0, 0.0, 0.0);
    for one in &all {
        let (Some(_), Some(noise)) = noise(one) else { continue };
        let own = 1.0 / (noise * noise + one.1 * one.1);
        if own.is_finite() {
            weight += own;
            of_noise += (own * noise).powi(2);
            of_model += own * one.1;
        }
    }
    let mut found = tested_mean(all.iter().map(|(gain, _)| *gain));
    let common = of_model / weight;
    if let (Some(value), true) = (found.mean.value(), common > 0.0) {
        let error = (of_noise.sqrt() / weight).hypot(found.test.model_error).hypot(common);
        found.mean = Measured::new(value, error);
    }
    (found, if common > 0.0 { common } else { 0.0 })
}

/// The error of K that all gains share, as a share of K: the mean of theirs.
fn common_error(rows: &[GainRow]) -> f64 {
    let shares: Vec<f64> =
        rows.iter().filter_map(|r| Some(r.gain_model_error_dn_per_e / r.gain_dn_per_e.value()?)).collect();
    shares.iter().sum::<f64>() / shares.len().max(1) as f64
}

/// A number with a further error, a share of it.
fn with_share(measured: Measured, share: f64) -> Measured {
    measured.with_error(share * measured.value().unwrap_or(0.0).abs())
}

fn row(input: &GainInput<'_>) -> GainRow {
    let (k, of_model) = mean_of_gains(input.gains.iter().copied());
    let k = if input.gains.is_empty() { Measured::none(Unresolved::NoFlat) } else { k.mean };
    // Errors that all gains share are added to their mean, not here.
    let k_by_noise = by_noise(k, of_model);
    let (mean, variance) = (&input.dark.mean, &input.dark.variance);
    let k_squared = k_by_noise.squared();
    let step_dn = input.dark.step_dn();
    let rounding_of = |noise: f64| RoundingError::of(noise, step_dn);
    let rounding = variance.intercept.value().map(rounding_of).unwrap_or_default();
    GainRow {
        linear_gain: input.linear_gain,
        gain_dn_per_e: k,
        gain_model_error_dn_per_e: of_model,
        gain_at_unit_dn_per_e: k.scale(1.0 / input.linear_gain),
        dark_current_mean_e_per_s: mean.slope.over(k_by_noise),
        dark_current_variance_e_per_s: variance.slope.over(k_squared),
        dark_current_difference_e_per_s: dark_current_difference(input.dark, k_by_noise),
        dark_variance_dn2: variance.intercept,
        dark_mean_dn: mean.intercept,
        black_shift_dn: input.black_shift_dn,
        rounding_error_dn2: rounding.variance_dn2,
        naive_read_variance_e2: variance
            .intercept
            .map(|v| v - rounding_dn2(step_dn), |_| 1.0)
            .over(k_squared),
        step_dn,
    }
}

/// The intercept of the dark variance as if digital numbers were whole ones, DN^2.
fn of_whole_numbers(row: &GainRow) -> Measured {
    row.dark_variance_dn2.map(|v| v - coarse_rounding_dn2(row.step_dn), |_| 1.0)
}

/// Dark current from the mean less that from the variance, `b / K - v / K^2`, e-/s. Both contain the error of K, which changes the difference by `(2 v / K - b) / K^2`.
fn dark_current_difference(dark: &DarkSeries, k: Measured) -> Measured {
    let (mean, variance) = (dark.mean_by_noise.slope, dark.variance.slope);
    let Some(gain) = k.value() else { return k };
    let difference = mean.scale(1.0 / gain).minus(variance.scale(1.0 / (gain * gain)));
    match (mean.value(), variance.value()) {
        (Some(b), Some(v)) => difference.with_error((2.0 * v / gain - b) / (gain * gain) * k.error_or_zero()),
        _ => difference,
    }
}

/// Chi-squared over its degrees of freedom from which on a line over the gains is withdrawn: points three standard errors off it.
const FAR_OFF_CHI2: f64 = 9.0;
/// Least range of the distances of the dark means from their line for that, DN: less is a drift of the offset.
const FAR_OFF_DN: f64 = 0.25;
/// Least distance of a dark variance from its line for that, as a share of it.
const FAR_OFF_SHARE: f64 = 0.1;

/// The distance of a point from a line, and the value of the point.
type Distance = (f64, f64);

/// Weighted line of `y` over `K_g^power`. The slope of a first fit converts the error of `K_g` to an error of `y`. Withdrawn if its points are
/// far off: `is_far` says so of their distances from the line and `y`. Where the response bends, K is off by another share at each gain: the errors
/// contain the line through gains that are off by what theirs differ from the mean share.
fn line_over_gains(
    rows: &[GainRow],
    power: i32,
    y: fn(&GainRow) -> Measured,
    is_far: &dyn Fn(&[Distance]) -> bool,
) -> TestedLine {
    let is_used = |r: &&GainRow| {
        r.gain_dn_per_e.value().is_some()
            && r.gain_noise_error().is_some()
            && y(r).value().is_some()
            && y(r).standard_error().is_some_and(|error| error > 0.0)
    };
    let usable: Vec<(f64, f64, f64, f64)> = rows
        .iter()
        .filter(is_used)
        .filter_map(|r| {
            let (k, k_se) = (r.gain_dn_per_e.value()?, r.gain_noise_error()?);
            let (v, v_se) = (y(r).value()?, y(r).standard_error()?);
            Some((k.powi(power), f64::from(power) * k.powi(power - 1) * k_se, v, v_se))
        })
        .collect();
    let of = |f: fn(&(f64, f64, f64, f64)) -> f64| usable.iter().map(f).collect::<Vec<f64>>();
    let (xs, ys) = (of(|u| u.0), of(|u| u.2));
    let mut errors = of(|u| u.3);
    let weights = |errors: &[f64]| errors.iter().map(|s| 1.0 / (s * s)).collect::<Vec<f64>>();
    let mut fitted = tested_line(&xs, &ys, &weights(&errors), &errors);
    if usable.len() < GAINS {
        let line = Line::none(Unresolved::TooFewGains { got: usable.len(), need: GAINS });
        fitted.test.verdict = Verdict::Untested;
        return TestedLine { line, by_noise: line, ..fitted };
    }
    for _ in 0..2 {
        let slope = fitted.by_noise.slope.value().unwrap_or(0.0);
        errors = usable.iter().map(|u| u.3.hypot(slope * u.1)).collect();
        fitted = tested_line(&xs, &ys, &weights(&errors), &errors);
    }
    let found = [fitted.by_noise.slope, fitted.by_noise.intercept].map(|m| m.value().unwrap_or(0.0));
    let off: Vec<Distance> = usable.iter().map(|u| (u.2 - found[0] * u.0 - found[1], u.2)).collect();
    let has_far = is_far(&off);
    let of_model: Vec<f64> = rows
        .iter()
        .filter(is_used)
        .filter_map(|r| Some(r.gain_model_error_dn_per_e / r.gain_dn_per_e.value()?))
        .collect();
    let common = of_model.iter().sum::<f64>() / of_model.len() as f64;
    let moved: Vec<f64> =
        xs.iter().zip(&of_model).map(|(x, share)| x * (1.0 + f64::from(power) * (share - common))).collect();
    let bent = tested_line(&moved, &ys, &weights(&errors), &errors).by_noise;
    let with_bend = |own: Measured, before: f64, bent: Measured| {
        own.with_error(bent.value().map_or(0.0, |bent| (bent - before).abs()))
    };
    fitted.line = Line {
        slope: with_bend(fitted.line.slope, found[0], bent.slope),
        intercept: with_bend(fitted.line.intercept, found[1], bent.intercept),
    };
    if fitted.test.verdict == Verdict::Widened && fitted.test.reduced_chi2 > FAR_OFF_CHI2 && has_far {
        let (reduced_chi2, degrees) = (fitted.test.reduced_chi2, fitted.test.degrees_of_freedom);
        fitted.line = Line::none(Unresolved::PoorFit { reduced_chi2, degrees });
        fitted.test.verdict = Verdict::Withdrawn;
    }
    fitted
}

/// Ratio of the signal of a colour to that of green, over the points within the photon transfer of both.
fn ratio(inputs: &[GainInput<'_>], colour: Colour) -> Measured {
    let (mut found, mut both) = (Vec::new(), false);
    for input in inputs {
        let points = |c: Colour| input.points.iter().find(|(k, _)| *k == c).map(|(_, p)| *p);
        let (Some(ours), Some(green)) = (points(colour), points(Colour::Green)) else { continue };
        both = true;
        if ours.is_empty() || green.is_empty() {
            continue;
        }
        found.push(ratio_of(ours, green));
    }
    match found.is_empty() {
        true if both => Measured::none(Unresolved::AllSaturated),
        true => Measured::none(Unresolved::NotStated("red, green and blue pixels")),
        false => weighted_mean(found),
    }
}

/// Slope through the origin of the signal of one colour over that of another, with the test of its points.
fn ratio_of(ours: &[TransferPoint], green: &[TransferPoint]) -> Measured {
    let pairs: Vec<(&TransferPoint, &TransferPoint)> = ours.iter().zip(green).collect();
    let x: Vec<f64> = pairs.iter().map(|(_, green)| green.signal_dn()).collect();
    let y: Vec<f64> = pairs.iter().map(|(own, _)| own.signal_dn()).collect();
    let xx: f64 = x.iter().map(|x| x * x).sum();
    let ratio = x.iter().zip(&y).map(|(x, y)| x * y).sum::<f64>() / xx;
    let error = |(own, green): &(&TransferPoint, &TransferPoint)| {
        own.signal_se_dn().hypot(ratio * green.signal_se_dn())
    };
    let own_se: Vec<f64> = pairs.iter().map(error).collect();
    let weights: Vec<f64> = x.iter().map(|x| x / xx).collect();
    let points = Points { x, y, own_se, shared: Vec::new() };
    let of_noise = points.error_of(&weights);
    let (_, departure) = test(&points, Model::ThroughOrigin, &[ratio]);
    Measured::new(ratio, of_noise).with_error(departure.error(0, of_noise))
}

#[cfg(test)]
mod tests {
    use super::super::dark::{DarkPoint, dark_series};
    use super::*;

    /// Dark frames of one variance, DN^2, in numbers `step_dn` apart.
    fn darks(variance_dn2: f64, step_dn: f64) -> DarkSeries {
        let point = |i: u32| DarkPoint {
            exposure_s: f64::from(i),
            mean_dn: 64.0,
            mean_se_dn: 0.01,
            variance_dn2,
            variance_se_dn2: 0.01,
            step_dn,
        };
        dark_series((0..6).map(point).collect())
    }

    fn input(linear_gain: f64, dark: &DarkSeries) -> GainInput<'_> {
        let none = Measured::none(Unresolved::NoStack);
        GainInput {
            linear_gain,
            black_shift_dn: 0.0,
            gains: vec![(Measured::new(linear_gain, 1e-4), 0.0)],
            dark,
            line_noise: LineNoise { row_dn2: none, column_dn2: none, pixel_dn2: none },
            pixels: Err(Unresolved::NoStack),
            points: Vec::new(),
        }
    }

    #[test]
    fn the_rounding_of_numbers_further_apart_is_subtracted() {
        // Gains of 1 to 8 DN/e-, a read noise of 5 e-, electronics noise of 6 DN, and steps of 1 to 4 DN.
        let all = [(1.0, 4.0), (2.0, 1.0), (4.0, 2.0), (8.0, 3.0)];
        let read_dn2 = |gain: f64| 25.0 * gain * gain;
        let series = all.map(|(gain, step)| darks(read_dn2(gain) + 36.0 + step * step / 12.0, step));
        let inputs: Vec<GainInput<'_>> =
            all.iter().zip(&series).map(|((gain, _), dark)| input(*gain, dark)).collect();
        let joint = joint_fit(&inputs, None);
        for (row, (gain, _)) in joint.rows.iter().zip(all) {
            let naive = row.naive_read_variance_e2.value().unwrap();
            assert!((naive - (25.0 + 36.0 / (gain * gain))).abs() < 1e-6, "{gain}: {naive}");
        }
        let [slope, intercept] = [joint.variance_line.slope, joint.variance_line.intercept];
        assert!((slope.value().unwrap() - 25.0).abs() < 1e-6, "{slope:?}");
        assert!((intercept.value().unwrap() - 36.0 - 1.0 / 12.0).abs() < 1e-6, "{intercept:?}");
    }

    #[test]
    fn rounding_rules_the_error_of_little_noise_in_wide_steps() {
        // Half a step of noise and its rounding.
        let dark = darks(4.8, 4.0);
        let found = row(&input(1.0, &dark));
        let se = found.dark_variance_dn2.standard_error().unwrap();
        assert!(
            found.rounding_error_dn2 > 0.05 && 2.0 * found.rounding_error_dn2.powi(2) > se * se,
            "{found:?}"
        );
    }
}
