//! Where the signal ends: the full well of the pixel, or the end of the converter, whichever comes first.
//!
//! EMVA 1288 takes the largest temporal variance as the saturation point. A series locates that maximum to one step of
//! its light, always on the dark side, because the next point is already full. Beyond it the mean stays at a constant
//! level, which is the capacity of the pixel. So we take the saturation signal from this level:
//!
//! ```text
//! y_sat    = level of mu_y - mu_dark                 [DN]
//! u_e.sat  = y_sat / K,   u_p.sat = y_sat / R
//! ```
//!
//! The two definitions agree to the width of the knee. For a hard full well `u` with shot noise alone the variance
//! peaks about three standard deviations below it, `u - 3 sqrt(u)`, which is 3 % of 10,000 electrons.

use super::measured::{Measured, Unresolved};
use super::transfer_point::{FIT_SHARE, Rules, TransferPoint, light};

/// Standard errors by which the noise must fall, or the signal fall short, before it is saturation: chance does as much
/// once in a million points.
const SATURATION_SIGMAS: f64 = 5.0;

/// The saturation of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Saturation {
    /// Point of the largest noise, the last before the signal ends; the brightest point if the signal does not end.
    pub point: usize,
    /// Whether the series goes beyond it.
    pub reached: bool,
    /// Signal above dark at which it ends, DN.
    pub signal_dn: Measured,
}

/// Finds saturation among points in ascending order of light; `None` without points.
pub fn saturation(points: &[TransferPoint], rules: Rules) -> Option<Saturation> {
    let brightest = points.len().checked_sub(1)?;
    let clipped = points[brightest].is_full();
    Some(match rules {
        Rules::Library => {
            let point = noise_peak(points);
            let signal_dn = Measured::exact(points[point].signal_dn());
            Saturation { point, reached: point < brightest || clipped, signal_dn }
        }
        Rules::Ours => match significant_peak(points).or_else(|| plateau(points)) {
            Some(point) => Saturation { point, reached: true, signal_dn: level(points, point) },
            None if clipped => {
                Saturation { point: brightest, reached: true, signal_dn: level(points, brightest) }
            }
            None => Saturation {
                point: brightest,
                reached: false,
                signal_dn: Measured::none(Unresolved::NotSaturated),
            },
        },
    })
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

/// The point of the largest noise, if a brighter point has less noise by [`SATURATION_SIGMAS`] and the signal ends
/// there. The second condition excludes movement, which makes noise at any signal.
fn significant_peak(points: &[TransferPoint]) -> Option<usize> {
    let peak =
        (0..points.len()).max_by(|a, b| points[*a].variance_dn2.total_cmp(&points[*b].variance_dn2))?;
    let top = &points[peak];
    let falls = |p: &TransferPoint| {
        let noise = top.variance_se_dn2.hypot(p.variance_se_dn2);
        top.variance_dn2 - p.variance_dn2 > SATURATION_SIGMAS * noise
    };
    let largest_dn = points.iter().map(TransferPoint::signal_dn).fold(0.0, f64::max);
    let ends = top.signal_dn() > FIT_SHARE * largest_dn;
    (ends && points[peak + 1..].iter().any(falls)).then_some(peak)
}

/// The first point of a plateau: from there to the brightest point the signal grows by less than half as much as the light.
fn plateau(points: &[TransferPoint]) -> Option<usize> {
    let x = light(points);
    let signal: Vec<f64> = points.iter().map(TransferPoint::signal_dn).collect();
    let brightest = points.len().checked_sub(1)?;
    let flat = |i: usize| {
        let expected = signal[i - 1] / x[i - 1] * (x[i] - x[i - 1]);
        let noise = points[i - 1].signal_se_dn().hypot(points[i].signal_se_dn());
        x[i - 1] > 0.0 && 0.5 * expected - (signal[i] - signal[i - 1]) > SATURATION_SIGMAS * noise
    };
    let start = (1..=brightest).rev().take_while(|i| flat(*i)).last()? - 1;
    Some(start)
}

/// A mean of samples that are cut off at a level lies below the level by at most this times `s v`. `s` is the spread of the samples before
/// the cut, `v` the share of the variance that is left. The factor is 1.2 for a normal distribution cut in its middle, and 1.45 for one
/// that keeps three quarters of its variance.
const SHORT_OF_LEVEL: f64 = 1.5;

/// Standard errors within which a mean is as large as the largest.
const LEVEL_SIGMAS: f64 = 3.0;

/// Signal at which the series ends: the mean over the points from the peak of the noise on that are as bright as the brightest, above the dark
/// at that peak. The brightest alone would be above the level by noise, the more so the more points there are.
///
/// Its standard error has three parts. The first is the error of the means. The second is the distance of the largest mean from the level,
/// estimated from the remaining shot noise: full pixels have none ([`SHORT_OF_LEVEL`]). The third is the growth of the dark signal over the
/// step in which the pixels fill.
fn level(points: &[TransferPoint], peak: usize) -> Measured {
    let at_peak = &points[peak];
    let beyond = points[peak..].iter().max_by(|a, b| a.mean_dn.total_cmp(&b.mean_dn));
    let full = beyond.unwrap_or(at_peak);
    let is_as_bright =
        |p: &&TransferPoint| full.mean_dn - p.mean_dn <= LEVEL_SIGMAS * full.mean_se_dn.hypot(p.mean_se_dn);
    let (mut count, mut sum_dn, mut squares) = (0.0, 0.0, 0.0);
    for point in points[peak..].iter().filter(is_as_bright) {
        count += 1.0;
        sum_dn += point.mean_dn;
        squares += point.mean_se_dn.powi(2);
    }
    let signal_dn = sum_dn / count - at_peak.dark_mean_dn;

    let noise_of_all = at_peak.shot_variance_dn2() * signal_dn / at_peak.signal_dn();
    let left = match full.shot_variance_dn2() / noise_of_all {
        share if share.is_finite() => share.clamp(0.0, 1.0),
        _ => 0.0,
    };
    let short_dn = SHORT_OF_LEVEL * left * at_peak.total_variance_dn2.max(0.0).sqrt();
    let next = points.get(peak + 1).unwrap_or(at_peak);
    let dark_growth_dn = (next.dark_mean_dn - at_peak.dark_mean_dn) / 3.0_f64.sqrt();
    let means_dn = (squares.sqrt() / count).hypot(at_peak.dark_mean_se_dn);
    Measured::new(signal_dn, means_dn.hypot(short_dn).hypot(dark_growth_dn))
}
