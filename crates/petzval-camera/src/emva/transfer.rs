//! Photon transfer: signal, noise and light of the points of one gain and colour, and what lines through them tell.
//!
//! ```text
//! mu_y - mu_dark   = R u_p                     responsivity R [DN/photon]
//! s2_y - s2_dark   = K (mu_y - mu_dark)        system gain K [DN/e-]
//! QE               = R / K
//! ```
//!
//! Source: EMVA 1288 release 4.0 Linear, photon transfer method.

use serde::Serialize;

use super::fit::{Line, line, through_origin};
use super::measured::{Measured, Unresolved};
use super::point::Moments;

/// One setting with its flat and its dark frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TransferPoint {
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Photons per pixel, if they are known.
    pub photons: Option<f64>,
    /// Mean of the flat frames, DN.
    pub mean_dn: f64,
    /// Its standard error, DN.
    pub mean_se_dn: f64,
    /// Temporal variance of the flat frames, DN^2.
    pub variance_dn2: f64,
    /// Its standard error, DN^2.
    pub variance_se_dn2: f64,
    /// Mean of the dark frames, DN.
    pub dark_mean_dn: f64,
    /// Its standard error, DN.
    pub dark_mean_se_dn: f64,
    /// Temporal variance of the dark frames, DN^2.
    pub dark_variance_dn2: f64,
    /// Its standard error, DN^2.
    pub dark_variance_se_dn2: f64,
    /// Share of the flat samples at the largest digital number.
    pub share_at_max: f64,
}

impl TransferPoint {
    /// Pairs flat and dark moments; `mean_difference` subtracts the variance of the frames' means (release 4).
    pub fn new(
        exposure_s: f64,
        photons: Option<f64>,
        flat: &Moments,
        dark: &Moments,
        mean_difference: bool,
    ) -> Self {
        let variance =
            |m: &Moments| if mean_difference { m.variance_dn2 } else { m.variance_uncorrected_dn2 };
        Self {
            exposure_s,
            photons,
            mean_dn: flat.mean_dn,
            mean_se_dn: flat.mean_se_dn,
            variance_dn2: variance(flat),
            variance_se_dn2: flat.variance_se_dn2,
            dark_mean_dn: dark.mean_dn,
            dark_mean_se_dn: dark.mean_se_dn,
            dark_variance_dn2: variance(dark),
            dark_variance_se_dn2: dark.variance_se_dn2,
            share_at_max: flat.share_at_max,
        }
    }

    /// Signal above dark, DN.
    pub fn signal_dn(&self) -> f64 {
        self.mean_dn - self.dark_mean_dn
    }

    /// Standard error of the signal, DN.
    pub fn signal_se_dn(&self) -> f64 {
        self.mean_se_dn.hypot(self.dark_mean_se_dn)
    }

    /// Variance above dark, DN^2.
    pub fn shot_variance_dn2(&self) -> f64 {
        self.variance_dn2 - self.dark_variance_dn2
    }

    /// Standard error of the variance above dark, DN^2.
    pub fn shot_variance_se_dn2(&self) -> f64 {
        self.variance_se_dn2.hypot(self.dark_variance_se_dn2)
    }
}

/// Which rules choose the points of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rules {
    /// Those of the EMVA 1288 Python library: the brightest point counts as saturated if no peak of the noise is seen.
    Library,
    /// Ours: without a peak of the noise there is no saturation, and all points that are not clipped count.
    Ours,
}

/// Share of samples at the largest digital number from which a point counts as clipped.
pub const CLIPPED_SHARE: f64 = 1e-4;

/// Straightness of the response: the weighted line through 5 to 95 % of saturation.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    /// Standard errors of least and largest deviation from the noise of their points, percent.
    pub se_percent: (f64, f64),
}

/// Photon transfer of one gain and colour under one set of rules.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhotonTransfer {
    /// Point of the largest noise: where the sensor begins to saturate.
    pub saturation: usize,
    /// Whether the noise falls beyond it, so that it is a peak.
    pub saturated: bool,
    /// First and last point of the fits of R and K.
    pub range: (usize, usize),
    /// System gain at this linear gain, DN/e-.
    pub gain_dn_per_e: Measured,
    /// Responsivity, DN per photon.
    pub responsivity_dn: Measured,
    /// Linearity, where enough points lie within its range.
    pub linearity: Option<Linearity>,
}

/// Walks from the bright end to the peak of the noise: a point is passed as long as it or its darker neighbour is no
/// less noisy than the point accepted last.
fn noise_peak(points: &[TransferPoint]) -> usize {
    let noise: Vec<f64> = points.iter().map(|p| p.variance_dn2).collect();
    let (mut peak, mut accepted) = (0, 0.0);
    for i in (0..noise.len()).rev() {
        let darker = if i > 0 { noise[i - 1] } else { noise[1.min(noise.len() - 1)] };
        if noise[i] < accepted && darker < accepted {
            break;
        }
        (peak, accepted) = (i, noise[i]);
    }
    peak
}

