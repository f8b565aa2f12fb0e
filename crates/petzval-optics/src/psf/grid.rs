//! The grid of a PSF, the light on it, and how it came there.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::splat;
use crate::gradient::LensGradient;
use crate::wave::ImageGrid;

/// Rays or waves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PsfKind {
    /// Rays: accurate where aberrations spread light over many times the Airy disk.
    #[default]
    Geometric,
    /// Waves: accurate everywhere, and needed where aberrations are a wave or less.
    Diffraction,
}

/// The grid of a PSF, and rays or waves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PsfOptions {
    /// Cells a side.
    pub grid: usize,
    /// Cell size, um.
    pub pitch_um: f64,
    /// Rays or waves.
    pub kind: PsfKind,
}

impl Default for PsfOptions {
    /// The paper's 128 x 128 um at 1 um, by rays.
    fn default() -> Self {
        Self { grid: 128, pitch_um: 1.0, kind: PsfKind::Geometric }
    }
}

impl PsfOptions {
    pub(super) fn image_grid(&self) -> ImageGrid {
        ImageGrid { cells: self.grid, pitch_mm: 1e-3 * self.pitch_um }
    }

    /// Cells per mm, and the cell coordinate of the chief ray.
    pub(super) fn scale(&self) -> (f64, f64) {
        (1e3 / self.pitch_um, 0.5 * (self.grid as f64 - 1.0))
    }
}

/// How a PSF was computed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[schemars(rename = "Method")]
pub enum PsfMethod {
    /// From polynomials over the pupil through traced rays.
    Polynomial {
        /// Total degree.
        degree: usize,
        /// Largest distance between the polynomials and traced rays that they were not fitted to, um.
        residual_um: f64,
    },
    /// From one traced ray per pupil cell.
    Traced,
    /// The point of a thin lens without aberrations.
    Point,
    /// The pattern of Airy, of a thin lens without aberrations.
    Airy,
    /// By diffraction, from polynomials of this total degree.
    Wave {
        /// Total degree.
        degree: usize,
    },
}

/// Cotangent of the splatted light of one wavelength.
pub(super) struct LightCotangent<'a> {
    /// By each cell, its mirror image included.
    pub grid: Vec<f64>,
    /// By the light per ideal image area.
    pub density: f64,
    /// The grid.
    pub options: &'a PsfOptions,
    /// Place of the reference chief ray, mm.
    pub chief_mm: [f64; 2],
}

/// A change of the lens, for the splatted light of one wavelength.
pub(super) struct LightChange<'a> {
    /// Of every number of the lens.
    pub lens: &'a LensGradient,
    /// Of the stop radius, divided by it.
    pub stop_growth: f64,
    /// Of the place of the reference chief ray, mm.
    pub chief_change_mm: [f64; 2],
    /// The grid.
    pub options: &'a PsfOptions,
    /// Place of the reference chief ray, mm.
    pub chief_mm: [f64; 2],
}

impl LightChange<'_> {
    /// Adds to the changes of cells that of the light of a ray, from its place (mm), its light and the changes of both.
    pub fn add(&self, cells: &mut [f64], at_mm: [f64; 2], light: f64, moved_mm: [f64; 2], light_change: f64) {
        let (per_mm, centre) = self.options.scale();
        let [u, v] = [0, 1].map(|axis| (at_mm[axis] - self.chief_mm[axis]) * per_mm + centre);
        let [du, dv] = [0, 1].map(|axis| (moved_mm[axis] - self.chief_change_mm[axis]) * per_mm);
        splat::push_forward(cells, self.options.grid, [u, v, light], [du, dv, light_change]);
    }
}

/// Adds to a grid its mirror image in x; this map is its own transpose.
pub(super) fn with_mirror_image(half: &[f64], grid: usize) -> Vec<f64> {
    let mut both = vec![0.0; half.len()];
    for (row, out) in half.chunks_exact(grid).zip(both.chunks_exact_mut(grid)) {
        for i in 0..grid {
            out[i] = row[i] + row[grid - 1 - i];
        }
    }
    both
}
