//! Lens optimisation by least squares: Levenberg-Marquardt on where rays land, under solves, bounds and penalties, and a
//! global search on top of it.
//!
//! A [`Problem`] says which numbers of a lens may move and what is asked of it. Its residuals are the transverse
//! aberrations of rays that sample the stop, about the centroid of each field, and the violations of what a manufacturer
//! needs. Their derivatives are exact, so that each step solves the linearised problem.

mod chart;
mod levenberg;
mod merit;
mod problem;
mod search;
#[cfg(test)]
mod tests;

pub use chart::ChartError;
pub use levenberg::{Descent, LevenbergOptions, Stop, descend};
pub use merit::{Analysis, Violation};
pub use problem::{GlassChoice, ImagePlane, Limits, Problem, Solves};
pub use search::{Found, Kept, Search, SearchOptions, SearchState};
