//! Spatial frequency response from a slanted edge (e-SFR, ISO 12233).
//!
//! ```text
//! rows across the edge -> centroid of the derivative of each -> straight line
//!     -> distance of every pixel from the line -> means over quarters of a pixel: edge spread function
//!     -> derivative: line spread function -> window -> Fourier transform -> SFR
//! ```
//!
//! An edge that is inclined to the columns crosses them at every fraction of a pixel, so that its profile is sampled more finely than the
//! pixels are. The picture has to be linear in light. Any plane serves: the luminance of a developed picture, or every second row and column
//! of a raw frame, whose frequencies are then in cycles per two pixels.

mod edge;
mod error;
mod limits;
mod plane;
mod profile;
mod response;
#[cfg(test)]
mod tests;

use petzval_camera::render::Window;

use self::edge::{Line, Rows};
use self::profile::Profile;

pub use error::SfrError;
pub use plane::Plane;
pub use response::{FREQUENCY_STEP, Sfr};

/// What an edge says about the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeResponse {
    /// Response by frequency, across the edge.
    pub sfr: Sfr,
    /// Whether the edge stands, nearly along the columns; otherwise it lies, nearly along the rows.
    pub is_upright: bool,
    /// Inclination of the edge to the nearer axis of the pixels, degrees.
    pub angle_deg: f64,
    /// Root mean square distance of the edge from a straight line, row by row, pixels.
    pub roughness_px: f64,
    /// Root mean square deviation of the pixels from the profile, of the step: noise, and whatever is in the window beside one straight edge.
    pub scatter: f64,
    /// Values of the dark and of the bright side.
    pub levels: [f64; 2],
    /// How far the profile rises above the bright level, of the step.
    pub overshoot: f64,
    /// How far the profile falls below the dark level, of the step.
    pub undershoot: f64,
    /// The profile from dark, 0, to bright, 1: distance from the edge in pixels, and value.
    pub profile: Vec<(f64, f64)>,
}

/// Measures the edge in a window of a plane. It may be nearly vertical or nearly horizontal, and bright on either side; it must cross the
/// window from end to end and be inclined by at least a pixel over its length.
pub fn slanted_edge(plane: &Plane, window: &Window) -> Result<EdgeResponse, SfrError> {
    let rows = Rows::across_edge(plane, window)?;
    let line = Line::through(&rows)?;
    let profile = Profile::about(&rows, &line)?;
    let sfr = Sfr::of(&profile);
    let [dark, bright] = profile.levels();
    let step = bright - dark;
    let relative: Vec<(f64, f64)> = profile.points().map(|(at, v)| (at, (v - dark) / step)).collect();
    let (lowest, highest) =
        relative.iter().fold((0.0_f64, 1.0_f64), |(low, high), (_, v)| (low.min(*v), high.max(*v)));
    Ok(EdgeResponse {
        sfr,
        is_upright: rows.is_upright,
        scatter: profile.scatter / step,
        angle_deg: line.slope.atan().to_degrees(),
        roughness_px: line.roughness_px,
        levels: [dark, bright],
        overshoot: highest - 1.0,
        undershoot: -lowest,
        profile: relative,
    })
}
