//! What can be wrong with a call.

/// Largest side of a window, pixels.
pub(crate) const LARGEST_SIDE: usize = 16_384;

/// A wrong argument: its name, its value, and a hint.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StreetError {
    /// A window without pixels, or too large to hold.
    #[error(
        "a window of {height} rows and {width} columns (hint: both must lie between 1 and {})",
        LARGEST_SIDE
    )]
    Window {
        /// Rows of the window.
        height: usize,
        /// Columns of the window.
        width: usize,
    },
    /// A window so far from the sensor that its pixels have no place.
    #[error(
        "the window starts at row {row}, column {column} (hint: both must lie within 1,000,000 of the sensor)"
    )]
    FarWindow {
        /// First row of the window.
        row: i64,
        /// First column of the window.
        column: i64,
    },
    /// A number of samples that is zero or beyond use.
    #[error("{samples} samples per side of a pixel (hint: 1 to 16, usually 2 to 4)")]
    Samples {
        /// Samples per side of a pixel.
        samples: usize,
    },
    /// A table of the projection that is no monotone map from radius to angle.
    #[error("the projection's {name} {value} at entry {entry}: {hint}")]
    Projection {
        /// The wrong column of the table, or the wrong argument.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Its place in the table, from 0.
        entry: usize,
        /// What it must be.
        hint: &'static str,
    },
    /// A camera pose that is not finite.
    #[error("the camera's {name} is {value} (hint: every number of a pose must be finite)")]
    Pose {
        /// The wrong number.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}
