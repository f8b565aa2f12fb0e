//! Inverse sensitivities: how exactly each quantity must be made for a given loss.
//!
//! Independent losses add up as squares, near enough, so that each of n quantities gets `loss / sqrt(n)`. Its tolerance is the least
//! error, to either side, at which the merit has lost that much, all else as drawn and compensators set.
//!
//! A loss may fall again at larger errors, so the least error is sought outward, in steps of 26 %. The search starts at a quarter of the
//! given tolerance, and divides by four until the loss is below the share. A loss that exceeds the share between two steps alone, or nearer
//! to the drawing than the start, is not seen. A quantity takes some 20 evaluations to either side, one that hardly matters 38.

use petzval_base::Cancelled;
use rayon::prelude::*;

use super::Study;

/// Tolerances are looked for up to this many times what they were.
const WIDEST: f64 = 1024.0;

/// And down to what they were over this.
const NARROWEST: f64 = 1e6;

/// The search for a start goes inward by this ratio.
const INWARD: f64 = 4.0;

/// From the start it goes outward by the cube root of 2: three steps to a doubling.
const OUTWARD: f64 = 1.259_921_049_894_873_2;

/// Relative accuracy of a tolerance.
const ACCURACY: f64 = 1e-4;

/// The tolerance of a quantity that takes its share of a loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shared {
    /// Index of the perturbation.
    pub perturbation: usize,
    /// Its tolerance, in its unit: at the resolution of the search, errors up to it cost no more than the share. Where even a millionth of the
    /// given one costs more, about that millionth.
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
                // A lens that cannot be built, or has no image, has lost all.
                let made = study.build(&off);
                made.map_or(f64::INFINITY, |m| study.better().loss(m.value, study.nominal().value))
            };
            end(1.0).max(end(-1.0)) - share
        };
        let found = least_beyond(given, share, beyond);
        Shared { perturbation: i, tolerance: found.unwrap_or(WIDEST * given), is_free: found.is_none() }
    };
    let counted = |i: usize| {
        let found = one(i);
        progress()?;
        Ok(found)
    };
    (0..perturbations.len()).into_par_iter().map(counted).collect()
}

/// The least positive error at which `beyond`, the loss less its `share`, is 0, sought from near the tolerance `given` as the module says.
/// `None` if no error up to [`WIDEST`] times as wide costs more than the share.
fn least_beyond(given: f64, share: f64, beyond: impl Fn(f64) -> f64) -> Option<f64> {
    // Start at an error that costs less than the share.
    let mut low = given / INWARD;
    let mut at_low = beyond(low);
    while at_low > 0.0 {
        if low <= given / NARROWEST {
            return Some(low);
        }
        low /= INWARD;
        at_low = beyond(low);
    }
    // Go outward to the first error that costs more: all errors looked at before cost less.
    let widest = WIDEST * given;
    let (mut high, mut at_high) = (low, at_low);
    while at_high <= 0.0 {
        if high >= widest {
            return None;
        }
        (low, at_low) = (high, at_high);
        high = (high * OUTWARD).min(widest);
        at_high = beyond(high);
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
            return Some(middle);
        }
    }
    Some(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// It rises to 1.2 at an error of 5, falls to 0.8 at 7 and rises again: it is 1 at 4.1667, 6 and 8.
    fn dips(error: f64) -> f64 {
        if error < 5.0 { 0.24 * error } else { 0.8 + 0.2 * (error - 7.0).abs() }
    }

    #[test]
    fn a_loss_that_dips_gives_its_first_crossing() {
        // Twice 3 is the second crossing; a quarter of 20 lies beyond the first.
        for given in [0.01, 1.0, 3.0, 6.5, 20.0, 1e4] {
            let found = least_beyond(given, 1.0, |error| dips(error) - 1.0).unwrap();
            assert!((found - 1.0 / 0.24).abs() < 1e-3, "{given}: {found}");
        }
    }

    #[test]
    fn an_error_without_an_image_counts_as_a_loss() {
        let lost = |error: f64| if error < 2.5 { 0.1 * error - 1.0 } else { f64::INFINITY };
        let found = least_beyond(1.0, 1.0, lost).unwrap();
        assert!((found - 2.5).abs() < 1e-3, "{found}");
    }

    #[test]
    fn a_search_ends_at_its_widest_and_at_its_narrowest() {
        assert!(least_beyond(1.0, 1.0, |error| error / 1025.0 - 1.0).is_none());
        let found = least_beyond(1.0, 1.0, |error| error / 1023.0 - 1.0).unwrap();
        assert!((found / 1023.0 - 1.0).abs() < 1e-3, "{found}");
        let narrow = least_beyond(1.0, 1.0, |_| 1.0).unwrap();
        assert!(narrow <= 1.0 / NARROWEST && narrow > 0.0, "{narrow}");
    }
}
