//! Inverse sensitivities: how exactly each quantity must be made for a given loss.
//!
//! Independent losses add up as squares, near enough, so that each of n quantities gets `loss / sqrt(n)`. Its tolerance is where
//! the merit has lost that much at the worse end, all else as drawn and compensators set.

use petzval_base::Cancelled;
use rayon::prelude::*;

use super::Study;

/// Tolerances are looked for up to this many times what they were.
const WIDEST: f64 = 1024.0;

/// And down to what they were over this.
const NARROWEST: f64 = 1e6;

/// Relative accuracy of a tolerance.
const ACCURACY: f64 = 1e-4;

/// The tolerance of a quantity that takes its share of a loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shared {
    /// Index of the perturbation.
    pub perturbation: usize,
    /// Its tolerance, in its unit.
    pub tolerance: f64,
    /// Whether even a tolerance 1024 times as wide as the given one costs less than the share: it is given as that wide.
    pub is_free: bool,
}

/// Tolerances that share a loss of the merit (in its unit, positive) evenly, starting from those of the study. `progress` is called after each;
/// its error ends the work.
pub fn inverse(
    study: &Study,
    loss: f64,
    progress: &(dyn Fn() -> Result<(), Cancelled> + Sync),
) -> Result<Vec<Shared>, Cancelled> {
    let perturbations = &study.tolerances().perturbations;
    let share = loss / (perturbations.len() as f64).sqrt();
    let one = |i: usize| {
        let given = perturbations[i].tolerance;
        // How much the worse end loses beyond the share.
        let beyond = |tolerance: f64| {
            let end = |sign: f64| {
                let mut off = vec![0.0; perturbations.len()];
                off[i] = sign * tolerance;
                let made = study.make(&off);
                made.map_or(f64::INFINITY, |m| study.better().loss(m.value, study.nominal().value))
            };
            end(1.0).max(end(-1.0)) - share
        };
        let shared = |tolerance: f64, is_free: bool| Shared { perturbation: i, tolerance, is_free };
        // Enclose it between a tolerance that costs less and one that costs more.
        let (mut low, mut high) = (given, given);
        let (mut at_low, mut at_high) = (beyond(given), 0.0);
        if at_low <= 0.0 {
            loop {
                if high >= WIDEST * given {
                    return shared(high, true);
                }
                high *= 2.0;
                at_high = beyond(high);
                if at_high > 0.0 {
                    break;
                }
                (low, at_low) = (high, at_high);
            }
        } else {
            at_high = at_high.max(at_low);
            while at_low > 0.0 && low > given / NARROWEST {
                (high, at_high) = (low, at_low);
                low *= 0.5;
                at_low = beyond(low);
            }
        }
        // Then a secant that keeps the enclosure, halving where it would creep.
        let mut side = 0;
        while high - low > ACCURACY * high {
            let secant = low - at_low * (high - low) / (at_high - at_low);
            let middle = if secant > low && secant < high { secant } else { 0.5 * (low + high) };
            let at = beyond(middle);
            if at > 0.0 {
                (high, at_high) = (middle, at);
                at_low *= if side == 1 { 0.5 } else { 1.0 };
                side = 1;
            } else {
                (low, at_low) = (middle, at);
                at_high *= if side == -1 { 0.5 } else { 1.0 };
                side = -1;
            }
            if at.abs() < ACCURACY * share {
                return shared(middle, false);
            }
        }
        shared(low, false)
    };
    let counted = |i: usize| {
        let found = one(i);
        progress()?;
        Ok(found)
    };
    (0..perturbations.len()).into_par_iter().map(counted).collect()
}
