//! Spatial frequency response from a slanted edge (e-SFR, ISO 12233).
//!
//! ```text
//! pixels -> the straight step that explains most -> path of the edge: a line or a curve, by all pixels
//!     -> light of both sides, and what changes across the region -> distance of every pixel from the path
//!     -> spline through all pixels: edge spread function -> defects left out, path refined -> no second step beyond the blur
//!     -> derivative: line spread function -> window -> Fourier transform -> SFR, with standard errors
//! ```
//!
//! An edge that is inclined to the columns crosses them at every fraction of a pixel, so that its profile is sampled more finely than the
//! pixels are. Every pixel counts at its own distance from the edge; no bins are made. The picture has to be linear in light. Any plane
//! serves: the luminance of a developed picture, or every second row and column of a raw frame, whose frequencies are then in cycles per two
//! pixels.

mod clipping;
mod dead_lines;
mod defects;
mod error;
mod estimate;
mod fit;
mod ghost;
mod light;
mod limits;
mod path;
mod place;
mod plane;
mod profile;
mod region;
mod response;
mod rounding;
mod screen;
mod search;
mod sides;
mod spline;
#[cfg(test)]
mod tests;

use petzval_camera::render::Window;

use self::fit::{Fit, fit_edge, guessed};
use self::limits::{LEAST_HALF, LEAST_SIDE};
use self::profile::Profile;
use self::region::{Pixels, Region};
use self::search::{Step, best_step};

pub use error::{SfrError, Side};
pub use estimate::Estimate;
pub use plane::Plane;
pub use response::{Crossing, FREQUENCY_STEP, Sfr};
pub(crate) use screen::may_be_edge;

/// Standard errors by which the step of an edge exceeds none.
const LEAST_STEP_SIGMAS: f64 = 8.0;

/// Points of the path that are returned.
const PATH_POINTS: usize = 33;

/// What an edge says about the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeResponse {
    /// Response by frequency, across the edge.
    pub sfr: Sfr,
    /// Whether the edge stands, nearly along the columns; otherwise it lies, nearly along the rows.
    pub is_upright: bool,
    /// Inclination of the edge to the nearer axis of the pixels in the middle of the window, degrees.
    pub angle_deg: Estimate,
    /// Largest gap between the distances at which pixels sample the edge, pixels: 0.71 at 45 degrees. The response is determined up to half of its
    /// inverse.
    pub gap_px: f64,
    /// Root mean square distance of the edge from its path, row by row, pixels.
    pub roughness_px: f64,
    /// Largest distance of the path from a straight line between its ends, pixels.
    pub sagitta_px: f64,
    /// Root mean square deviation of the pixels from the profile, of the step: noise, and whatever is in the window beside one edge.
    pub scatter: f64,
    /// Values of the dark and of the bright side, at the middle of the edge.
    pub levels: [Estimate; 2],
    /// How far the profile rises above the bright level, of the step.
    pub overshoot: Estimate,
    /// How far the profile falls below the dark level, of the step.
    pub undershoot: Estimate,
    /// Largest change of the light across the window, of the bright level, which is divided out; none if the light is even.
    pub light_fall: Option<f64>,
    /// Pixels that are left out as defects.
    pub left_out: usize,
    /// Step of the values, of the step of the edge, where a side has less noise than it: rounding is then not in the standard errors.
    pub coarse_step: Option<f64>,
    /// The profile from dark, 0, to bright, 1: distance from the edge in pixels, and value.
    pub profile: Vec<(f64, f64)>,
    /// The path of the edge: row and column of the window, in pixels from its upper left corner.
    pub path: Vec<[f64; 2]>,
}

/// Measures the edge in a window of a plane. It may have any direction, be bright on either side, be curved, and leave the window through a
/// corner. Light that falls across the window is divided out, and pixels that do not belong to the profile are left out.
pub fn slanted_edge(plane: &Plane, window: &Window) -> Result<EdgeResponse, SfrError> {
    let pixels = Pixels::of(plane, window)?;
    let guess = best_step(&pixels).ok_or(SfrError::NoEdge)?;
    let is_upright = guess.normal[0].abs() >= guess.normal[1].abs();
    let across = if is_upright { guess.normal[0] } else { guess.normal[1] };
    let region = Region::turned(&pixels, is_upright, across < 0.0);
    let profile = profile_of(&region, &guess)?;
    // First the ghost: light that is fitted to its step leaves its own side uneven.
    profile.check_ghost()?;
    profile.check_sides()?;
    clipping::check(&profile)?;
    let sfr = profile.sfr();
    profile.check_sampling(&sfr)?;
    let [undershoot, overshoot] = profile.beyond_levels();
    let (angle_deg, is_steep) = profile.angle_deg();
    let y_of = |k: usize| region.height as f64 * k as f64 / (PATH_POINTS - 1) as f64;
    let path = (0..PATH_POINTS)
        .map(y_of)
        .map(|y| [profile.path.at(y), y])
        .filter(|[x, _]| (0.0..=region.width as f64).contains(x))
        .map(|at| region.in_window(at))
        .collect();
    Ok(EdgeResponse {
        sfr,
        is_upright: is_upright != is_steep,
        angle_deg,
        gap_px: profile.gap_px(),
        roughness_px: profile.roughness_px(),
        sagitta_px: profile.path.sagitta(),
        scatter: profile.scatter,
        levels: profile.levels(),
        overshoot,
        undershoot,
        light_fall: profile.sides.fall,
        left_out: profile.left_out,
        coarse_step: rounding::coarse_step(&profile),
        profile: profile.points(),
        path,
    })
}

/// The profile across the edge near a guess.
fn profile_of<'a>(region: &'a Region, guess: &Step) -> Result<Profile<'a>, SfrError> {
    let fit = fit_edge(region, guess).ok_or(SfrError::NoEdge)?;
    let found =
        if fit.has_step(LEAST_STEP_SIGMAS) { profile_across(region, fit) } else { Err(SfrError::NoEdge) };
    // No edge is found in the pixels of several edges either. A straight edge well inside the window then has sides that are not even.
    found.map_err(|error| {
        let room = (2 * LEAST_HALF) as f64;
        let is_inside = |fit: &Fit| {
            let middle = fit.path.at(0.5 * region.height as f64);
            middle > room && middle < region.width as f64 - room
        };
        let straight = guessed(region, guess).filter(|fit| fit.has_step(LEAST_STEP_SIGMAS) && is_inside(fit));
        match straight.map(|fit| profile_across(region, fit)?.check_sides()) {
            Some(Err(uneven @ SfrError::Uneven { .. })) => uneven,
            _ => error,
        }
    })
}

/// The profile across a fitted edge, if the edge crosses enough rows and has enough pixels on both sides.
fn profile_across(region: &Region, fit: Fit) -> Result<Profile<'_>, SfrError> {
    let crossed = (0..region.height)
        .filter(|row| (0.0..region.width as f64).contains(&fit.path.at(*row as f64 + 0.5)))
        .count();
    if crossed < LEAST_SIDE.min(region.height) {
        return Err(SfrError::Small { along: crossed, across: region.width / 2 });
    }
    let profile = Profile::of(region, fit)?;
    if profile.half() < LEAST_HALF {
        return Err(SfrError::Small { along: crossed, across: profile.half() });
    }
    Ok(profile)
}
