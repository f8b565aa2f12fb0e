//! Warnings about captures that are usable but odd.
//!
//! Warnings only report. They are made from `flags` and from the results, and no code that evaluates captures reads them.
//!
//! | file | holds |
//! |---|---|
//! | `of_gain` | warnings about the points of one gain |
//! | `of_series` | warnings about all gains together |
//! | `of_fit` | warnings about the fit to the histograms |
//! | `of_tests` | warnings about fits whose points do not lie on their model |
//! | `lines` | one line for each kind of warning |

mod lines;
mod of_fit;
mod of_gain;
mod of_series;
mod of_tests;

pub use lines::warning_lines;
pub(super) use of_fit::fit_warnings;
pub(super) use of_gain::gain_warnings;
pub(super) use of_series::series_warnings;
pub(super) use of_tests::departures;
