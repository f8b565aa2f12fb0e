//! Readable reference of the renderer: the defining sum, pixel by pixel.

use rayon::prelude::*;

use super::geometry::hat;
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
    let (side, (patch_rows, patch_cols)) = (kernels.size(), geometry.patches);
    let mut out = LinearImage::zeros(CHANNELS, window.height, window.width);
    out.data.par_chunks_exact_mut(window.width).enumerate().for_each(|(line, values)| {
        let (channel, row) = (line / window.height, line % window.height);
        let plane = scene.plane(channel);
        let (row_lo, row_hi_weight) = hat(geometry.sensor_height, patch_rows, placement.row + row);
        for (col, value) in values.iter_mut().enumerate() {
            let (col_lo, col_hi_weight) = hat(geometry.sensor_width, patch_cols, placement.col + col);
            let mut sum = 0.0f64;
            for (i, wr) in [(row_lo, 1.0 - row_hi_weight), (row_lo + 1, row_hi_weight)] {
                for (j, wc) in [(col_lo, 1.0 - col_hi_weight), (col_lo + 1, col_hi_weight)] {
                    if wr * wc == 0.0 {
                        continue;
                    }
                    let kernel = kernels.kernel(i * patch_cols + j, channel);
                    let mut convolved = 0.0f64;
                    for dr in 0..side {
                        let start = (row + side - 1 - dr) * scene.width + col;
                        let light = &plane[start..start + side];
                        let weights = &kernel[dr * side..(dr + 1) * side];
                        convolved +=
                            (0..side).map(|dc| weights[dc] as f64 * light[side - 1 - dc] as f64).sum::<f64>();
                    }
                    sum += wr as f64 * wc as f64 * convolved;
                }
            }
            *value = sum as f32;
        }
    });
    Ok(out)
}
