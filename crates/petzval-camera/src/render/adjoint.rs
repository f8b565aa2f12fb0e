//! Exact transpose of the renderer: pulls a cotangent of the rendered picture back to the PSF values and to the scene.

use std::collections::BTreeMap;

use petzval_fourier::Complex32;
use rayon::prelude::*;

use super::geometry::Window;
use super::kernel::checked_window;
use super::spectrum::{Scratch, TransformSize};
use super::tiles::TileSet;
use super::{
    PatchKernels, Placement, PsfGradient, RenderError, RenderGeometry, geometry, kernel_radius,
    patch_kernels, patch_kernels_adjoint,
};
use crate::image::{CHANNELS, LinearImage};
use crate::psf::PsfBank;

/// Gradient of a loss with respect to the two inputs of [`super::render`].
#[derive(Debug, Clone, PartialEq)]
pub struct RenderGradient {
    /// Gradient with respect to the PSFs.
    pub psfs: PsfGradient,
    /// Gradient with respect to the scene, border included.
    pub scene: LinearImage,
}

/// Transpose of [`super::render`]: `d_output` is the cotangent of the rendered picture.
///
/// Rendering is linear in the PSF values and in the scene. Each part of the result is `J^T d_output` with the other input
/// held fixed, so `<d_output, J v> = <J^T d_output, v>` up to f32 round-off.
pub fn render_adjoint(
    geometry: &RenderGeometry,
    bank: &PsfBank,
    scene: &LinearImage,
    placement: Placement,
    d_output: &LinearImage,
) -> Result<RenderGradient, RenderError> {
    let layout = bank.layout();
    let radius = kernel_radius(geometry, &layout)?;
    let window = geometry::output_window(geometry, scene, radius, placement)?;
    let active = geometry.active_patches(&window);
    let kernels = patch_kernels(geometry, &layout, &bank.values, &active)?;
    let set = TileSet::new(geometry, &window, radius, Some(&kernels));
    let (d_kernels, d_scene) = transpose(geometry, &set, &window, scene, d_output, true)?;
    let psfs = patch_kernels_adjoint(geometry, &layout, &bank.values, &d_kernels, [true; 2])?;
    Ok(RenderGradient { psfs, scene: d_scene })
}

/// Gradient with respect to the patch kernels of `radius` pixels only, for a fixed scene.
pub fn render_adjoint_kernels(
    geometry: &RenderGeometry,
    radius: usize,
    scene: &LinearImage,
    placement: Placement,
    d_output: &LinearImage,
) -> Result<PatchKernels, RenderError> {
    let window = geometry::output_window(geometry, scene, radius, placement)?;
    let set = TileSet::new(geometry, &window, radius, None);
    Ok(transpose(geometry, &set, &window, scene, d_output, true)?.0)
}

/// Transpose of [`super::render_kernels`] in both its inputs: the gradients with respect to the kernels and to the scene, border included.
pub fn render_kernels_adjoint(
    geometry: &RenderGeometry,
    kernels: &PatchKernels,
    scene: &LinearImage,
    placement: Placement,
    d_output: &LinearImage,
) -> Result<(PatchKernels, LinearImage), RenderError> {
    let window = checked_window(geometry, kernels, scene, placement)?;
    let set = TileSet::new(geometry, &window, kernels.radius, Some(kernels));
    transpose(geometry, &set, &window, scene, d_output, true)
}

/// Gradient with respect to the scene only, border included, for fixed kernels.
pub fn render_adjoint_scene(
    geometry: &RenderGeometry,
    kernels: &PatchKernels,
    scene: &LinearImage,
    placement: Placement,
    d_output: &LinearImage,
) -> Result<LinearImage, RenderError> {
    let window = checked_window(geometry, kernels, scene, placement)?;
    let set = TileSet::new(geometry, &window, kernels.radius, Some(kernels));
    Ok(transpose(geometry, &set, &window, scene, d_output, false)?.1)
}

/// Number of tiles whose spectra are held at once. It bounds memory and fixes the order of summation.
const TILES_AT_ONCE: usize = 8;

/// Contribution of one tile and channel to the gradient.
struct TileGradient {
    /// Cross spectra of scene and weighted cotangent, per patch.
    kernels: Vec<(usize, Vec<Complex32>)>,
    /// Gradient of the scene under the tile and its border.
    scene: Vec<f32>,
}

/// Gradients of kernels and scene. The scene's gradient is empty if the set holds no kernels; that of the kernels is zero unless
/// `with_kernels`.
fn transpose(
    geometry: &RenderGeometry,
    set: &TileSet,
    window: &Window,
    scene: &LinearImage,
    d_output: &LinearImage,
    with_kernels: bool,
) -> Result<(PatchKernels, LinearImage), RenderError> {
    check_gradient(window, d_output)?;
    let with_scene = !set.kernels.is_empty();
    let mut spectra: BTreeMap<(TransformSize, usize, usize), Vec<Complex32>> = BTreeMap::new();
    let scene_height = if with_scene { scene.height } else { 0 };
    let mut d_scene = LinearImage::zeros(CHANNELS, scene_height, scene.width);
    for first in (0..set.len()).step_by(TILES_AT_ONCE) {
        let count = TILES_AT_ONCE.min(set.len() - first);
        // Transpose a group of tiles in parallel.
        let parts: Vec<TileGradient> = (0..count * CHANNELS)
            .into_par_iter()
            .map_init(Scratch::default, |scratch, work| {
                let (tile, channel) = (first + work / CHANNELS, work % CHANNELS);
                transpose_tile(set, scene, d_output, (tile, channel), with_kernels, scratch)
            })
            .collect();

        // Tiles overlap in the scene and share kernels: add their contributions in fixed order.
        for (work, part) in parts.into_iter().enumerate() {
            let (row, col, size) = set.tile(first + work / CHANNELS);
            let channel = work % CHANNELS;
            for (patch, spectrum) in part.kernels {
                spectra
                    .entry((size, patch, channel))
                    .and_modify(|sum| sum.iter_mut().zip(&spectrum).for_each(|(a, b)| *a += b))
                    .or_insert(spectrum);
            }
            let width = col.len + 2 * set.radius;
            for (r, line) in part.scene.chunks_exact(width).enumerate() {
                let start = (row.start + r) * scene.width + col.start;
                let target = &mut d_scene.plane_mut(channel)[start..start + width];
                target.iter_mut().zip(line).for_each(|(a, b)| *a += b);
            }
        }
    }
    let kernels = kernels_from_spectra(set, &geometry.active_patches(window), spectra);
    Ok((kernels, d_scene))
}

