//! The report on the frames of one exposure time.

use super::merge::Agreement;

/// The frames of one exposure time of a position.
#[derive(Debug, Clone, PartialEq)]
pub struct ExposureReport {
    /// Exposure time, ms.
    pub exposure_ms: f64,
    /// Frames averaged.
    pub frames: usize,
    /// Dark frames averaged; 0 if the dark signal is the sensor model's.
    pub dark_frames: usize,
    /// Pixels that were saturated.
    pub saturated_pixels: usize,
    /// Mean of the frames' variance over the modelled one; `None` for one frame.
    pub variance_ratio: Option<f64>,
    /// This exposure beside all others; `None` if no bright pixel of it is usable in another.
    pub agreement: Option<Agreement>,
    /// Mean over the frames of the centroid of the source in the window, (row, column), px, and its standard error from the scatter of the
    /// frames. The centroid is that of all light of the mosaic ([`super::track`]).
    pub centroid_px: Option<([f64; 2], [f64; 2])>,
}
