//! Why an edge cannot be measured.

/// Why the window of an edge has no response.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SfrError {
    /// The window leaves the plane.
    #[error("the window leaves the picture")]
    Outside,
    /// The window is too small.
    #[error(
        "{along} rows along the edge and {across} pixels on either side of it: at least {} and {} are needed",
        super::limits::LEAST_ROWS,
        super::limits::LEAST_HALF
    )]
    Small {
        /// Rows.
        along: usize,
        /// Pixels between the edge and the nearer end of the window.
        across: usize,
    },
    /// There is no step from dark to bright.
    #[error("no edge: the two sides differ by less than their noise")]
    NoEdge,
    /// The inclination leaves too few or too many fractions of a pixel.
    #[error(
        "an edge at {deg:.1} degrees: it must be inclined by a pixel over its length, and by less than {} degrees",
        super::limits::STEEPEST_DEG
    )]
    Angle {
        /// Inclination, degrees.
        deg: f64,
    },
}
