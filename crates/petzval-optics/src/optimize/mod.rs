//! Lens optimisation by least squares: Levenberg-Marquardt on where rays land, under solves, bounds and penalties, and a
//! global search on top of it.
//!
//! A [`Problem`] says which numbers of a lens may move, what is minimised and under which constraints. Its residuals are the
//! transverse aberrations of rays that sample the stop, about the centroid of each field, the distances of any further
//! [merits](crate::merit::Merit) from their targets ([`Goal`]), and the violated [constraints](crate::constraint). Their derivatives are exact, so that each step solves the linearised problem.

mod analysis;
mod descent_state;
mod levenberg;
mod problem;
mod search;
#[cfg(test)]
mod tests;

pub use analysis::Analysis;
pub use descent_state::{DescentProgress, DescentState, Stop};
pub use levenberg::{
    Descent, LevenbergOptions, SOFT_UM_PER_MM, descend, descend_by_spots, descend_in_focus, descend_on,
    descend_softly, descend_watched,
};
pub use problem::{Apertures, GlassChoice, Goal, Limits, Problem};
pub use search::{Found, Kept, Search, SearchOptions, SearchState};
