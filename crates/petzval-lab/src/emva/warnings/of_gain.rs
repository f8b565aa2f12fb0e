//! Warnings about the points of one gain.

use crate::emva::captures::milliseconds;
use crate::emva::dark::{DarkPoint, DarkSeries};
use crate::emva::flags::{FlatFlags, FrameFlags, GainFlags, Signal, StackFlags, StackUse};
use crate::emva::result::{ChannelResult, GainResult};
use crate::emva::transfer_point::TransferPoint;
use crate::emva::warning::Warning;

/// Least number of points for a straight line.
const LEAST_POINTS: usize = 3;

/// Largest drift of a dark mean without a warning, DN per unit of linear gain.
const DARK_DRIFT_DN: f64 = 0.05;

/// The warnings from the flags of one gain and from its dark series.
pub fn gain_warnings(gain: &GainResult, flags: &GainFlags) -> Vec<Warning> {
    let linear_gain = gain.linear_gain;
    let mut warnings: Vec<Warning> = flags.frames.iter().flat_map(of_frames).collect();
    let defects = flags.dark_defects;
    if defects.pixels > 0 {
        let (pixels, mean_dn) = (defects.pixels, -defects.mean_dn);
        warnings.push(Warning::DarkDefects { linear_gain, pixels, mean_dn });
    }
    if let Some(levels_dn) = &flags.tile_levels_dn {
        let (cfa, levels_dn) = (flags.cfa.clone(), levels_dn.clone());
        warnings.push(Warning::BlackLevelsOfColours { linear_gain, cfa, levels_dn });
    }
    warnings.extend(dark_not_linear(linear_gain, &gain.dark));
    warnings.extend(flags.flats.iter().filter_map(of_signal));
    warnings.extend(other_mosaic(gain, flags));
    let points = flags.with_signal().count();
    if (1..LEAST_POINTS).contains(&points) {
        warnings.push(Warning::TooFewPoints { linear_gain, points });
    }
    warnings.extend(gain.channels.iter().filter_map(|channel| shared_noise(linear_gain, channel)));
    warnings.extend(gain.channels.iter().filter_map(|channel| compressed(linear_gain, channel)));
    warnings.extend(gain.channels.iter().filter_map(|channel| row_flicker(linear_gain, channel)));
    warnings.extend(flags.stacks.iter().filter_map(of_stack));
    let full = flags.flats.iter().filter(|flat| flat.is_saturated).count();
    if full > 0 {
        warnings.push(Warning::Saturated { linear_gain, points: full, of: points });
    }
    let darker = flags.flats.iter().filter(|flat| flat.is_darker);
    warnings.extend(darker.map(|flat| Warning::NotMonotonic { point: flat.label.clone() }));
    warnings
}

/// Warnings from the frames of one point alone.
fn of_frames(flags: &FrameFlags) -> Vec<Warning> {
    let point = || flags.label.clone();
    let clipped = flags.clipped_at_zero.map(|share| Warning::ClippedAtZero { point: point(), share });
    let clamped = flags.clamped.map(|clamp| Warning::Clamped {
        point: point(),
        level_dn: clamp.level_dn,
        share: clamp.share,
    });
    let flicker = flags.flicker.map(|f| Warning::Flicker {
        point: point(),
        difference_dn: f.difference_dn,
        standard_error_dn: f.standard_error_dn,
    });
    let moved = flags.moved.map(|m| Warning::Moved {
        point: point(),
        frame: m.frame,
        difference_dn: m.difference_dn,
        standard_error_dn: m.standard_error_dn,
    });
    let leak = flags.light_leak_dn.map(|difference_dn| Warning::LightLeak { point: point(), difference_dn });
    let uneven = flags.uneven_percent.map(|percent| Warning::NotUniform { point: point(), percent });
    [clipped, clamped, flicker, moved, leak, uneven].into_iter().flatten().collect()
}

