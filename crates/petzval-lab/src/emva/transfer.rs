//! Photon transfer: signal, noise and light of the points of one gain and colour, and the lines through them.
//!
//! ```text
//! mu_y - mu_dark   = R u_p                     responsivity R [DN/photon]
//! s2_y - s2_dark   = K (mu_y - mu_dark)        system gain K [DN/e-]
//! QE               = R / K
//! ```
//!
//! A response that bends, `mu(H)` over the light `H`, gives too little variance at large signals, by `(mu'(H) / mu'(0))^2 mu'(0) H / mu`.
//! What K changes by that is a part of its error, and so is a [departure](super::goodness) of the variance itself from the line.
//! In few points, light that drifts looks like a bend: that part is then at most what the variance leaves open.
//!
//! Source: EMVA 1288 release 4.0 Linear, photon transfer method.

use schemars::JsonSchema;
use serde::Serialize;

use super::compressed::Compression;
use super::deviation_noise::{DeviationNoise, Extremes};
use super::fit::{Line, line};
use super::goodness::{Bend, FitTest, Model, Points, Verdict, bend, places, slope_at_zero, test};
use super::measured::{Measured, Unresolved};
use super::saturation::{Saturation, saturation};
use super::shared_noise::SharedNoise;
use super::transfer_point::FIT_SHARE;
pub use super::transfer_point::{Rules, TransferPoint, light};

/// Straightness of the response: the weighted line through 5 to 95 % of saturation.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Linearity {
    /// Slope, DN per photon (per second of exposure where photons are not known).
    pub slope: f64,
    /// Offset, DN.
    pub offset_dn: f64,
    /// `100 (y - fit) / fit` of every point, percent.
    pub deviation_percent: Vec<f64>,
    /// First and last point of the fit.
    pub range: (usize, usize),
    /// Least deviation within the range, percent.
    pub min_percent: f64,
    /// Largest deviation within the range, percent.
    pub max_percent: f64,
    /// Standard errors of the deviations, percent: noise of the point and of the line.
    pub deviation_se_percent: Vec<f64>,
    /// Those two with their standard errors, percent, which contain what noise adds to the extremes of several points.
    pub extremes_percent: [Measured; 2],
    /// Least and largest deviation of the response itself, percent, without what noise adds; of a straight response the least may be above the
    /// largest.
    pub response_percent: [Measured; 2],
    /// Whether the deviations are noise. They are what this fit is made for, and are stated either way.
    pub test: FitTest,
}

/// Photon transfer of one gain and colour under one set of rules.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PhotonTransfer {
    /// Point of the largest noise, where the sensor begins to saturate; the brightest point if it does not saturate.
    pub saturation: usize,
    /// Whether the noise falls (or the signal stays constant) beyond it: saturation.
    pub saturated: bool,
    /// Signal above dark at saturation, DN; by the rules of the library, the signal of the point of the largest noise.
    pub saturation_signal_dn: Measured,
    /// First and last point of the fits of R and K.
    pub range: (usize, usize),
    /// Number of points of those fits, from the darkest.
    pub used: usize,
    /// System gain at this linear gain, DN/e-.
    pub gain_dn_per_e: Measured,
    /// Whether the variance lies on the line of the gain.
    pub gain_test: FitTest,
    /// System gain without the bend of the response over the light, DN/e-, if more lights than a parabola needs show that it bends. The error is that
    /// of noise and of the bend, and holds for a response that is quadratic.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub straightened_gain_dn_per_e: Option<Measured>,
    /// Noise that pixels or frames share, if they do: K is withdrawn, or its error contains the variance that is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shared_noise: Option<SharedNoise>,
    /// Steps between the digital numbers, if they grow: the error of K contains them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compression: Option<Compression>,
    /// Responsivity, DN per photon.
    pub responsivity_dn: Measured,
    /// Whether the signal lies on the line of the responsivity; `None` where photons are not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub responsivity_test: Option<FitTest>,
    /// Linearity, where enough points lie within its range.
    pub linearity: Option<Linearity>,
    /// Reason if there is no linearity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_linearity: Option<Unresolved>,
}

impl PhotonTransfer {
    /// Whether a point lies beyond the point of the largest noise of a series that saturates.
    pub fn is_beyond_saturation(&self, point: usize) -> bool {
        self.saturated && point > self.saturation
    }

