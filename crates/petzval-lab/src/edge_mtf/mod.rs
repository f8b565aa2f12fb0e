//! The MTF of a camera from slanted edges in a frame: of every colour of a raw frame, or of a picture in linear light.
//!
//! Frequencies are in cycles per pixel of the frame. A colour of a mosaic has every second pixel of every second row, and its planes
//! are measured with that spacing: the edge itself samples them finely enough for frequencies up to 1/2 cycle per pixel of the frame,
//! beyond the 1/4 that the plane alone resolves.

mod channel;
mod find;
mod region;

use serde::{Deserialize, Serialize};

pub use channel::{Channel, picture_channels, raw_channels};
pub use find::find_edges;
pub use region::Region;

use crate::sfr::{FREQUENCY_STEP, Sfr, SfrError, slanted_edge};

/// Nyquist's frequency of a frame, cycles per pixel.
pub const NYQUIST: f64 = 0.5;

/// The response of one channel at an edge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeMtf {
    /// Channel: a colour, or `luminance`.
    pub channel: String,
    /// Whether the edge stands, nearly along the columns; otherwise it lies, nearly along the rows.
    pub is_upright: bool,
    /// Inclination of the edge to the nearer axis of the pixels, degrees, at least 0.
    pub angle_deg: f64,
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
    /// Root mean square deviation of the pixels from the profile, of the step.
    pub scatter: f64,
    /// Frequencies, cycles per pixel.
    pub frequency_per_px: Vec<f64>,
    /// Modulation at these frequencies.
    pub modulation: Vec<f64>,
}

/// Measures a channel at the edge in a region. Where a colour has several planes, as green has in a Bayer mosaic, figures are the means over
/// them.
pub fn edge_mtf(channel: &Channel, region: &Region) -> Result<EdgeMtf, SfrError> {
    let responses: Vec<_> = channel
        .planes
        .iter()
        .map(|plane| slanted_edge(&plane.as_plane(), &plane.window(region, channel.pitch)))
        .collect::<Result<_, _>>()?;
    let mean = |of: &dyn Fn(&crate::sfr::EdgeResponse) -> f64| {
        responses.iter().map(of).sum::<f64>() / responses.len() as f64
    };
    let sfr = Sfr::mean(&responses.iter().map(|r| &r.sfr).collect::<Vec<_>>()).ok_or(SfrError::NoEdge)?;
    let pitch = channel.pitch as f64;
    Ok(EdgeMtf {
        channel: channel.name.clone(),
        is_upright: responses[0].is_upright,
        angle_deg: mean(&|r| r.angle_deg.abs()),
        mtf50_per_px: sfr.mtf50().map(|frequency| frequency / pitch),
        mtf_at_half_nyquist: sfr.at(0.5 * NYQUIST * pitch),
        levels: [mean(&|r| r.levels[0]), mean(&|r| r.levels[1])],
        overshoot: mean(&|r| r.overshoot),
        undershoot: mean(&|r| r.undershoot),
        scatter: mean(&|r| r.scatter),
        frequency_per_px: (0..sfr.modulation.len()).map(|k| k as f64 * FREQUENCY_STEP / pitch).collect(),
        modulation: sfr.modulation,
    })
}
