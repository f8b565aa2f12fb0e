//! All gains together: read noise, electronics noise, dark current, and the ratios of the colours.
//!
//! Electronics noise does not grow with the gain, read noise does. So the intercepts of the dark series over the gains
//! separate them:
//!
//! ```text
//! I_g = sigma_r^2 K_g^2 + (sigma_el^2 + 1/12)        intercept of the dark variance [DN^2]
//! M_g = mu_r K_g + (BL + mu_el)                      intercept of the dark mean     [DN]
//! ```
//!
//! The temporal noise of rows and columns grows with the gain as the read noise does, of which it is a part: its variance over `K_g^2`
//! is averaged over the gains. Each of the two is a line with weights `1/s^2`, where `s` includes the errors of the intercept, of `K_g` and of rounding.
//! (Rounding adds 1/12 only to noise that spreads over several digital numbers, see [`super::rounding`].) Averages over
//! single gains (Tseng et al. 2021, supplement 2.3.2) cannot separate them. Captures show only the sum of BL and mu_el:
//! BL is taken from the setting of the camera.

use serde::Serialize;

use super::dark::DarkSeries;
use super::fit::{Line, line, through_origin, weighted_mean};
use super::hot_pixels::PixelDarkCurrents;
use super::line_noise::LineNoise;
use super::measured::{Measured, Unresolved};
use super::rounding::{QUANTISATION_DN2, RoundingError};
use super::transfer_point::TransferPoint;
use petzval_camera::sensor::Colour;

/// Contribution of one linear gain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GainRow {
    /// Linear gain g.
    pub linear_gain: f64,
    /// K_g, DN/e-: the weighted mean of the colours.
    pub gain_dn_per_e: Measured,
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
    /// Error of the dark variance by rounding alone, DN^2.
    pub rounding_error_dn2: f64,
    /// `(I_g - 1/12) / K_g^2`, e-^2: read noise if there were no electronics noise.
    pub naive_read_variance_e2: Measured,
}

