//! Why a scene cannot be rendered.

use petzval_base::Cancelled;

use super::limits::MAX_RADIUS;
use crate::psf::PsfError;

/// A window that leaves the sensor.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "{what} of {} x {} pixels at row {}, column {} leaves the sensor of {} x {}",
    size[1], size[0], at[0], at[1], sensor.1, sensor.0
)]
pub struct OffSensor {
    /// What the window shows.
    pub what: &'static str,
    /// Its rows and columns.
    pub size: [usize; 2],
    /// Row and column of its first pixel.
    pub at: [usize; 2],
    /// Rows and columns of the sensor.
    pub sensor: (usize, usize),
}

/// Why a scene cannot be rendered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// The PSFs are malformed.
    #[error(transparent)]
    Psf(#[from] PsfError),
    /// The work was cancelled between two tiles.
    #[error(transparent)]
    Stopped(#[from] Cancelled),
    /// Sensor size, pixel pitch or patch count is out of range.
    #[error(
        "render geometry {width} x {height} pixels of {pixel_um} um in {patch_rows}x{patch_cols} patches; \
         all must be positive, with at most 65536 pixels and 256 patches along a side"
    )]
    Geometry {
        /// Sensor rows.
        height: usize,
        /// Sensor columns.
        width: usize,
        /// Pixel pitch.
        pixel_um: f64,
        /// Patch rows.
        patch_rows: usize,
        /// Patch columns.
        patch_cols: usize,
    },
    /// The PSF covers more pixels than can be convolved.
    #[error(
        "the PSF grid reaches {radius} pixels; at most {MAX_RADIUS} are possible; hint: check pitch and pixel size, \
         or take fewer samples a pixel"
    )]
    PsfTooLarge {
        /// Reach in pixels.
        radius: f64,
    },
    /// A picture does not have three planes.
    #[error("the {what} has {channels} planes; 3 (red, green, blue) are needed")]
    Channels {
        /// Which picture.
        what: &'static str,
        /// Its planes.
        channels: usize,
    },
    /// The scene has no room for the PSF around the output.
    #[error(
        "the scene has {width} x {height} pixels; it needs more than {border} on each side of the output; \
         hint: use pad_replicate"
    )]
    SceneTooSmall {
        /// Scene rows.
        height: usize,
        /// Scene columns.
        width: usize,
        /// Kernel radius, pixels.
        border: usize,
    },
    /// The output leaves the sensor.
    #[error(transparent)]
    OffSensor(#[from] OffSensor),
    /// A buffer has another size than its partner.
    #[error("{what}: expected {expected}, got {got}")]
    Mismatch {
        /// What was compared.
        what: &'static str,
        /// Expected size.
        expected: String,
        /// Size found.
        got: String,
    },
}
