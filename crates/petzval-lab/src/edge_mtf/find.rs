//! Finds slanted edges in a frame: square windows that one straight edge explains.

use petzval_base::{Cancel, Cancelled};
use petzval_camera::render::{Placement, Window};
use rayon::prelude::*;

use super::channel::Channel;
use super::region::Region;
use crate::sfr::{EdgeResponse, SfrError, may_be_edge, slanted_edge};

/// Side of a window, and the step from one window to the next, in values of the plane.
pub const SIDE: usize = 48;
const STEP: usize = 8;

/// Most regions that are returned.
const MOST: usize = 20;

/// Largest scatter about the profile, and largest distance of the rows' edges from a line in pixels: a corner, a curve or a texture has more.
const LARGEST_SCATTER: f64 = 0.05;
const LARGEST_ROUGHNESS_PX: f64 = 0.25;

/// Largest distance of the edge's path from a straight line, pixels.
const LARGEST_SAGITTA_PX: f64 = 1.0;

/// Inclinations to the nearer axis, degrees: nearly along it an edge meets few fractions of a pixel, and borders of a picture's objects often lie so.
pub const SEARCHED_DEG: std::ops::RangeInclusive<f64> = 3.0..=20.0;

/// How far the outer fifths of the profile may be from their means, of the step: a ramp or a second edge goes further.
const LEVEL_BAND: f64 = 0.1;

/// Shortest profile on either side of the edge, in values of the plane: shorter ones cut its blur off.
const LEAST_HALF: f64 = 12.0;

/// Windows that are measured at a time.
const AT_A_TIME: usize = 16;

/// Regions of slanted edges that do not overlap, in the order of the frame, found in the first plane of a channel. Of overlapping windows
/// the one counts whose edge is nearest its middle. Ends with [`Cancelled`] before the next window once `cancel` is set.
pub fn find_edges(channel: &Channel, cancel: &Cancel) -> Result<Vec<Region>, Cancelled> {
    let Some(plane) = channel.planes.first() else { return Ok(Vec::new()) };
    let steps = |whole: usize| (0..(whole + 1).saturating_sub(SIDE)).step_by(STEP);
    let [height, width] = plane.size();
    let windows: Vec<Window> = steps(height)
        .flat_map(|row| steps(width).map(move |col| Placement { row, col }))
        .map(|placement| Window { placement, height: SIDE, width: SIDE })
        .collect();
    // A quick look leaves few windows to be measured, those with an edge near their middle first.
    let look = |window: Window| -> Result<Option<(f64, Window)>, Cancelled> {
        cancel.check()?;
        let values = plane.as_plane();
        let nearest = may_be_edge(&values, &window, &SEARCHED_DEG, LEAST_HALF, LARGEST_ROUGHNESS_PX);
        Ok(nearest.map(|nearest| (nearest, window)))
    };
    let likely = windows.into_par_iter().filter_map(|window| look(window).transpose());
    let mut likely: Vec<(f64, Window)> = likely.collect::<Result<_, Cancelled>>()?;
    likely.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<Region> = Vec::new();
    let is_free = |kept: &[Region], region: &Region| kept.iter().all(|other| !other.overlaps(region));
    let mut left = likely.into_iter().map(|(_, window)| window).peekable();
    while kept.len() < MOST && left.peek().is_some() {
        let free = left.by_ref().filter(|window| is_free(&kept, &plane.region(window, channel.pitch)));
        let some: Vec<Window> = free.take(AT_A_TIME).collect();
        let measure = |window: &Window| -> Result<Option<Region>, Cancelled> {
            cancel.check()?;
            let is_clean = slanted_edge(&plane.as_plane(), window).is_ok_and(|edge| is_clean(&edge));
            Ok(is_clean.then(|| plane.region(window, channel.pitch)))
        };
        let clean = some.par_iter().filter_map(|window| measure(window).transpose());
        for region in clean.collect::<Result<Vec<Region>, Cancelled>>()? {
            if kept.len() < MOST && is_free(&kept, &region) {
                kept.push(region);
            }
        }
    }
    kept.sort_by_key(|region| (region.row, region.col));
    Ok(kept)
}

/// Step of the windows in which a missed edge is looked for, and how many of them are measured.
const MISSED_STEP: usize = 16;
const MISSED: usize = 16;

/// An edge that [`find_edges`] does not return.
#[derive(Clone, Debug, PartialEq)]
pub enum Missed {
    /// Its inclination is not among those that are searched; its region can be measured.
    Angle {
        /// Where it is.
        region: Region,
        /// Inclination to the nearer axis of the pixels, degrees.
        deg: f64,
    },
    /// One side is clipped, or the pixels sample it too coarsely.
    NoResponse {
        /// Where it is.
        region: Region,
        /// Why.
        error: SfrError,
    },
}

/// Why an edge is missed, of the windows with the most contrast in the first plane of a channel; `None` if none of them holds an edge. Ends with
/// [`Cancelled`] before the next window once `cancel` is set.
pub fn missed_edge(channel: &Channel, cancel: &Cancel) -> Result<Option<Missed>, Cancelled> {
    let Some(plane) = channel.planes.first() else { return Ok(None) };
    let values = plane.as_plane();
    let [height, width] = plane.size();
    let steps = |whole: usize| (0..(whole + 1).saturating_sub(SIDE)).step_by(MISSED_STEP);
    let variance = |row: usize, col: usize| {
        let of = |k: i32| {
            let rows = (row..row + SIDE).map(|r| &values.values[r * values.width + col..][..SIDE]);
            rows.flatten().map(|v| f64::from(*v).powi(k)).sum::<f64>() / (SIDE * SIDE) as f64
        };
        of(2) - of(1).powi(2)
    };
    let mut windows: Vec<(f64, Placement)> = Vec::new();
    for row in steps(height) {
        cancel.check()?;
        windows.extend(steps(width).map(|col| (variance(row, col), Placement { row, col })));
    }
    windows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let reason = |(_, placement): &(f64, Placement)| {
        let window = Window { placement: *placement, height: SIDE, width: SIDE };
        let region = plane.region(&window, channel.pitch);
        match slanted_edge(&values, &window) {
            Ok(edge) => {
                let deg = edge.angle_deg.value.abs();
                (!SEARCHED_DEG.contains(&deg)).then_some(Missed::Angle { region, deg })
            }
            Err(
                error @ (SfrError::Clipped { .. }
                | SfrError::OffPath { .. }
                | SfrError::Angle { .. }
                | SfrError::Ghost { .. }),
            ) => Some(Missed::NoResponse { region, error: error.of_frame(channel.pitch) }),
            Err(_) => None,
        }
    };
    for window in windows.iter().take(MISSED) {
        cancel.check()?;
        if let Some(missed) = reason(window) {
            return Ok(Some(missed));
        }
    }
    Ok(None)
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
        && SEARCHED_DEG.contains(&edge.angle_deg.value.abs())
        && edge.scatter < LARGEST_SCATTER
        && edge.roughness_px < LARGEST_ROUGHNESS_PX
        && edge.sagitta_px < LARGEST_SAGITTA_PX
}
