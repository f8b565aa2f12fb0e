//! The MTF of a camera from slanted edges in a frame: of every colour of a raw frame, or of a picture in linear light.
//!
//! Frequencies are in cycles per pixel of the frame. A colour of a mosaic has every second pixel of every second row, so its plane alone
//! resolves 1/4 cycle per pixel of the frame. The slanted edge samples it more finely: it is measured up to 1/2 cycle per pixel.

mod channel;
mod find;
mod region;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use channel::{Channel, picture_channels, raw_channels};
pub use find::{Missed, SEARCHED_DEG, SIDE, find_edges, missed_edge};
pub use region::Region;

use crate::sfr::{EdgeResponse, Estimate, FREQUENCY_STEP, Sfr, SfrError, slanted_edge};

/// Nyquist's frequency of a frame, cycles per pixel.
pub const NYQUIST: f64 = 0.5;

/// Standard errors of the figures of an edge, from the noise of the pixels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StandardErrors {
    /// Of the inclination, degrees.
    pub angle_deg: f64,
    /// Of MTF50, cycles per pixel; none where there is no MTF50.
    pub mtf50_per_px: Option<f64>,
    /// Of the modulation at half of Nyquist's frequency.
    pub mtf_at_half_nyquist: f64,
    /// Of the levels.
    pub levels: [f64; 2],
    /// Of the overshoot, of the step.
    pub overshoot: f64,
    /// Of the undershoot, of the step.
    pub undershoot: f64,
    /// Of the modulation at every frequency.
    pub modulation: Vec<f64>,
}

/// The response of one channel at an edge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EdgeMtf {
    /// Channel: a colour, or `luminance`.
    pub channel: String,
    /// Whether the edge stands, nearly along the columns; otherwise it lies, nearly along the rows.
    pub is_upright: bool,
    /// Inclination of the edge to the nearer axis of the pixels, degrees, at least 0.
    pub angle_deg: f64,
    /// Largest gap between the distances at which pixels sample the edge, pixels of the frame: 0.71 at 45 degrees.
    pub gap_px: f64,
    /// The frequency at which half of the modulation is left, cycles per pixel; none if more is left at the highest frequency.
    pub mtf50_per_px: Option<f64>,
    /// Modulation at half of Nyquist's frequency, 1/4 cycle per pixel.
    pub mtf_at_half_nyquist: f64,
    /// Values of the dark and of the bright side.
    pub levels: [f64; 2],
    /// How far the profile rises above the bright level, of the step.
    pub overshoot: f64,
    /// How far the profile falls below the dark level, of the step.
    pub undershoot: f64,
    /// Standard errors of these figures, from the noise of the pixels.
    pub standard_errors: StandardErrors,
    /// Root mean square deviation of the pixels from the profile, of the step.
    pub scatter: f64,
    /// Largest distance of the edge from a straight line between its ends, pixels of the frame.
    pub sagitta_px: f64,
    /// Largest change of the light across the region, of the bright level, which is divided out; none if the light is even.
    pub light_fall: Option<f64>,
    /// Pixels that are left out as defects.
    pub left_out: usize,
    /// Step of the values, of the step of the edge, where a side has less noise than it: rounding is then not in the standard errors. It is for
    /// a warning, and no part of files.
    #[serde(skip)]
    pub coarse_step: Option<f64>,
    /// Frequencies, cycles per pixel.
    pub frequency_per_px: Vec<f64>,
    /// Modulation at these frequencies.
    pub modulation: Vec<f64>,
    /// The profile of the edge in the channel's first plane: distance from the edge, pixels of the frame, and value from 0, dark, to 1, bright.
    pub profile: Vec<(f64, f64)>,
    /// The path of the edge in the first plane: row and column of the frame.
    pub path: Vec<[f64; 2]>,
}

/// What a channel shows of a region, to look at.
#[derive(Clone, Debug, PartialEq)]
pub struct RegionPicture {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Values, row by row, 0 for the darkest and 1 for the brightest.
    pub values: Vec<f32>,
    /// Upper left and lower right corner: row and column of the frame.
    pub corners: [[f64; 2]; 2],
}

impl EdgeMtf {
    /// The frequency above which the pixels do not determine the response, cycles per pixel, where that is below the highest one.
    pub fn undetermined_above_per_px(&self) -> Option<f64> {
        let highest = self.frequency_per_px.last()?;
        Some(0.5 / self.gap_px).filter(|limit| limit < highest)
    }
}