    /// The photon transfer of digital numbers whose steps grow with the signal, as compressed ones do. Takes the mean step at both ends of the
    /// samples, DN, and the variance that rounding adds at each used point, DN^2. The error of K contains its effect.
    pub(super) fn with_steps(
        mut self,
        [low_step_dn, high_step_dn]: [f64; 2],
        used: &[TransferPoint],
        added_dn2: &[f64],
    ) -> Self {
        let signal: Vec<f64> = used.iter().map(TransferPoint::signal_dn).collect();
        let weights = through_origin_weights(&signal);
        let error: f64 = weights.iter().zip(added_dn2).map(|(w, added)| w * added).sum();
        self.gain_test.model_error = self.gain_test.model_error.hypot(error);
        self.gain_test.verdict = Verdict::Widened;
        self.gain_dn_per_e = self.gain_dn_per_e.with_error(error);
        let dark_step_dn = used.iter().map(|p| p.dark_step_dn).fold(1.0, f64::max);
        let gain_error_dn_per_e = error.abs();
        self.compression = Some(Compression { low_step_dn, high_step_dn, dark_step_dn, gain_error_dn_per_e });
        self
    }

    /// The photon transfer of frames whose pixels or frames share noise. K contains the variance that is missing as an error, or is withdrawn.
    pub(super) fn with_shared_noise(mut self, shared: SharedNoise) -> Self {
        let error = shared.missing_share() * self.gain_dn_per_e.value().unwrap_or(0.0);
        self.gain_test.model_error = self.gain_test.model_error.hypot(error);
        if shared.is_far() {
            self.straightened_gain_dn_per_e = None;
        }
        self.shared_noise = Some(shared);
        if shared.is_far() && self.gain_dn_per_e.value().is_some() {
            self.gain_test.verdict = Verdict::Withdrawn;
            self.gain_dn_per_e = Measured::none(Unresolved::SharedNoise);
        } else {
            self.gain_test.verdict = Verdict::Widened;
            self.gain_dn_per_e = self.gain_dn_per_e.with_error(error);
        }
        self
    }
}

/// Analyses points in ascending order of light. `None` without points.
pub fn photon_transfer(points: &[TransferPoint], rules: Rules) -> Option<PhotonTransfer> {
    let found = saturation(points, rules)?;
    let signal: Vec<f64> = points.iter().map(TransferPoint::signal_dn).collect();
    let end_dn = found.signal_dn.value().unwrap_or(signal[found.point]);
    let last_below = |limit: f64| signal.iter().rposition(|s| *s <= limit);
    let range_end = match (rules, found.reached) {
        (Rules::Library, _) => last_below(FIT_SHARE * end_dn),
        (Rules::Ours, true) => last_below(FIT_SHARE * end_dn).map(|last| last.min(found.point)),
        (Rules::Ours, false) => last_with_the_noise_of_light(points),
    };
    let used = &points[..range_end.map_or(0, |i| i + 1)];
    let response = points_of_response(points, used.len(), &found, end_dn);
    let gain = tested_gain(used, response, !found.reached);
    let gain_dn_per_e = if rules == Rules::Ours { gain.resolved() } else { gain.measured() };
    let responsivity = tested_responsivity(used, response);
    let linearity = linearity(points, &signal, end_dn);
    Some(PhotonTransfer {
        saturation: found.point,
        saturated: found.reached,
        saturation_signal_dn: found.signal_dn,
        range: (0, used.len().saturating_sub(1)),
        used: used.len(),
        gain_dn_per_e,
        gain_test: gain.test,
        straightened_gain_dn_per_e: gain.straightened,
        shared_noise: None,
        compression: None,
        responsivity_dn: responsivity.as_ref().map_or_else(|why| Measured::none(*why), Tested::resolved),
        responsivity_test: responsivity.ok().map(|r| r.test),
        no_linearity: linearity.as_ref().err().copied(),
        linearity: linearity.ok(),
    })
}

/// Share of saturation up to which the response is judged (EMVA 1288).
const LINEAR_SHARE: f64 = 0.95;

/// The points that show whether the response bends: those of the fits. One alone shows nothing, and the points up to the end of the linear range
/// are added to it.
fn points_of_response<'a>(
    points: &'a [TransferPoint],
    used: usize,
    found: &Saturation,
    end_dn: f64,
) -> &'a [TransferPoint] {
    if used != 1 {
        return &points[..used];
    }
    let limit_dn = if found.reached { LINEAR_SHARE * end_dn } else { f64::INFINITY };
    let is_linear = |p: &TransferPoint| !p.is_clipped() && p.signal_dn() <= limit_dn;
    let last = points[..=found.point].iter().rposition(is_linear);
    &points[..last.map_or(used, |last| used.max(last + 1))]
}

