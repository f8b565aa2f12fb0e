//! A side that ends at one value, because the light beyond it was cut off.

use super::error::{SfrError, Side};
use super::profile::Profile;
use petzval_base::statistics::median;

/// Share of the pixels of a side at its extreme value from which it may be clipped.
const LEAST_SHARE: f64 = 0.5;

/// Noise of the blurred zone, of the step and in steps of the values, from which a side without noise is clipped.
const LEAST_NOISE: f64 = 0.003;
const NOISE_STEPS: f64 = 1.5;

/// Share of the pixels of a side at its extreme value from which noise is cut off there, and the largest change of the level by it, of the step and
/// in steps of the values.
const LEAST_CUT: f64 = 0.1;
const LARGEST_SHIFT: f64 = 0.005;
const SHIFT_STEPS: f64 = 0.5;

/// Pixels by which an edge leaves its path for many rows, from which pixels that differ from the profile do so for that reason.
const LEAST_DRIFT_PX: f64 = 0.01;

// Without noise an end is clipped if it stops short of its level, because a blur comes near its level on both sides.
/// Where the profile is read, pixels inside the first pixel of the extreme value.
const INSIDE_PX: f64 = 0.3;
/// Least gap to the level there, as a share of the step.
const LEAST_LACK: f64 = 0.01;
/// Least gap to the level there, in steps of the values.
const LACK_STEPS: f64 = 8.0;
/// Values so near to the extreme one show their steps, of the step of the edge.
const NEAR: f64 = 0.1;
/// Least gap of the other side at the same distance from the edge, as a share of the step.
const OTHER_LACK: f64 = 0.02;

/// The end of one side.
struct End {
    /// Share of the pixels beyond the blur at the extreme value.
    share: f64,
    /// Distance of the mean of these pixels from their median, away from the extreme value, of the step.
    shift: f64,
    /// Difference to the next value, of the step.
    gap: f64,
    /// Least difference between values near the extreme one, of the step: where the light is cut off, the next value may be far from it.
    least_gap: f64,
    /// Distance from the edge of the last pixel of another value.
    last_px: f64,
}

/// Refuses an edge one of whose sides is clipped: its level, and the shape of the profile below it, are unknown. Where neither side has noise, what
/// differs from the profile may be no noise either: the edge is then refused because it leaves its path.
pub fn check(profile: &Profile) -> Result<(), SfrError> {
    let ends =
        [(Side::Dark, -1.0), (Side::Bright, 1.0)].map(|(side, sign)| (side, sign, End::of(profile, sign)));
    let has_no_noise = ends.iter().all(|(.., end)| end.share >= LEAST_SHARE);
    for (side, sign, end) in ends {
        let noise = profile.noise_of_blur(sign);
        let is_noisy = noise > LEAST_NOISE && noise > NOISE_STEPS * end.gap;
        let least = LEAST_LACK.max(LACK_STEPS * end.least_gap);
        let is_abrupt = || {
            // The end lies between the last pixel of another value and the next one: up to a gap beyond it.
            lack(profile, sign, end.last_px - INSIDE_PX) > least
                && lack(profile, -sign, end.last_px + profile.gap_px()) > OTHER_LACK.max(least)
        };
        // Noise of which less than half is cut off keeps its median, and its mean moves.
        let is_moved = || end.share > LEAST_CUT && end.shift > LARGEST_SHIFT + SHIFT_STEPS * end.gap;
        let is_clipped =
            if end.share < LEAST_SHARE { is_noisy && is_moved() } else { is_noisy || is_abrupt() };
        if is_clipped && has_no_noise && !is_abrupt() {
            let drift_px = profile.drift_px();
            if drift_px > LEAST_DRIFT_PX {
                return Err(SfrError::OffPath { drift_px });
            }
        }
        if is_clipped {
            return Err(SfrError::Clipped { side, share: end.share });
        }
    }
    Ok(())
}

impl End {
    fn of(profile: &Profile, sign: f64) -> Self {
        let even: Vec<f64> = profile.even_pixels(sign).map(|v| sign * v).collect();
        let extreme = even.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let count = even.len().max(1) as f64;
        let share = even.iter().filter(|v| **v >= extreme).count() as f64 / count;
        let mean = even.iter().sum::<f64>() / count;
        let shift = (median(even.iter().copied()) - mean) / profile.step();
        let mut next = f64::NEG_INFINITY;
        let mut last_px = 0.0_f64;
        for (distance, value) in profile.values() {
            if sign * value < extreme {
                next = next.max(sign * value);
                last_px = last_px.max(sign * distance);
            }
        }
        let near = extreme - NEAR * profile.step();
        let signed = profile.values().map(|(_, value)| sign * value);
        let mut close: Vec<f64> = signed.filter(|v| (near..=extreme).contains(v)).collect();
        close.sort_by(f64::total_cmp);
        let differences = close.windows(2).map(|pair| pair[1] - pair[0]).filter(|d| *d > 0.0);
        let least_gap = differences.fold(extreme - next, f64::min) / profile.step();
        Self { share, shift, gap: (extreme - next) / profile.step(), least_gap, last_px }
    }
}

/// What the profile lacks of the level of the bright side (`sign` 1) or the dark one (-1) so far on that side of the edge, of the step.
fn lack(profile: &Profile, sign: f64, px: f64) -> f64 {
    let level = if sign > 0.0 { 1.0 } else { 0.0 };
    profile.spline.at(sign * px).map_or(0.0, |share| (level - share).abs())
}