/// Colour filters of another mosaic, by the point that shows them most. With stacks the test of the PRNU names them.
fn other_mosaic(gain: &GainResult, flags: &GainFlags) -> Option<Warning> {
    let percent = flags.frames.iter().filter_map(|f| f.other_filters_percent).reduce(f64::max)?;
    let has_stacks = gain.channels.iter().any(|channel| channel.spatial.is_some());
    (!has_stacks).then_some(Warning::OtherMosaic { linear_gain: gain.linear_gain, percent })
}

/// A flat point that is not used because of its dark frames.
fn of_signal(flat: &FlatFlags) -> Option<Warning> {
    let point = flat.label.clone();
    match flat.signal {
        Signal::Above => None,
        Signal::NoDark => Some(Warning::NoDark { point }),
        Signal::None { signal_dn, standard_error_dn } => {
            Some(Warning::NoSignal { point, signal_dn, standard_error_dn })
        }
    }
}

/// Noise that pixels or frames of one colour share.
fn shared_noise(linear_gain: f64, channel: &ChannelResult) -> Option<Warning> {
    let (colour, found) = (channel.colour, channel.transfer.shared_noise?);
    Some(Warning::SharedNoise { linear_gain, colour, found })
}

/// Digital numbers of one colour that are compressed.
fn compressed(linear_gain: f64, channel: &ChannelResult) -> Option<Warning> {
    let (colour, found) = (channel.colour, channel.transfer.compression?);
    let gain = channel.transfer.gain_dn_per_e.value();
    let percent = gain.map(|gain| 100.0 * found.gain_error_dn_per_e / gain);
    Some(Warning::Compressed { linear_gain, colour, found, percent })
}

/// Flat points of one colour whose rows flicker.
fn row_flicker(linear_gain: f64, channel: &ChannelResult) -> Option<Warning> {
    let colour = channel.colour;
    // The variance above dark with the flicker: without it nothing may be left.
    let with_flicker = |p: &TransferPoint| (p.variance_dn2 - p.dark_variance_dn2).max(p.row_flicker_dn2);
    let of_point = |p: &TransferPoint| 100.0 * p.row_flicker_dn2 / with_flicker(p);
    let shares = channel.points.iter().filter(|p| p.row_flicker_dn2 > 0.0).map(of_point);
    let (points, percent) =
        shares.fold((0, 0.0), |(points, most), share| (points + 1, f64::max(most, share)));
    (points > 0).then_some(Warning::RowFlicker { linear_gain, colour, points, percent })
}

/// A flat stack that is not evaluated.
fn of_stack(flags: &StackFlags) -> Option<Warning> {
    let point = flags.label.clone();
    match flags.stack_use {
        StackUse::Evaluated => None,
        StackUse::NoDarkStack => Some(Warning::LoneStack { point }),
        StackUse::Surplus => Some(Warning::MoreStacks { point }),
    }
}

/// The dark mean that is furthest off the straight line over exposure time, if by more than six standard errors and drift.
fn dark_not_linear(linear_gain: f64, dark: &DarkSeries) -> Option<Warning> {
    let (slope, intercept) = (dark.mean.slope.value()?, dark.mean.intercept.value()?);
    let off = |p: &DarkPoint| p.mean_dn - (slope * p.exposure_s + intercept);
    let worst = dark.points.iter().max_by(|a, b| off(a).abs().total_cmp(&off(b).abs()))?;
    let chi2: f64 = dark.points.iter().map(|p| (off(p) / p.mean_se_dn).powi(2)).sum();
    let allowed_dn = 6.0 * worst.mean_se_dn + DARK_DRIFT_DN * linear_gain.max(1.0);
    (off(worst).abs() > allowed_dn).then(|| Warning::DarkNotLinear {
        linear_gain,
        exposure_ms: milliseconds(worst.exposure_s),
        off_dn: off(worst),
        reduced_chi2: chi2 / (dark.points.len() as f64 - 2.0),
    })
}