/// Standard errors by which the noise may be below that of the line. Leaving a point out costs little, so chance may do
/// it once in a thousand points.
const KNEE_SIGMAS: f64 = 3.0;

/// The last usable point of a series that ends before the noise falls: it is not clipped, and neither it nor a point
/// below it is in the knee of the saturation.
///
/// Pixels that begin to fill lose variance long before the mean bends: 2.3 standard deviations below the level 2 % of
/// the variance is lost, while the mean is off by 0.4 % of a standard deviation. Yet the variance may still grow. If a
/// point of the upper 30 % has less noise than the line through the points below predicts, by [`KNEE_SIGMAS`], only the
/// points below are used. A response that bends takes noise as well, and all points show it: what the bend explains is no knee.
fn last_with_the_noise_of_light(points: &[TransferPoint]) -> Option<usize> {
    let last = points.iter().rposition(|p| !p.is_clipped())?;
    let lower_dn = FIT_SHARE * points[last].signal_dn();
    let Some(lower) = points[..last].iter().rposition(|p| p.signal_dn() <= lower_dn) else {
        return Some(last);
    };
    let lit = &points[..=last];
    let straight: Vec<f64> = lit.iter().map(TransferPoint::signal_dn).collect();
    let is_knee = falls_short(lit, lower, &straight) && {
        let bent = bend_of_response(lit).and_then(|bend| bent_noise(&bend, lit));
        bent.is_none_or(|bent| falls_short(lit, lower, &bent))
    };
    Some(if is_knee { lower } else { last })
}

/// Whether a point above `lower` has less noise than the points up to it predict. `noise_dn` is the variance that each point has at a gain of one.
fn falls_short(points: &[TransferPoint], lower: usize, noise_dn: &[f64]) -> bool {
    let line = slope(&points[..=lower], &noise_dn[..=lower]);
    let (Some(k), Some(k_se)) = (line.value(), line.standard_error()) else { return false };
    let is_short = |(p, noise_dn): (&TransferPoint, &f64)| {
        let se = p.shot_variance_se_dn2().hypot(k * p.signal_se_dn()).hypot(k_se * noise_dn);
        k * noise_dn - p.shot_variance_dn2() > KNEE_SIGMAS * se
    };
    points.iter().zip(noise_dn).skip(lower + 1).any(is_short)
}

/// K by noise alone: slope through the origin of the variance over the signal.
fn gain(used: &[TransferPoint]) -> Measured {
    slope(used, &used.iter().map(TransferPoint::signal_dn).collect::<Vec<f64>>())
}

/// Slope through the origin of the variance over the variance at a gain of one, DN.
fn slope(used: &[TransferPoint], noise_dn: &[f64]) -> Measured {
    let variance: Vec<f64> = used.iter().map(TransferPoint::shot_variance_dn2).collect();
    if used.is_empty() {
        return Measured::none(Unresolved::AllSaturated);
    }
    let weights = through_origin_weights(noise_dn);
    let k = weights.iter().zip(&variance).map(|(w, y)| w * y).sum();
    Measured::new(k, transfer_points(used, k).error_of(&weights))
}

/// Weights of the ordinates in the slope of the least-squares line through the origin, all points of equal weight: `x / sum(x x)`.
fn through_origin_weights(x: &[f64]) -> Vec<f64> {
    let xx: f64 = x.iter().map(|x| x * x).sum();
    x.iter().map(|x| x / xx).collect()
}

/// The variance over the signal, with the errors of both as those of the variance at the gain `k`. Points of one dark point share its error,
/// and all points share that of rounding.
fn transfer_points(used: &[TransferPoint], k: f64) -> Points {
    let own = |p: &TransferPoint| p.variance_se_dn2.hypot(k * p.mean_se_dn);
    let of_dark = |p: &TransferPoint| p.dark_variance_se_dn2.hypot(k * p.dark_mean_se_dn);
    let rounding = |p: &TransferPoint| {
        let rounding = p.dark_rounding();
        rounding.variance_dn2.hypot(k * rounding.mean_dn)
    };
    Points {
        x: used.iter().map(TransferPoint::signal_dn).collect(),
        y: used.iter().map(TransferPoint::shot_variance_dn2).collect(),
        own_se: used.iter().map(own).collect(),
        shared: shared(used, of_dark, rounding),
    }
}

