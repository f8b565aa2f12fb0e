//! What an edge has to be for its response to be measured.

/// Fewest rows along an edge.
pub const LEAST_ROWS: usize = 16;

/// Fewest pixels on either side of the edge.
pub const LEAST_HALF: usize = 6;

/// Largest inclination of an edge, degrees: where it is steeper it is measured along the other axis.
pub const STEEPEST_DEG: f64 = 40.0;
