//! Rendering by FFTs, tile by tile, each tile blending at most two by two patches.

use petzval_base::{Cancel, Cancelled};
use petzval_fourier::Complex32;
use rayon::prelude::*;

use super::spectrum::Scratch;
use super::tiles::TileSet;
use crate::image::{CHANNELS, LinearImage};

/// All tiles and channels of a window, by FFTs.
pub(super) fn by_transforms(
    set: &TileSet,
    scene: &LinearImage,
    cancel: &Cancel,
) -> Result<Vec<Vec<f32>>, Cancelled> {
    (0..set.len() * CHANNELS)
        .into_par_iter()
        .map_init(Scratch::default, |scratch, work| {
            cancel.check()?;
            Ok(render_tile(set, scene, work / CHANNELS, work % CHANNELS, scratch))
        })
        .collect()
}

/// Blends the convolutions of the patches around one tile.
///
/// Row weights are applied between the column and the row pass of the inverse FFT, so the two patches of one column share
/// a single row pass.
fn render_tile(
    set: &TileSet,
    scene: &LinearImage,
    tile: usize,
    channel: usize,
    scratch: &mut Scratch,
) -> Vec<f32> {
    let (row, col, size) = set.tile(tile);
    let (plan, border) = (&set.plans[&size], 2 * set.radius);
    let scene = set.scene_spectrum(scene, row, col, channel, scratch);
    let mut out = vec![0.0f32; row.len * col.len];
    let mut product = vec![Complex32::default(); plan.len()];
    let mut blend = vec![Complex32::default(); plan.len()];
    for (patch_col, col_weight) in &col.weights {
        for (i, (patch_row, row_weight)) in row.weights.iter().enumerate() {
            // Convolve the scene with the patch's kernel: multiply the spectra.
            let kernel = &set.kernels[&(size, patch_row * set.patch_cols + patch_col)][channel];
            for ((p, s), k) in product.iter_mut().zip(&scene).zip(kernel) {
                *p = s * k;
            }
            // Invert the columns and blend the patches with their row weights.
            plan.cols_inverse(&mut product, scratch);
            for (b, p) in blend.chunks_exact_mut(plan.rows).zip(product.chunks_exact(plan.rows)) {
                let (b, p) = (&mut b[border..border + row.len], &p[border..border + row.len]);
                for r in 0..row.len {
                    let term = p[r] * row_weight[r];
                    b[r] = if i == 0 { term } else { b[r] + term };
                }
            }
        }
        // Invert the rows and add the light with its column weights.
        plan.rows_inverse(border, row.len, &blend, scratch, |r, line| {
            let start = (r - border) * col.len;
            for ((o, v), w) in out[start..start + col.len].iter_mut().zip(&line[border..]).zip(col_weight) {
                *o += v * w;
            }
        });
    }
    out
}
