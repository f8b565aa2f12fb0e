//! Rendering by direct convolution, for kernels of few pixels: the defining sum, row by row, with vectors.
//!
//! Along a row the weights of the upper and the lower patches are constant, so their kernels are mixed first. A row then needs two
//! convolutions, with the kernels left and right of it, which are blended by the column weights.

use petzval_base::{Cancel, Cancelled};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::PatchKernels;
use super::geometry::tile_patches;
use super::tiles::TileSet;
use crate::image::{CHANNELS, LinearImage};
use petzval_base::simd::dispatch;

/// Columns are padded to a multiple of this: four vectors of the widest kind.
const BLOCK: usize = 64;

/// Vectors of a row that are summed together, in registers.
const VECTORS: usize = 4;

/// Multiplications per output pixel, of both kernels of a row, up to which direct convolution is faster than FFTs.
const MOST_TAPS: usize = 900;

/// The rectangle of a kernel outside of which all given kernels are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Support {
    first_row: usize,
    rows: usize,
    first_col: usize,
    cols: usize,
}

impl Support {
    fn of<'a>(kernels: impl Iterator<Item = &'a [f32]> + Clone, side: usize) -> Self {
        let used = |index: &dyn Fn(usize) -> usize| {
            let mut ends = None;
            for kernel in kernels.clone() {
                for i in (0..kernel.len()).filter(|i| kernel[*i] != 0.0) {
                    let (low, high) = ends.unwrap_or((usize::MAX, 0));
                    ends = Some((index(i).min(low), index(i).max(high)));
                }
            }
            ends.map_or((side / 2, 1), |(low, high): (usize, usize)| (low, high - low + 1))
        };
        let ((first_row, rows), (first_col, cols)) = (used(&|i| i / side), used(&|i| i % side));
        Self { first_row, rows, first_col, cols }
    }

    /// The part of a kernel, its rows and columns reversed: the convolution becomes a sum along memory.
    fn reversed(&self, kernel: &[f32], side: usize) -> Vec<f32> {
        let rows = (0..self.rows).rev().map(|r| self.first_row + r);
        rows.flat_map(|r| (0..self.cols).rev().map(move |c| kernel[r * side + self.first_col + c])).collect()
    }
}

/// The supports of the kernels that each tile blends, all channels together.
pub(super) fn supports(set: &TileSet, kernels: &PatchKernels) -> Vec<Support> {
    let of_tile = |tile: usize| {
        let (row, col, _) = set.tile(tile);
        let patches = tile_patches(row, col, set.patch_cols);
        let all = patches.iter().flat_map(|patch| (0..CHANNELS).map(move |c| kernels.kernel(*patch, c)));
        Support::of(all, kernels.size())
    };
    (0..set.len()).into_par_iter().map(of_tile).collect()
}

/// Whether direct convolution of a window is faster than that by FFTs.
pub(super) fn is_faster(set: &TileSet, supports: &[Support]) -> bool {
    let (mut taps, mut pixels) = (0, 0);
    for (tile, s) in supports.iter().enumerate() {
        let (row, col, _) = set.tile(tile);
        taps += 2 * s.rows * s.cols * row.len * col.len;
        pixels += row.len * col.len;
    }
    taps <= MOST_TAPS * pixels
}

/// The light of one channel of a tile, row by row.
fn render_tile(
    set: &TileSet,
    kernels: &PatchKernels,
    s: &Support,
    scene: &LinearImage,
    tile: usize,
    channel: usize,
) -> Vec<f32> {
    let (row, col, _) = set.tile(tile);
    let side = kernels.size();
    // Cut out the scene under the tile and the reach of its kernels. Each line is padded for whole blocks of columns.
    let padded = col.len.next_multiple_of(BLOCK);
    let stride = padded + s.cols;
    let (above, left) = (side - s.first_row - s.rows, side - s.first_col - s.cols);
    let plane = scene.plane(channel);
    let mut block = vec![0.0f32; (row.len + s.rows - 1) * stride];
    for (r, line) in block.chunks_exact_mut(stride).enumerate() {
        let start = (row.start + above + r) * scene.width + col.start + left;
        let width = (col.len + s.cols - 1).min(stride);
        line[..width].copy_from_slice(&plane[start..start + width]);
    }
    // The kernels of the tile by column of patches, then by row of patches.
    let part = |patch_row: usize, patch_col: usize| {
        s.reversed(kernels.kernel(patch_row * set.patch_cols + patch_col, channel), side)
    };
    let by_column: Vec<Vec<Vec<f32>>> = (col.weights.iter())
        .map(|(patch_col, _)| row.weights.iter().map(|(patch_row, _)| part(*patch_row, *patch_col)).collect())
        .collect();
    let mut out = vec![0.0f32; row.len * col.len];
    let mut kernel = vec![0.0f32; s.rows * s.cols];
    let mut convolved = vec![0.0f32; padded];
    for (r, line) in out.chunks_exact_mut(col.len).enumerate() {
        for (of_column, (_, col_weight)) in by_column.iter().zip(&col.weights) {
            // Mix the upper and the lower kernel, convolve the row, and add it by the column weights.
            kernel.fill(0.0);
            for (of_row, (_, row_weight)) in of_column.iter().zip(&row.weights) {
                kernel.iter_mut().zip(of_row).for_each(|(k, v)| *k += row_weight[r] * v);
            }
            let lines = &block[r * stride..(r + s.rows) * stride];
            dispatch(ConvolveRow { kernel: &kernel, columns: s.cols, lines, stride, out: &mut convolved });
            for ((o, v), w) in line.iter_mut().zip(&convolved).zip(col_weight) {
                *o += v * w;
            }
        }
    }
    out
}

/// All tiles and channels of a window.
pub(super) fn render_tiles(
    set: &TileSet,
    kernels: &PatchKernels,
    supports: &[Support],
    scene: &LinearImage,
    cancel: &Cancel,
) -> Result<Vec<Vec<f32>>, Cancelled> {
    let work = (0..set.len() * CHANNELS).into_par_iter();
    work.map(|work| {
        cancel.check()?;
        let (tile, channel) = (work / CHANNELS, work % CHANNELS);
        Ok(render_tile(set, kernels, &supports[tile], scene, tile, channel))
    })
    .collect()
}

/// `out[c] = sum over r, k of kernel[r][k] lines[r][c + k]`.
struct ConvolveRow<'a> {
    kernel: &'a [f32],
    columns: usize,
    lines: &'a [f32],
    stride: usize,
    out: &'a mut [f32],
}

impl WithSimd for ConvolveRow<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { kernel, columns, lines, stride, out } = self;
        let lanes = size_of::<S::f32s>() / size_of::<f32>();
        let (vectors, _) = S::as_mut_simd_f32s(out);
        for (b, sums) in vectors.chunks_exact_mut(VECTORS).enumerate() {
            let first = b * VECTORS * lanes;
            let mut sum = [simd.splat_f32s(0.0); VECTORS];
            for (weights, line) in kernel.chunks_exact(columns).zip(lines.chunks_exact(stride)) {
                for (k, weight) in weights.iter().enumerate() {
                    let (light, _) = S::as_simd_f32s(&line[first + k..first + k + VECTORS * lanes]);
                    let weight = simd.splat_f32s(*weight);
                    for n in 0..VECTORS {
                        sum[n] = simd.mul_add_e_f32s(weight, light[n], sum[n]);
                    }
                }
            }
            sums.copy_from_slice(&sum);
        }
    }
}
