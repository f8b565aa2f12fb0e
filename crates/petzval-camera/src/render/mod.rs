//! From a scene to the light on the sensor: the PSF of its place in the field spreads the light of each point.
//!
//! The PSF rotates and changes over the image, so the sensor is divided into patches. Each patch has one kernel: the PSF at
//! the patch centre, rotated to its azimuth and integrated over pixels. The picture blends the convolutions of neighbouring
//! patches with weights that sum to one, so there are no seams and a flat field stays flat:
//!
//! `out(x) = sum_p w_p(x) (K_p * scene)(x)`.
//!
//! [`render`] convolves with FFTs, tile by tile. [`render_direct`] is the readable reference, [`render_adjoint`] the exact
//! transpose. Relative illumination is a separate factor, see [`illumination_map`]. Distortion is not applied: each place
//! shows the scene point whose ideal image lies there, with the PSF of that field.

mod adjoint;
mod convolve;
mod direct;
mod geometry;
mod illumination;
mod kernel;
mod spectrum;

pub use adjoint::{RenderGradient, render_adjoint, render_adjoint_kernels};
pub use convolve::render_kernels;
pub use direct::render_direct;
pub use geometry::{MAX_PATCHES, MAX_SIDE, Placement, RenderGeometry, Window};
pub use illumination::{RadialWeight, illumination_adjoint, illumination_map, illumination_weights};
pub use kernel::{MAX_RADIUS, PatchKernels, kernel_radius, patch_kernels, patch_kernels_adjoint};

use crate::image::LinearImage;
use crate::psf::{PsfBank, PsfError};

/// Why a scene cannot be rendered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// The PSFs are malformed.
    #[error(transparent)]
    Psf(#[from] PsfError),
    /// Sensor size, pixel pitch or patch count is out of range.
    #[error(
        "render geometry {height}x{width} pixels of {pixel_um} um in {patch_rows}x{patch_cols} patches; \
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
        "the PSF grid reaches {radius} pixels; at most {MAX_RADIUS} are possible; hint: check pitch and pixel size"
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
        "the scene has {height}x{width} pixels; it needs more than {border} on each side of the output; \
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
    #[error(
        "output of {height}x{width} at row {row}, column {col} leaves the {sensor_height}x{sensor_width} sensor"
    )]
    OffSensor {
        /// Output rows.
        height: usize,
        /// Output columns.
        width: usize,
        /// First row on the sensor.
        row: usize,
        /// First column on the sensor.
        col: usize,
        /// Sensor rows.
        sensor_height: usize,
        /// Sensor columns.
        sensor_width: usize,
    },
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

/// Light on the sensor window at `placement` when a lens with these PSFs images `scene`.
///
/// `scene` (3 planes, relative radiance) covers the output and a border of [`kernel_radius`] pixels on every side. The
/// output is smaller by that border. Error of the f32 FFTs: about 1e-6 of the largest scene value.
pub fn render(
    geometry: &RenderGeometry,
    bank: &PsfBank,
    scene: &LinearImage,
    placement: Placement,
) -> Result<LinearImage, RenderError> {
    let layout = bank.layout();
    let radius = kernel_radius(geometry, &layout)?;
    let window = geometry::output_window(geometry, scene, radius, placement)?;
    let active = geometry.active_patches(&window);
    let kernels = patch_kernels(geometry, &layout, &bank.values, &active)?;
    render_kernels(geometry, &kernels, scene, placement)
}

/// Checks a scene against the geometry, and marks the patches that its output needs.
pub(crate) fn check_scene(
    geometry: &RenderGeometry,
    scene: &LinearImage,
    radius: usize,
    placement: Placement,
) -> Result<Vec<bool>, RenderError> {
    Ok(geometry.active_patches(&geometry::output_window(geometry, scene, radius, placement)?))
}

/// Checks that a window lies on the sensor.
pub(crate) fn check_placement(
    geometry: &RenderGeometry,
    placement: Placement,
    height: usize,
    width: usize,
) -> Result<(), RenderError> {
    geometry::check_window(geometry, placement, height, width).map(|_| ())
}

#[cfg(test)]
pub(crate) mod tests;