/// Correlates the weighted cotangent with the scene (gradient of the kernels) and with the kernels (gradient of the scene).
fn transpose_tile(
    set: &TileSet,
    scene: &LinearImage,
    d_output: &LinearImage,
    (tile, channel): (usize, usize),
    with_kernels: bool,
    scratch: &mut Scratch,
) -> TileGradient {
    let with_scene = !set.kernels.is_empty();
    let (row, col, size) = set.tile(tile);
    let (plan, border) = (&set.plans[&size], 2 * set.radius);
    let scene_spectrum = with_kernels.then(|| set.scene_spectrum(scene, row, col, channel, scratch));
    let gradient = d_output.plane(channel);
    let mut part = TileGradient { kernels: Vec::new(), scene: Vec::new() };
    let mut back = vec![Complex32::default(); if with_scene { plan.len() } else { 0 }];
    let mut by_column = Vec::new();
    for (patch_col, col_weight) in &col.weights {
        // Weight the cotangent by the column weights of the patch and transform its rows.
        plan.rows_forward(border, row.len, &mut by_column, scratch, |r, line| {
            let start = (row.start + r - border) * d_output.width + col.start;
            let source = &gradient[start..start + col.len];
            for ((l, g), w) in line[border..].iter_mut().zip(source).zip(col_weight) {
                *l = g * w;
            }
        });
        for (patch_row, row_weight) in &row.weights {
            let patch = patch_row * set.patch_cols + patch_col;
            // Weight by the row weights between the two passes, then transform the columns.
            let mut weighted = vec![Complex32::default(); plan.len()];
            for (t, s) in weighted.chunks_exact_mut(plan.rows).zip(by_column.chunks_exact(plan.rows)) {
                let (t, s) = (&mut t[border..border + row.len], &s[border..border + row.len]);
                for r in 0..row.len {
                    t[r] = s[r] * row_weight[r];
                }
            }
            plan.cols_forward(&mut weighted, scratch);
            // Correlate with the kernel and add to the scene's spectrum.
            if with_scene {
                let kernel = &set.kernels[&(size, patch)][channel];
                for ((b, w), k) in back.iter_mut().zip(&weighted).zip(kernel) {
                    *b += w * k.conj();
                }
            }
            // Correlate with the scene: the cross spectrum of this patch's kernel.
            if let Some(spectrum) = &scene_spectrum {
                for (w, s) in weighted.iter_mut().zip(spectrum) {
                    *w *= s.conj();
                }
                part.kernels.push((patch, weighted));
            }
        }
    }
    // Transform the scene's gradient back to pixels.
    if with_scene {
        let (height, width) = (row.len + border, col.len + border);
        plan.cols_inverse(&mut back, scratch);
        part.scene.reserve(height * width);
        plan.rows_inverse(0, height, &back, scratch, |_, line| part.scene.extend_from_slice(&line[..width]));
    }
    part
}

/// Transforms the summed cross spectra back to pixels and keeps the lags within the kernel.
fn kernels_from_spectra(
    set: &TileSet,
    active: &[bool],
    spectra: BTreeMap<(TransformSize, usize, usize), Vec<Complex32>>,
) -> PatchKernels {
    let side = 2 * set.radius + 1;
    let mut spectra: Vec<_> = spectra.into_iter().collect();
    let parts: Vec<Vec<f32>> = spectra
        .par_iter_mut()
        .map_init(Scratch::default, |scratch, ((size, _, _), spectrum)| {
            let plan = &set.plans[size];
            let mut kernel = Vec::with_capacity(side * side);
            plan.cols_inverse(spectrum, scratch);
            plan.rows_inverse(0, side, spectrum, scratch, |_, line| kernel.extend_from_slice(&line[..side]));
            kernel
        })
        .collect();
    let mut out = PatchKernels::zeros(set.radius, active);
    for (((_, patch, channel), _), part) in spectra.iter().zip(&parts) {
        out.kernel_mut(*patch, *channel).iter_mut().zip(part).for_each(|(a, b)| *a += b);
    }
    out
}

fn check_gradient(window: &Window, d_output: &LinearImage) -> Result<(), RenderError> {
    let shape = |c: usize, h: usize, w: usize| format!("{c}x{h}x{w}");
    let same =
        (d_output.channels, d_output.height, d_output.width) == (CHANNELS, window.height, window.width);
    if same && d_output.data.len() == CHANNELS * window.height * window.width {
        return Ok(());
    }
    let expected = shape(CHANNELS, window.height, window.width);
    let got = shape(d_output.channels, d_output.height, d_output.width);
    Err(RenderError::Mismatch { what: "gradient of the rendered picture", expected, got })
}