/// Analyses points in the order of growing light. `None` without points.
pub fn photon_transfer(points: &[TransferPoint], rules: Rules) -> Option<PhotonTransfer> {
    let brightest = points.len().checked_sub(1)?;
    let saturation = noise_peak(points);
    let saturated = saturation < brightest || points[brightest].share_at_max > 0.5;
    let signal: Vec<f64> = points.iter().map(TransferPoint::signal_dn).collect();

    // Fits take the lower 70 % of the way to saturation.
    let last_below = |limit: f64| signal.iter().rposition(|s| *s <= limit);
    let range_end = match rules {
        Rules::Ours if !saturated => points.iter().rposition(|p| p.share_at_max <= CLIPPED_SHARE),
        _ => last_below(0.7 * signal[saturation]),
    };
    let used = &points[..range_end.map_or(0, |i| i + 1)];
    let measured = gain(used);
    let gain_dn_per_e = if rules == Rules::Ours { measured.if_above_noise() } else { measured };
    Some(PhotonTransfer {
        saturation,
        saturated,
        range: (0, used.len().saturating_sub(1)),
        gain_dn_per_e,
        responsivity_dn: responsivity(used),
        linearity: linearity(points, &signal, saturation),
    })
}

/// K: slope through the origin of the variance over the signal.
fn gain(used: &[TransferPoint]) -> Measured {
    if used.is_empty() {
        return Measured::none(Unresolved::TooFewPoints { got: 0, need: 1 });
    }
    let of = |f: fn(&TransferPoint) -> f64| used.iter().map(f).collect::<Vec<f64>>();
    let slope = |x_se: Vec<f64>, y_se: Vec<f64>| {
        through_origin(&of(TransferPoint::signal_dn), &of(TransferPoint::shot_variance_dn2), &x_se, &y_se)
    };
    let first = &used[0];
    let shared = used.len() > 1
        && used.iter().all(|p| {
            (p.exposure_s, p.dark_mean_dn, p.dark_variance_dn2)
                == (first.exposure_s, first.dark_mean_dn, first.dark_variance_dn2)
        });
    if !shared {
        return slope(of(TransferPoint::signal_se_dn), of(TransferPoint::shot_variance_se_dn2));
    }
    // One dark point for all: its error moves all points together, `sum(x) / sum(x x)` times.
    let own = slope(of(|p| p.mean_se_dn), of(|p| p.variance_se_dn2));
    let (x, xx) = used.iter().map(TransferPoint::signal_dn).fold((0.0, 0.0), |(s, q), x| (s + x, q + x * x));
    match (own.value(), own.standard_error()) {
        (Some(k), Some(se)) => {
            let dark = x / xx * first.dark_variance_se_dn2.hypot(k * first.dark_mean_se_dn);
            Measured::new(k, se.hypot(dark))
        }
        _ => own,
    }
}

/// R: slope through the origin of the signal over the photons.
fn responsivity(used: &[TransferPoint]) -> Measured {
    let photons: Option<Vec<f64>> = used.iter().map(|p| p.photons).collect();
    match photons {
        None => Measured::none(Unresolved::NoPhotons),
        Some(photons) if photons.is_empty() => Measured::none(Unresolved::TooFewPoints { got: 0, need: 1 }),
        Some(photons) => {
            let signal: Vec<f64> = used.iter().map(TransferPoint::signal_dn).collect();
            let error: Vec<f64> = used.iter().map(TransferPoint::signal_se_dn).collect();
            through_origin(&photons, &signal, &vec![0.0; used.len()], &error).if_above_noise()
        }
    }
}

/// Light of each point: photons if all are known, else exposure times.
pub fn light(points: &[TransferPoint]) -> Vec<f64> {
    let photons: Option<Vec<f64>> = points.iter().map(|p| p.photons).collect();
    photons.unwrap_or_else(|| points.iter().map(|p| p.exposure_s).collect())
}

fn linearity(points: &[TransferPoint], signal: &[f64], saturation: usize) -> Option<Linearity> {
    let x = light(points);
    let first = signal.iter().position(|s| *s >= 0.05 * signal[saturation])?;
    let last = signal.iter().rposition(|s| *s <= 0.95 * signal[saturation])?;
    if last < first + 1 || signal[first..=last].contains(&0.0) {
        return None;
    }
    // Relative errors count: the weight of a point is one over its signal squared.
    let weight: Vec<f64> = signal[first..=last].iter().map(|s| 1.0 / (s * s)).collect();
    let fit: Line = line(&x[first..=last], &signal[first..=last], &weight, &vec![0.0; weight.len()]);
    let (slope, offset_dn) = (fit.slope.value()?, fit.intercept.value()?);
    let deviation_percent: Vec<f64> = x
        .iter()
        .zip(signal)
        .map(|(x, y)| {
            let fitted = slope * x + offset_dn;
            if fitted == 0.0 { 0.0 } else { 100.0 * (y - fitted) / fitted }
        })
        .collect();
    let by_deviation = |a: &usize, b: &usize| deviation_percent[*a].total_cmp(&deviation_percent[*b]);
    let (low, high) = ((first..=last).min_by(by_deviation)?, (first..=last).max_by(by_deviation)?);
    let se = |i: usize| 100.0 * points[i].signal_se_dn() / signal[i].abs();
    Some(Linearity {
        slope,
        offset_dn,
        range: (first, last),
        min_percent: deviation_percent[low],
        max_percent: deviation_percent[high],
        se_percent: (se(low), se(high)),
        deviation_percent,
    })
}
