//! The tiles of a window: runs of pixels that blend the same patches, with their transforms.

use std::collections::BTreeMap;

use petzval_fourier::Complex32;
use rayon::prelude::*;

use super::geometry::{AxisTile, Window, tile_patches};
use super::spectrum::{Scratch, TilePlan, TransformSize, fast_len, forward, plans};
use super::{PatchKernels, RenderGeometry};
use crate::image::{CHANNELS, LinearImage};

/// The tiles of an output window, their transforms, and the kernel spectra that they need.
pub(super) struct TileSet {
    pub rows: Vec<AxisTile>,
    pub cols: Vec<AxisTile>,
    pub patch_cols: usize,
    pub radius: usize,
    pub plans: BTreeMap<TransformSize, TilePlan>,
    /// Spectra of the kernels, per transform size and patch, one per channel.
    pub kernels: BTreeMap<(TransformSize, usize), Vec<Vec<Complex32>>>,
}

impl TileSet {
    /// The tiles of a window. Without `kernels` the set holds no kernel spectra; the gradient of the kernels needs none.
    pub fn new(
        geometry: &RenderGeometry,
        window: &Window,
        radius: usize,
        kernels: Option<&PatchKernels>,
    ) -> Self {
        let (rows, cols) = (geometry.row_tiles(window), geometry.col_tiles(window));
        let patch_cols = geometry.patches.1;
        // List the patches of each tile, by transform size.
        let mut keys = Vec::new();
        for row in &rows {
            for col in &cols {
                let size = transform_size(row, col, radius);
                keys.extend(tile_patches(row, col, patch_cols).into_iter().map(|patch| (size, patch)));
            }
        }
        keys.sort_unstable();
        keys.dedup();
        let plans = plans(keys.iter().map(|key| key.0));

        // Transform each kernel once per tile size in which it acts.
        let side = 2 * radius + 1;
        let Some(kernels) = kernels else {
            return Self { rows, cols, patch_cols, radius, plans, kernels: BTreeMap::new() };
        };
        let spectra: Vec<Vec<Complex32>> = (0..keys.len() * CHANNELS)
            .into_par_iter()
            .map_init(Scratch::default, |scratch, work| {
                let (size, patch) = keys[work / CHANNELS];
                let kernel = kernels.kernel(patch, work % CHANNELS);
                forward(&plans[&size], side, scratch, |r, line| {
                    line[..side].copy_from_slice(&kernel[r * side..(r + 1) * side]);
                })
            })
            .collect();
        let mut spectra = spectra.into_iter();
        let kernels = keys.into_iter().map(|key| (key, spectra.by_ref().take(CHANNELS).collect())).collect();
        Self { rows, cols, patch_cols, radius, plans, kernels }
    }

    /// Number of tiles.
    pub fn len(&self) -> usize {
        self.rows.len() * self.cols.len()
    }

    /// Row run, column run and transform size of a tile.
    pub fn tile(&self, index: usize) -> (&AxisTile, &AxisTile, TransformSize) {
        let (row, col) = (&self.rows[index / self.cols.len()], &self.cols[index % self.cols.len()]);
        (row, col, transform_size(row, col, self.radius))
    }

    /// The picture of a window from its tiles, three for each; every output pixel belongs to exactly one.
    pub fn assembled(&self, window: &Window, tiles: Vec<Vec<f32>>) -> LinearImage {
        let mut out = LinearImage::zeros(CHANNELS, window.height, window.width);
        for (work, tile) in tiles.iter().enumerate() {
            let (row, col, _) = self.tile(work / CHANNELS);
            let plane = out.plane_mut(work % CHANNELS);
            for (r, line) in tile.chunks_exact(col.len).enumerate() {
                let start = (row.start + r) * window.width + col.start;
                plane[start..start + col.len].copy_from_slice(line);
            }
        }
        out
    }

    /// Spectrum of the scene under a tile and its border.
    pub fn scene_spectrum(
        &self,
        scene: &LinearImage,
        row: &AxisTile,
        col: &AxisTile,
        channel: usize,
        scratch: &mut Scratch,
    ) -> Vec<Complex32> {
        let plan = &self.plans[&transform_size(row, col, self.radius)];
        let (plane, width) = (scene.plane(channel), col.len + 2 * self.radius);
        forward(plan, row.len + 2 * self.radius, scratch, |r, line| {
            let start = (row.start + r) * scene.width + col.start;
            line[..width].copy_from_slice(&plane[start..start + width]);
        })
    }
}

fn transform_size(row: &AxisTile, col: &AxisTile, radius: usize) -> TransformSize {
    (fast_len(row.len + 2 * radius), fast_len(col.len + 2 * radius))
}