impl RegionPicture {
    /// The first plane of a channel in a region; none if the region has none of its pixels.
    pub fn of(channel: &Channel, region: &Region) -> Option<Self> {
        let plane = channel.planes.first()?;
        let window = plane.window(region, channel.pitch);
        let (height, width) = (window.height, window.width);
        let (top, left) = (window.placement.row, window.placement.col);
        let values = plane.as_plane();
        let rows =
            (top..top + height).map(|row| values.values.get(row * values.width + left..)?.get(..width));
        let values: Vec<f32> = rows.collect::<Option<Vec<_>>>()?.concat();
        let (low, high) =
            values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let range = (high - low).max(f32::MIN_POSITIVE);
        let at = |row: usize, col: usize| plane.in_frame([row as f64, col as f64], channel.pitch);
        (!values.is_empty()).then(|| Self {
            height,
            width,
            values: values.iter().map(|v| (v - low) / range).collect(),
            corners: [at(top, left), at(top + height, left + width)],
        })
    }
}

/// Measures a channel at the edge in a region. Where a colour has several planes, as green has in a Bayer mosaic, figures are the means over
/// them.
pub fn edge_mtf(channel: &Channel, region: &Region) -> Result<EdgeMtf, SfrError> {
    let responses = channel.planes.iter().map(|plane| {
        slanted_edge(&plane.as_plane(), &plane.window(region, channel.pitch))
            .map_err(|error| error.of_frame(channel.pitch))
    });
    let responses: Vec<_> = responses.collect::<Result<_, _>>()?;
    let count = responses.len() as f64;
    let mean = |of: &dyn Fn(&EdgeResponse) -> f64| responses.iter().map(of).sum::<f64>() / count;
    // The noise of different planes is independent.
    let error = |of: &dyn Fn(&EdgeResponse) -> Estimate| {
        responses.iter().map(|r| of(r).standard_error.powi(2)).sum::<f64>().sqrt() / count
    };
    let sfr = Sfr::mean(&responses.iter().map(|r| &r.sfr).collect::<Vec<_>>()).ok_or(SfrError::NoEdge)?;
    let pitch = channel.pitch as f64;
    let (first, plane) = (&responses[0], &channel.planes[0]);
    let window = plane.window(region, channel.pitch).placement;
    let mtf50 = sfr.mtf50();
    let half_nyquist = 0.5 * NYQUIST * pitch;
    Ok(EdgeMtf {
        channel: channel.name.clone(),
        is_upright: first.is_upright,
        angle_deg: mean(&|r| r.angle_deg.value.abs()),
        gap_px: pitch * responses.iter().map(|r| r.gap_px).fold(0.0, f64::max),
        mtf50_per_px: mtf50.map(|at| at.frequency / pitch),
        mtf_at_half_nyquist: sfr.at(half_nyquist),
        levels: [0, 1].map(|side| mean(&|r| r.levels[side].value)),
        overshoot: mean(&|r| r.overshoot.value),
        undershoot: mean(&|r| r.undershoot.value),
        standard_errors: StandardErrors {
            angle_deg: error(&|r| r.angle_deg),
            mtf50_per_px: mtf50.map(|at| at.standard_error / pitch),
            mtf_at_half_nyquist: sfr.error_at(half_nyquist),
            levels: [0, 1].map(|side| error(&|r| r.levels[side])),
            overshoot: error(&|r| r.overshoot),
            undershoot: error(&|r| r.undershoot),
            modulation: sfr.standard_error,
        },
        scatter: mean(&|r| r.scatter),
        sagitta_px: pitch * mean(&|r| r.sagitta_px),
        light_fall: responses.iter().filter_map(|r| r.light_fall).max_by(f64::total_cmp),
        left_out: responses.iter().map(|r| r.left_out).sum(),
        coarse_step: responses.iter().filter_map(|r| r.coarse_step).max_by(f64::total_cmp),
        frequency_per_px: (0..sfr.modulation.len()).map(|k| k as f64 * FREQUENCY_STEP / pitch).collect(),
        modulation: sfr.modulation,
        profile: first.profile.iter().map(|(at, v)| (pitch * at, *v)).collect(),
        path: first
            .path
            .iter()
            .map(|[row, col]| {
                plane.in_frame([row + window.row as f64, col + window.col as f64], channel.pitch)
            })
            .collect(),
    })
}
