//! Warnings about fits whose points do not lie on their model.

use crate::emva::fits::NamedFit;
use crate::emva::goodness::Verdict;
use crate::emva::warning::Warning;

/// Share of a number from which on the error that a departure adds is worth a warning: every real lamp drifts by less.
const WORTH_A_WARNING: f64 = 0.01;

/// The fits that are withdrawn, or widened by more than a hundredth of their number. Histograms and hot pixels that fill have warnings of their
/// own.
pub fn departures(fits: &[NamedFit]) -> Vec<Warning> {
    let is_worth_it = |fit: &&NamedFit| match fit.test.verdict {
        Verdict::Untested | Verdict::Holds | Verdict::Stated => false,
        Verdict::Withdrawn => true,
        Verdict::Widened => fit.model_share.is_none_or(|share| share > WORTH_A_WARNING),
    };
    let fills = |fit: &NamedFit| fit.name == "dark mean over time" && fit.cause.is_some();
    let has_own = |fit: &&NamedFit| fit.name == "histograms" || fills(fit);
    let warning = |fit: &NamedFit| Warning::FitDeparts {
        fit: fit.name,
        place: fit.place(),
        test: fit.test,
        model_share: fit.model_share,
        cause: fit.cause,
    };
    fits.iter().filter(|fit| !has_own(fit)).filter(is_worth_it).map(warning).collect()
}