/// The joint fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointFit {
    /// The gains.
    pub rows: Vec<GainRow>,
    /// K at linear gain 1, DN/e-.
    pub gain_dn_per_e: Measured,
    /// mu_I from the mean of dark frames, e-/s.
    pub dark_current_e_per_s: Measured,
    /// mu_I from their variance, e-/s.
    pub dark_current_variance_e_per_s: Measured,
    /// The first minus the second, e-/s: zero within its error unless light leaks in or the offset drifts.
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
    /// BL + mu_el, DN.
    pub dark_offset_dn: Measured,
    /// BL as the camera is set, DN.
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
    /// K_g of each colour, DN/e-.
    pub gains: Vec<Measured>,
    /// Dark series over all pixels.
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
    let gain_dn_per_e = weighted_mean(rows.iter().map(|r| r.gain_at_unit_dn_per_e));
    let dark_current = |f: fn(&GainRow) -> Measured| weighted_mean(rows.iter().map(f));
    let from_mean = dark_current(|r| r.dark_current_mean_e_per_s);
    let from_variance = dark_current(|r| r.dark_current_variance_e_per_s);
    let dark_current_difference_e_per_s = from_mean.minus(from_variance);

    let pixels = pixel_dark_currents_e(inputs, &rows);

    let (variance_line, mean_line) = (
        line_over_gains(&rows, |k| k * k, |k| 2.0 * k, |r| r.dark_variance_dn2),
        line_over_gains(&rows, |k| k, |_| 1.0, |r| r.dark_mean_dn),
    );
    let read_variance_e2 = variance_line.slope.if_above_noise();
    let electronics = variance_line.intercept.map(|v| v - QUANTISATION_DN2, |_| 1.0).if_above_noise();
    let of_lines = |of: fn(&LineNoise) -> Measured| {
        let of_gain = |(input, row): (&GainInput<'_>, &GainRow)| {
            of(&input.line_noise).over(row.gain_dn_per_e.squared())
        };
        weighted_mean(inputs.iter().zip(&rows).map(of_gain)).if_above_noise().root()
    };
    let dark_offset_dn = mean_line.intercept;
    let electronics_mean_dn = match black_level_dn {
        Some(black) => dark_offset_dn.map(|v| v - black, |_| 1.0),
        None => Measured::none(Unresolved::NotStated("black_level_dn")),
    };
    JointFit {
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
/// pixels are weighted means. All gains see the same hot pixels: use the most precise gain, do not average.
fn pixel_dark_currents_e(inputs: &[GainInput<'_>], rows: &[GainRow]) -> PixelDarkCurrentsE {
    let known: Vec<(&PixelDarkCurrents, Measured)> =
        inputs.iter().zip(rows).filter_map(|(i, r)| Some((i.pixels.ok()?, r.gain_dn_per_e))).collect();
    let Some(first) = known.first() else {
        let why = inputs.iter().find_map(|i| i.pixels.err()).unwrap_or(Unresolved::NoStack);
        let none = Measured::none(why);
        return PixelDarkCurrentsE { median: none, ordinary: none, hot_share: none, hot_excess: none };
    };
    let error = |p: &PixelDarkCurrents| p.hot_relative_error().unwrap_or(f64::INFINITY);
    let (hot, k) =
        known.iter().fold(first, |best, one| if error(one.0) < error(best.0) { one } else { best });
    let mean =
        |f: fn(&PixelDarkCurrents) -> Measured| weighted_mean(known.iter().map(|(p, k)| f(p).over(*k)));
    PixelDarkCurrentsE {
        median: mean(|p| p.median_dn_per_s),
        ordinary: mean(|p| p.ordinary_dn_per_s),
        hot_share: hot.hot_share,
        hot_excess: hot.hot_excess_dn_per_s.over(*k),
    }
}

fn row(input: &GainInput<'_>) -> GainRow {
    let k = weighted_mean(input.gains.iter().copied());
    let k = if input.gains.is_empty() { Measured::none(Unresolved::NoFlat) } else { k };
    let (mean, variance) = (&input.dark.mean, &input.dark.variance);
    let k_squared = k.squared();
    let rounding = variance.intercept.value().map(RoundingError::of).unwrap_or_default();
    GainRow {
        linear_gain: input.linear_gain,
        gain_dn_per_e: k,
        gain_at_unit_dn_per_e: k.scale(1.0 / input.linear_gain),
        dark_current_mean_e_per_s: mean.slope.over(k),
        dark_current_variance_e_per_s: variance.slope.over(k_squared),
        dark_variance_dn2: variance.intercept,
        dark_mean_dn: mean.intercept,
        rounding_error_dn2: rounding.variance_dn2,
        naive_read_variance_e2: variance.intercept.map(|v| v - QUANTISATION_DN2, |_| 1.0).over(k_squared),
    }
}

/// Weighted line of `y` over `x(K_g)`. The slope of a first fit converts the error of `K_g` to an error of `y`.
fn line_over_gains(
    rows: &[GainRow],
    x: fn(f64) -> f64,
    dx: fn(f64) -> f64,
    y: fn(&GainRow) -> Measured,
) -> Line {
    let usable: Vec<(f64, f64, f64, f64)> = rows
        .iter()
        .filter_map(|r| {
            let (k, k_se) = (r.gain_dn_per_e.value()?, r.gain_dn_per_e.standard_error()?);
            let (v, v_se) = (y(r).value()?, y(r).standard_error().filter(|s| *s > 0.0)?);
            Some((x(k), dx(k) * k_se, v, v_se))
        })
        .collect();
    if usable.len() < GAINS {
        return Line::none(Unresolved::TooFewGains { got: usable.len(), need: GAINS });
    }
    let of = |f: fn(&(f64, f64, f64, f64)) -> f64| usable.iter().map(f).collect::<Vec<f64>>();
    let (xs, ys) = (of(|u| u.0), of(|u| u.2));
    let mut errors = of(|u| u.3);
    let mut fitted = Line::none(Unresolved::NotFinite);
    for _ in 0..3 {
        let weights: Vec<f64> = errors.iter().map(|s| 1.0 / (s * s)).collect();
        fitted = line(&xs, &ys, &weights, &errors);
        let slope = fitted.slope.value().unwrap_or(0.0);
        errors = usable.iter().map(|u| u.3.hypot(slope * u.1)).collect();
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
        let pairs: Vec<(&TransferPoint, &TransferPoint)> = ours.iter().zip(green).collect();
        if pairs.is_empty() {
            continue;
        }
        let of = |f: fn(&TransferPoint) -> f64, second: bool| {
            pairs.iter().map(|(a, b)| f(if second { b } else { a })).collect::<Vec<f64>>()
        };
        let (signal, se) = (TransferPoint::signal_dn, TransferPoint::signal_se_dn);
        found.push(through_origin(&of(signal, true), &of(signal, false), &of(se, true), &of(se, false)));
    }
    match found.is_empty() {
        true if both => Measured::none(Unresolved::AllSaturated),
        true => Measured::none(Unresolved::NotStated("red, green and blue pixels")),
        false => weighted_mean(found),
    }
}