/// The signal over the light, with its errors.
fn response_points(light: Vec<f64>, used: &[TransferPoint]) -> Points {
    Points {
        x: light,
        y: used.iter().map(TransferPoint::signal_dn).collect(),
        own_se: used.iter().map(|p| p.mean_se_dn).collect(),
        shared: shared(used, |p| p.dark_mean_se_dn, |p| p.dark_rounding().mean_dn),
    }
}

/// Errors that points share: that of each dark point, and that of rounding.
fn shared(
    used: &[TransferPoint],
    of_dark: impl Fn(&TransferPoint) -> f64,
    rounding: impl Fn(&TransferPoint) -> f64,
) -> Vec<Vec<f64>> {
    let dark = |p: &TransferPoint| (p.exposure_s, p.dark_mean_dn, p.dark_variance_dn2);
    let is_first = |i: &usize| used[..*i].iter().all(|p| dark(p) != dark(&used[*i]));
    let of_group = |i: usize| {
        let of = |p: &TransferPoint| if dark(p) == dark(&used[i]) { of_dark(p) } else { 0.0 };
        used.iter().map(of).collect()
    };
    let mut all: Vec<Vec<f64>> = (0..used.len()).filter(is_first).map(of_group).collect();
    let of_all: Vec<f64> = used.iter().map(rounding).collect();
    if of_all.iter().any(|error| *error > 0.0) {
        all.push(of_all);
    }
    all
}

/// A slope with the test of its fit.
struct Tested {
    /// With the error of noise alone.
    by_noise: Measured,
    test: FitTest,
    straightened: Option<Measured>,
}

impl Tested {
    /// With the error of the model.
    fn measured(&self) -> Measured {
        self.by_noise.with_error(self.test.model_error)
    }

    /// The slope, if it is above zero by more than its errors. The reason says which of them is too large.
    fn resolved(&self) -> Measured {
        let (above_noise, measured) = (self.by_noise.if_above_noise(), self.measured());
        let is_lost = above_noise.value().is_some() && measured.if_above_noise().value().is_none();
        match (measured.value(), measured.standard_error()) {
            (Some(value), Some(standard_error)) if is_lost => {
                Measured::none(Unresolved::WithinModelError { value, standard_error })
            }
            _ => above_noise.with_error(self.test.model_error),
        }
    }
}

/// K with the errors of noise, of the departure of the variance from the line, and of the bend of the response. `is_open` says that the series
/// ends below saturation.
fn tested_gain(used: &[TransferPoint], response: &[TransferPoint], is_open: bool) -> Tested {
    let by_noise = gain(used);
    let k = by_noise.value().unwrap_or(0.0);
    let points = transfer_points(used, k);
    let (mut test, departure) = test(&points, Model::ThroughOrigin, &[k]);
    let of_noise = by_noise.error_or_zero();
    // A line that need not go through the origin is far from one point: it is not extrapolated to zero.
    let model = if used.len() == 1 { Model::ThroughOrigin } else { model_of_response(response) };
    let bend = bend(&response_points(light(response), response), model);
    let share = bend.and_then(|bend| share_of_gain(&bend, used));
    // Without further points, and where the bend is too large for its formula, the variance limits what it does.
    let open = || open_by_variance(&points, k).min(k.abs());
    let of_share = |share: f64| (k * (share - 1.0)).abs();
    let of_bend = bend.map_or(0.0, |bend| match share {
        Some(share) if bend.is_certain => of_share(share),
        // What makes the points scatter may hide a larger bend.
        Some(_) => {
            let ends = [-1.0, 1.0]
                .map(|sigmas| share_of_gain(&bend.off_by(sigmas), used).map_or(f64::INFINITY, of_share));
            ends[0].max(ends[1]).min(open())
        }
        None => open(),
    });
    // Near saturation the variance above is that of the knee.
    let of_above = if is_open { of_points_above(used, response, k) } else { 0.0 };
    test.model_error = departure.error(0, of_noise).hypot(of_bend).hypot(of_above);
    if test.model_error > 0.0 {
        test.verdict = Verdict::Widened;
    }
    let certain = bend.filter(|bend| bend.is_certain).zip(share);
    let straightened = certain.and_then(|(bend, share)| {
        let [low, high] = [share_of_gain(&bend.off_by(-1.0), used)?, share_of_gain(&bend.off_by(1.0), used)?];
        let straight = by_noise.scale(1.0 / share);
        Some(straight.with_error(straight.value()? * (high - low).abs() / (2.0 * share)))
    });
    Tested { by_noise, test, straightened }
}

