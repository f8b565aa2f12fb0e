//! Finds slanted edges in a frame: square windows that one straight edge explains.

use petzval_camera::render::{Placement, Window};
use rayon::prelude::*;

use super::channel::Channel;
use super::region::Region;
use crate::sfr::{EdgeResponse, slanted_edge};

/// Side of a window, and the step from one window to the next, in values of the plane.
const SIDE: usize = 48;
const STEP: usize = 8;

/// Most regions that are returned.
const MOST: usize = 20;

/// Largest scatter about the profile, and largest distance of the rows' edges from a line in pixels: a corner, a curve or a texture has more.
const LARGEST_SCATTER: f64 = 0.05;
const LARGEST_ROUGHNESS_PX: f64 = 0.25;

/// Inclinations to the nearer axis, degrees: nearly along it an edge meets few fractions of a pixel, and borders of a picture's objects often lie so.
const ANGLES_DEG: std::ops::RangeInclusive<f64> = 3.0..=20.0;

/// How far the outer fifths of the profile may be from their means, of the step: a ramp or a second edge goes further.
const LEVEL_BAND: f64 = 0.1;

/// Shortest profile on either side of the edge, in values of the plane: shorter ones cut its blur off.
const LEAST_HALF: f64 = 12.0;

/// Regions of slanted edges that do not overlap, in the order of the frame, found in the first plane of a channel. Of overlapping windows
/// the one counts whose edge is nearest its middle, then the one with the least scatter.
pub fn find_edges(channel: &Channel) -> Vec<Region> {
    let Some(plane) = channel.planes.first() else { return Vec::new() };
    let steps = |whole: usize| (0..(whole + 1).saturating_sub(SIDE)).step_by(STEP);
    let [height, width] = plane.size();
    let windows: Vec<Window> = steps(height)
        .flat_map(|row| steps(width).map(move |col| Placement { row, col }))
        .map(|placement| Window { placement, height: SIDE, width: SIDE })
        .collect();
    let mut found: Vec<(EdgeResponse, Region)> = windows
        .par_iter()
        .filter_map(|window| {
            let response = slanted_edge(&plane.as_plane(), window).ok().filter(is_clean)?;
            Some((response, plane.region(window, channel.pitch)))
        })
        .collect();
    found.sort_by(|(a, _), (b, _)| {
        let half = |of: &EdgeResponse| of.profile.len();
        half(b).cmp(&half(a)).then(a.scatter.total_cmp(&b.scatter))
    });
    let mut kept: Vec<Region> = Vec::new();
    for (_, region) in found {
        if kept.len() < MOST && kept.iter().all(|other| !other.overlaps(&region)) {
            kept.push(region);
        }
    }
    kept.sort_by_key(|region| (region.row, region.col));
    kept
}

/// Whether a window holds one straight edge between two even sides.
fn is_clean(edge: &EdgeResponse) -> bool {
    let half = edge.profile.last().map_or(0.0, |(distance, _)| *distance);
    let outer = |(distance, _): &&(f64, f64)| distance.abs() > 0.6 * half;
    let is_even = edge.profile.iter().filter(outer).all(|(distance, value)| {
        let level = if *distance > 0.0 { 1.0 } else { 0.0 };
        (value - level).abs() < LEVEL_BAND
    });
    half > LEAST_HALF
        && is_even
        && ANGLES_DEG.contains(&edge.angle_deg.abs())
        && edge.scatter < LARGEST_SCATTER
        && edge.roughness_px < LARGEST_ROUGHNESS_PX
}
