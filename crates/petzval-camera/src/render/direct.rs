//! Readable reference of the renderer: the defining sum, pixel by pixel.

use rayon::prelude::*;

use super::kernel::checked_window;
use super::{PatchKernels, Placement, RenderError, RenderGeometry};
use crate::image::{CHANNELS, LinearImage};

/// Same result as [`super::render_kernels`] in direct space, f64 sums:
/// `out(x) = sum_p w_p(x) sum_d K_p(d) scene(x - d)`, at most four patches per pixel.
pub fn render_direct(
    geometry: &RenderGeometry,
    kernels: &PatchKernels,
    scene: &LinearImage,
    placement: Placement,
) -> Result<LinearImage, RenderError> {
    let window = checked_window(geometry, kernels, scene, placement)?;
    let side = kernels.size();
    let mut out = LinearImage::zeros(CHANNELS, window.height, window.width);
    out.data.par_chunks_exact_mut(window.width).enumerate().for_each(|(line, values)| {
        let (channel, row) = (line / window.height, line % window.height);
        let plane = scene.plane(channel);
        for (col, value) in values.iter_mut().enumerate() {
            let mut sum = 0.0f64;
            for (patch, weight) in geometry.patches_at(placement.row + row, placement.col + col) {
                let kernel = kernels.kernel(patch, channel);
                let mut convolved = 0.0f64;
                for dr in 0..side {
                    let start = (row + side - 1 - dr) * scene.width + col;
                    let light = &plane[start..start + side];
                    let weights = &kernel[dr * side..(dr + 1) * side];
                    convolved +=
                        (0..side).map(|dc| weights[dc] as f64 * light[side - 1 - dc] as f64).sum::<f64>();
                }
                sum += weight as f64 * convolved;
            }
            *value = sum as f32;
        }
    });
    Ok(out)
}