/// How far the variance of the points above is from a gain that one point determines, DN/e-. A light that drifts may hide how the response bends,
/// and a knee may have begun in that point.
fn of_points_above(used: &[TransferPoint], response: &[TransferPoint], k: f64) -> f64 {
    if used.len() != 1 || response.len() == 1 {
        return 0.0;
    }
    slope_at_zero(&transfer_points(response, k)).map_or(k, |[slope, _]| slope - k).abs().min(k.abs())
}

/// The bend of the response over the light.
fn bend_of_response(points: &[TransferPoint]) -> Option<Bend> {
    bend(&response_points(light(points), points), model_of_response(points))
}

/// The model of the response over the light: through the origin, if there are two lights.
fn model_of_response(points: &[TransferPoint]) -> Model {
    if places(&light(points)) < 3 { Model::ThroughOrigin } else { Model::Line }
}

/// The variance of each point of a response that bends at a gain of one, `(mu'(H) / mu'(0))^2 mu'(0) H`, DN; `None` where the bend is too large
/// for it.
fn bent_noise(bend: &Bend, points: &[TransferPoint]) -> Option<Vec<f64>> {
    let [start, slope, bend] = bend.coefficients;
    let of_light = |light: f64| {
        let steepness = 1.0 + 2.0 * bend * light / slope;
        (start + slope * light) * steepness * steepness
    };
    let all: Vec<f64> = light(points).into_iter().map(of_light).collect();
    all.iter().all(|noise| noise.is_finite() && *noise > 0.0).then_some(all)
}

/// The gain that a response which bends over the light gives, over that of small signals.
fn share_of_gain(bend: &Bend, used: &[TransferPoint]) -> Option<f64> {
    let weights = through_origin_weights(&used.iter().map(TransferPoint::signal_dn).collect::<Vec<f64>>());
    let share: f64 = weights.iter().zip(bent_noise(bend, used)?).map(|(weight, noise)| weight * noise).sum();
    (share.is_finite() && share > 0.0).then_some(share)
}

/// How far the gain of small signals may be from `k` by the variance alone, DN/e-: infinite, if one point or less determines it.
fn open_by_variance(points: &Points, k: f64) -> f64 {
    slope_at_zero(points).map_or(f64::INFINITY, |[slope, error]| (slope - k).hypot(error))
}

/// R: slope through the origin of the signal over the photons. Rounding of the dark mean shifts all points together.
fn tested_responsivity(used: &[TransferPoint], response: &[TransferPoint]) -> Result<Tested, Unresolved> {
    let photons = photons_of(used).ok_or(Unresolved::NoPhotons)?;
    if photons.is_empty() {
        return Err(Unresolved::AllSaturated);
    }
    let weights = through_origin_weights(&photons);
    let points = response_points(photons, used);
    let r = weights.iter().zip(&points.y).map(|(w, y)| w * y).sum();
    let of_noise = points.error_of(&weights);
    let (mut test, departure) = test(&points, Model::ThroughOrigin, &[r]);
    test.model_error = departure.error(0, of_noise);
    // A bend that the test of few points cannot show is an error of R as well.
    if departure.bend[0] == 0.0
        && let Some(photons) = photons_of(response)
        && let Some(bend) = bend(&response_points(photons, response), Model::ThroughOrigin)
    {
        let hidden = (bend.coefficients[1] - r).abs().max(bend.step[1].abs());
        test.model_error = test.model_error.max(hidden);
        test.verdict = Verdict::Widened;
    }
    Ok(Tested { by_noise: Measured::new(r, of_noise), test, straightened: None })
}

/// Photons of each point, if all are known.
fn photons_of(points: &[TransferPoint]) -> Option<Vec<f64>> {
    points.iter().map(|p| p.photons).collect()
}

