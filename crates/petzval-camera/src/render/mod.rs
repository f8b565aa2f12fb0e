//! From a scene to the light on the sensor: the PSF of its place in the field spreads the light of each point.
//!
//! The PSF rotates and changes over the image, so the sensor is divided into patches. Each patch has one kernel: the PSF at
//! the patch centre, rotated to its azimuth and integrated over pixels. The picture blends the convolutions of neighbouring
//! patches with weights that sum to one, so there are no seams and a flat field stays flat:
//!
//! `out(x) = sum_p w_p(x) (K_p * scene)(x)`.
//!
//! [`render`] convolves tile by tile: directly where the kernels are small, else with FFTs. [`render_direct`] is the readable reference, [`render_adjoint`] the exact
//! transpose. Relative illumination is a separate factor, see [`illumination_map`]. The scene lies on the image as
//! the lens projects it: [`Distortion`] resamples a rectilinear picture to it. [`light_on_pixels`] does all of this, also for scenes
//! that are sampled more finely than the pixels.

mod adjoint;
mod blend;
mod convolve;
mod direct;
mod distortion;
mod error;
mod geometry;
mod illumination;
mod kernel;
mod light;
mod limits;
mod restore;
mod spatial;
mod spectrum;
mod tiles;

pub use adjoint::{
    RenderGradient, render_adjoint, render_adjoint_kernels, render_adjoint_scene, render_kernels_adjoint,
};
pub use blend::{BlendError, blend_error, with_patches_for};
pub use direct::render_direct;
pub use distortion::Distortion;
pub use error::{OffSensor, RenderError};
#[cfg(any(feature = "wgpu", feature = "cuda"))]
pub(crate) use geometry::hat;
pub use geometry::{Placement, RenderGeometry, Window};
pub use illumination::{RadialWeight, illumination_adjoint, illumination_map, illumination_weights};
pub use kernel::{PatchKernels, PsfGradient, kernel_radius, patch_kernels, patch_kernels_adjoint};
pub use light::light_on_pixels;
pub use limits::{MAX_PATCHES, MAX_RADIUS, MAX_SIDE};
#[cfg(any(feature = "wgpu", feature = "cuda"))]
pub(crate) use restore::WienerGrid;
pub use restore::{Curves, KNOTS, Wiener, WienerGradient};

use petzval_base::Cancel;

use crate::image::LinearImage;
use crate::psf::PsfBank;
use tiles::TileSet;

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

/// As [`render`](fn@render), with ready kernels from [`patch_kernels`]. They must cover the patches active in the window.
pub fn render_kernels(
    geometry: &RenderGeometry,
    kernels: &PatchKernels,
    scene: &LinearImage,
    placement: Placement,
) -> Result<LinearImage, RenderError> {
    render_kernels_unless(&Cancel::default(), geometry, kernels, scene, placement)
}

/// As [`render_kernels`], for whole frames: ends within the time of a tile once it is cancelled, with [`RenderError::Stopped`].
pub fn render_kernels_unless(
    cancel: &Cancel,
    geometry: &RenderGeometry,
    kernels: &PatchKernels,
    scene: &LinearImage,
    placement: Placement,
) -> Result<LinearImage, RenderError> {
    let window = kernel::checked_window(geometry, kernels, scene, placement)?;
    let set = TileSet::new(geometry, &window, kernels.radius, None);
    let supports = spatial::supports(&set, kernels);
    if spatial::is_faster(&set, &supports) {
        let tiles = spatial::render_tiles(&set, kernels, &supports, scene, cancel)?;
        return Ok(set.assembled(&window, tiles));
    }
    let set = TileSet::new(geometry, &window, kernels.radius, Some(kernels));
    Ok(set.assembled(&window, convolve::by_transforms(&set, scene, cancel)?))
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

/// Marks the patches that have a weight in a window of the sensor.
pub(crate) fn sensor_patches(
    geometry: &RenderGeometry,
    placement: Placement,
    height: usize,
    width: usize,
) -> Vec<bool> {
    geometry.active_patches(&Window { placement, height, width })
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
