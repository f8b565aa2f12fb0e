//! Warnings about fits whose points do not lie on their model.

use crate::emva::fits::{COMPRESSED, NamedFit, SHARED_NOISE, WORTH_A_WARNING};
use crate::emva::goodness::Verdict;
use crate::emva::warning::Warning;

/// The fits that are withdrawn, or widened by more than a hundredth of their number. Histograms, hot pixels that fill and
/// compressed numbers and noise that pixels share have warnings of their own, unless the fit departs by itself as well.
pub fn departures(fits: &[NamedFit]) -> Vec<Warning> {
    let is_worth_it = |fit: &&NamedFit| match fit.test.verdict {
        Verdict::Untested | Verdict::Holds | Verdict::Stated => false,
        Verdict::Withdrawn => true,
        Verdict::Widened => fit.model_share.is_none_or(|share| share > WORTH_A_WARNING),
    };
    let fills = |fit: &NamedFit| fit.name == "dark mean over time" && fit.cause.is_some();
    let is_named =
        |fit: &NamedFit| fit.cause.is_some_and(|cause| [SHARED_NOISE, COMPRESSED].contains(&cause));
    let has_own = |fit: &&NamedFit| fit.name == "histograms" || fills(fit) || is_named(fit);
    let warning = |fit: &NamedFit| Warning::FitDeparts {
        fit: fit.name,
        place: fit.place(),
        test: fit.test,
        model_share: fit.model_share,
        cause: fit.cause,
    };
    fits.iter().filter(|fit| !has_own(fit)).filter(is_worth_it).map(warning).collect()
}