/// The line through the points of 5 to 95 % of `end_dn`, the signal at saturation.
fn linearity(points: &[TransferPoint], signal: &[f64], end_dn: f64) -> Result<Linearity, Unresolved> {
    // Select the points between 5 and 95 % of saturation, if their light differs.
    let x = light(points);
    let (low, high) = x.iter().fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(*x), high.max(*x)));
    if points.len() > 1 && high - low <= 1e-9 * high {
        return Err(Unresolved::OneLight);
    }
    let range_of = |(first, last): (usize, usize)| (last + 1).saturating_sub(first);
    let first = signal.iter().position(|s| *s >= 0.05 * end_dn);
    let last = signal.iter().rposition(|s| *s <= 0.95 * end_dn);
    let within = first.zip(last).filter(|range| range_of(*range) >= 2);
    let Some((first, last)) = within.filter(|(first, last)| !signal[*first..=*last].contains(&0.0)) else {
        return Err(Unresolved::FewInLinearRange(first.zip(last).map_or(0, range_of)));
    };
    // Fit the line with weights of one over the squared signal, so that relative errors count.
    let weight: Vec<f64> = signal[first..=last].iter().map(|s| 1.0 / (s * s)).collect();
    let fit: Line = line(&x[first..=last], &signal[first..=last], &weight, &vec![0.0; weight.len()]);
    let (Some(slope), Some(offset_dn)) = (fit.slope.value(), fit.intercept.value()) else {
        return Err(Unresolved::OneLight);
    };
    // Compute the deviations of all points from the line, and the extremes within the range.
    let deviations = x.iter().zip(signal).map(|(x, y)| {
        let fitted = slope * x + offset_dn;
        if fitted == 0.0 { 0.0 } else { 100.0 * (y - fitted) / fitted }
    });
    let deviation_percent: Vec<f64> = deviations.collect();
    let by_deviation = |a: &usize, b: &usize| deviation_percent[*a].total_cmp(&deviation_percent[*b]);
    let (low, high) = (
        (first..=last).min_by(by_deviation).unwrap_or(first),
        (first..=last).max_by(by_deviation).unwrap_or(last),
    );
    let response = response_points(x[first..=last].to_vec(), &points[first..=last]);
    // Errors of linearity are departures from the line, so that nothing has to be added to them.
    let (mut test, _) = test(&response, Model::Line, &[offset_dn, slope]);
    if test.verdict == Verdict::Widened {
        test.verdict = Verdict::Stated;
    }
    let noise = DeviationNoise::of(response_points(x, points), (first, last), [offset_dn, slope]);
    let extremes = match range_of((first, last)) {
        2 => Extremes::none(Unresolved::FewInLinearRange(2)),
        _ => noise.extremes(&deviation_percent[first..=last], &test),
    };
    Ok(Linearity {
        test,
        slope,
        offset_dn,
        range: (first, last),
        min_percent: deviation_percent[low],
        max_percent: deviation_percent[high],
        deviation_se_percent: noise.errors(),
        extremes_percent: extremes.of_points,
        response_percent: extremes.of_response,
        deviation_percent,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of unit exposure steps with the given signals and temporal variances above a dark of 100 DN and 1 DN^2.
    fn points(signals: &[f64], variances: &[f64], variance_se_dn2: f64) -> Vec<TransferPoint> {
        let point = |(i, (signal, variance)): (usize, (&f64, &f64))| TransferPoint {
            exposure_s: 1.0 + i as f64,
            photons: None,
            mean_dn: 100.0 + signal,
            mean_se_dn: 0.1,
            variance_dn2: 1.0 + variance,
            variance_se_dn2,
            dark_mean_dn: 100.0,
            dark_mean_se_dn: 0.1,
            dark_variance_dn2: 1.0,
            dark_variance_se_dn2: 0.01,
            dark_step_dn: 1.0,
            row_flicker_dn2: 0.0,
            total_variance_dn2: 1.0 + variance,
            share_at_max: 0.0,
        };
        signals.iter().zip(variances).enumerate().map(point).collect()
    }

    #[test]
    fn chance_in_the_noise_is_not_saturation() {
        // The last variance is below the one before by one standard error of their difference.
        let mut series = points(&[1000.0, 2000.0, 3000.0, 3050.0], &[100.0, 200.0, 309.0, 302.0], 5.0);
        series[3].exposure_s = 3.05;
        let library = photon_transfer(&series, Rules::Library).unwrap();
        assert!(library.saturated && library.saturation == 2);
        let ours = photon_transfer(&series, Rules::Ours).unwrap();
        assert!(!ours.saturated && ours.used == 4 && ours.saturation == 3, "{ours:?}");
        // A fall by ten of them is.
        let series = points(&[1000.0, 2000.0, 3000.0, 3100.0], &[100.0, 200.0, 309.0, 230.0], 5.0);
        let ours = photon_transfer(&series, Rules::Ours).unwrap();
        assert!(ours.saturated && ours.saturation == 2 && ours.used == 2, "{ours:?}");
    }

    #[test]
    fn a_plateau_is_saturation_with_any_noise() {
        // Beyond the full well read noise alone is left; its chance must not pass for a peak.
        let signals = [500.0, 1000.0, 1500.0, 2000.0, 2100.0, 2100.2, 2099.9, 2100.0];
        let series = points(&signals, &[50.0, 100.0, 150.0, 200.0, 5.1, 5.0, 5.2, 5.0], 0.05);
        let ours = photon_transfer(&series, Rules::Ours).unwrap();
        assert!(ours.saturated && ours.saturation == 3 && ours.used == 2, "{ours:?}");
        // The pixels are full at the level of the plateau, its mean; the peak of the noise is 100 DN before.
        let (level, se) = (ours.saturation_signal_dn.value(), ours.saturation_signal_dn.standard_error());
        assert!((level.unwrap() - 2100.025).abs() < 1e-9 && se.unwrap() < 0.7, "{level:?} +- {se:?}");
        // A signal that stays while the noise does not fall: the light no longer reaches the pixels.
        let series = points(&[1000.0, 2000.0, 2010.0, 2009.0], &[100.0, 200.0, 201.0, 203.0], 5.0);
        let ours = photon_transfer(&series, Rules::Ours).unwrap();
        assert!(ours.saturated && ours.saturation == 1 && ours.used == 1, "{ours:?}");
    }

    #[test]
    fn a_point_with_too_little_noise_is_left_out() {
        // The brightest has 8 % less than the line predicts: 4.8 standard errors, and more than any other point.
        let signals = [1000.0, 2000.0, 3000.0, 4000.0, 5000.0];
        let series = points(&signals, &[100.0, 200.0, 300.0, 400.0, 460.0], 5.0);
        let ours = photon_transfer(&series, Rules::Ours).unwrap();
        assert!(!ours.saturated && ours.used == 3, "{ours:?}");
        let series = points(&signals, &[100.0, 200.0, 300.0, 400.0, 485.0], 5.0);
        assert_eq!(photon_transfer(&series, Rules::Ours).unwrap().used, 5);
    }

    /// Points of a gain of 0.1 DN/e- whose response is `1000 t - bend t^power` DN, with a standard error of 5 DN^2 of the variance.
    fn bent_points(exposures: usize, bend: f64, power: i32) -> Vec<TransferPoint> {
        let times: Vec<f64> = (1..=exposures).map(|t| t as f64).collect();
        let signals: Vec<f64> = times.iter().map(|t| 1000.0 * t - bend * t.powi(power)).collect();
        let variance = |t: &f64| {
            let steepness = 1.0 - 1e-3 * bend * f64::from(power) * t.powi(power - 1);
            100.0 * t * steepness * steepness
        };
        points(&signals, &times.iter().map(variance).collect::<Vec<f64>>(), 5.0)
    }

    #[test]
    fn a_response_that_bends_has_no_knee_and_widens_the_error_of_few_points() {
        // Of four points the brightest has less noise than the line of the two below 70 % predicts, by 4.7 standard errors.
        let four = photon_transfer(&bent_points(4, 20.0, 2), Rules::Ours).unwrap();
        assert_eq!((four.used, four.gain_test.verdict), (4, Verdict::Widened), "{four:?}");
        let (k, se) = (four.gain_dn_per_e.value().unwrap(), four.gain_dn_per_e.standard_error().unwrap());
        assert!(((k - 0.1) / se).abs() < 2.0 && four.gain_test.model_error > 0.0, "{k} +- {se}");
        // Four points of a cubic bend give no K.
        let cubic = photon_transfer(&bent_points(4, 4.0, 3), Rules::Ours).unwrap();
        assert_eq!((cubic.used, cubic.gain_dn_per_e.value()), (4, None), "{cubic:?}");
        // Two points do not show that they bend: the error allows for what they may hide.
        let two = photon_transfer(&bent_points(2, 20.0, 2), Rules::Ours).unwrap();
        assert_eq!((two.used, two.gain_test.verdict), (2, Verdict::Widened), "{two:?}");
        let (k, se) = (two.gain_dn_per_e.value().unwrap(), two.gain_dn_per_e.standard_error().unwrap());
        assert!(((k - 0.1) / se).abs() < 2.0 && two.gain_test.model_error > 0.007, "{k} +- {se}");
        // A straight response has errors of noise alone.
        for exposures in 1..=4 {
            let found = photon_transfer(&bent_points(exposures, 0.0, 2), Rules::Ours).unwrap();
            assert_eq!((found.used, found.gain_test.model_error), (exposures, 0.0), "{found:?}");
        }
    }

    #[test]
    fn one_point_of_the_fits_has_the_bend_of_the_points_above_it() {
        // Of three points up to saturation the first is below 70 % and the second below 95 %; the last is full.
        let mut series = points(&[1900.0, 2760.0, 3150.0, 3300.0], &[170.0, 223.0, 241.0, 5.0], 2.0);
        for (point, exposure_s) in series.iter_mut().zip([2.0, 3.0, 3.5, 6.0]) {
            point.exposure_s = exposure_s;
            point.photons = Some(1000.0 * exposure_s);
        }
        let found = photon_transfer(&series, Rules::Ours).unwrap();
        assert!(found.saturated && found.used == 1, "{found:?}");
        assert_eq!(found.gain_test.verdict, Verdict::Widened, "{found:?}");
        assert_eq!(found.responsivity_test.unwrap().verdict, Verdict::Widened, "{found:?}");
    }

    #[test]
    fn a_knee_that_leaves_one_of_two_points_is_in_the_error_of_k() {
        // A light that drifts hides the bend of the response; the gain is 0.1 DN/e-.
        let found = photon_transfer(&points(&[1000.0, 2000.0], &[95.0, 165.0], 0.5), Rules::Ours).unwrap();
        assert_eq!((found.used, found.gain_test.verdict), (1, Verdict::Widened), "{found:?}");
        let (k, se) = (found.gain_dn_per_e.value().unwrap(), found.gain_dn_per_e.standard_error().unwrap());
        assert!(((k - 0.1) / se).abs() < 1.0 && se < 0.02, "{k} +- {se}");
        assert_eq!(found.straightened_gain_dn_per_e, None);
    }

    #[test]
    fn a_gain_that_is_lost_in_the_error_of_its_model_says_so() {
        let cubic = photon_transfer(&bent_points(4, 4.0, 3), Rules::Ours).unwrap();
        let why = cubic.gain_dn_per_e.reason();
        assert!(matches!(why, Some(Unresolved::WithinModelError { .. })), "{why:?}");
        let noise = photon_transfer(&points(&[1000.0, 2000.0], &[1.0, 2.0], 5.0), Rules::Ours).unwrap();
        let why = noise.gain_dn_per_e.reason();
        assert!(matches!(why, Some(Unresolved::WithinNoise { .. })), "{why:?}");
    }

    #[test]
    fn a_bend_of_few_lights_straightens_no_gain() {
        // Three lights of a straight response, of which one drifts by 0.3 %.
        let mut series = points(&[1000.0, 2006.0, 3000.0], &[100.0, 200.6, 300.0], 0.5);
        series.iter_mut().for_each(|p| p.mean_se_dn = 0.01);
        let found = photon_transfer(&series, Rules::Ours).unwrap();
        assert_eq!((found.used, found.straightened_gain_dn_per_e), (3, None), "{found:?}");
        // Six show the bend.
        let found = photon_transfer(&bent_points(6, 20.0, 2), Rules::Ours).unwrap();
        assert!(found.straightened_gain_dn_per_e.is_some(), "{found:?}");
    }

    #[test]
    fn missing_linearity_has_its_reason() {
        let mut series = points(&[1000.0, 2000.0, 3000.0], &[100.0, 200.0, 300.0], 5.0);
        series.iter_mut().for_each(|p| p.exposure_s = 1.0);
        let ours = photon_transfer(&series, Rules::Ours).unwrap();
        assert_eq!(ours.no_linearity, Some(Unresolved::OneLight));
        // One light level needs none for the system gain.
        assert!((ours.gain_dn_per_e.value().unwrap() - 0.1).abs() < 1e-9);
        series.iter_mut().for_each(|p| p.share_at_max = 0.3);
        let ours = photon_transfer(&series, Rules::Ours).unwrap();
        assert_eq!(ours.gain_dn_per_e.reason(), Some(Unresolved::AllSaturated));
    }
}
