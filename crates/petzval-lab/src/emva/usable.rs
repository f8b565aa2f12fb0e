//! Rejects series from which no sensor can be measured.

use super::captures::{CaptureError, Captures};
use super::flags::{FlatFlags, GainFlags, Signal};
use super::measured::Unresolved;
use super::result::GainResult;

/// Standard errors above which a signal counts as light.
const LIGHT_SIGMAS: f64 = 5.0;

/// Excess of the dark mean over the flat mean of the same exposure time that a drift of the black level does not
/// explain, DN.
const SWAPPED_DN: f64 = 10.0;

/// Returns an error if there are flat and dark frames, but no point shows light below saturation. A series of dark frames alone
/// passes: it characterises the dark signal.
pub fn check_usable(
    captures: &Captures,
    gains: &[GainResult],
    flags: &[GainFlags],
) -> Result<(), CaptureError> {
    let list = || captures.list.clone();
    let channels = || gains.iter().flat_map(|g| &g.channels);
    let dark = flags.iter().flat_map(|gain| &gain.flats).filter_map(|flat| match flat.signal {
        Signal::None { signal_dn, standard_error_dn } => Some((signal_dn, standard_error_dn, flat)),
        _ => None,
    });
    let dark: Vec<(f64, f64, &FlatFlags)> = dark.collect();
    let with_signal: usize = gains.iter().filter_map(|g| g.channels.first()).map(|c| c.points.len()).sum();
    let points = dark.len() + with_signal;
    if points == 0 {
        return Ok(());
    }
    let lit = channels().flat_map(|c| &c.points).any(|p| p.signal_dn() > LIGHT_SIGMAS * p.signal_se_dn());
    let below = |least_dn: f64| {
        let is_below =
            |(signal, se, _): &&(f64, f64, &FlatFlags)| *signal < -(LIGHT_SIGMAS * se).max(least_dn);
        let found = dark.iter().filter(is_below).map(|(_, _, flat)| (flat.line, flat.label.clone()));
        let mut found: Vec<(u32, String)> = found.collect();
        found.sort_unstable();
        found
    };
    let all = below(0.0);
    let swapped = if !lit && all.len() == points { all } else { below(SWAPPED_DN) };
    if !swapped.is_empty() {
        return Err(CaptureError::Swapped { list: list(), swapped, points });
    }
    if !lit {
        return Err(CaptureError::NoLight { list: list(), points });
    }
    let full = |g: &GainResult| {
        g.channels.iter().all(|c| c.transfer.gain_dn_per_e.reason() == Some(Unresolved::AllSaturated))
    };
    if gains.iter().filter(|g| !g.channels.is_empty()).all(full) {
        let moved = flags.iter().map(|gain| gain.left_out.moved).sum();
        let clipped = flags.iter().map(|gain| gain.left_out.clipped).sum();
        Err(CaptureError::AllSaturated { list: list(), points, moved, clipped })
    } else {
        Ok(())
    }
}
