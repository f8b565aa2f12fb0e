//! The kernel of a sensor patch: the PSF interpolated to its radius, rotated to its azimuth and integrated over pixels.

use std::ops::Range;

use rayon::prelude::*;

use super::error::RenderError;
use super::geometry::{Placement, RenderGeometry, Window, output_window};
use super::limits::MAX_RADIUS;
use crate::image::{CHANNELS, LinearImage};
use crate::psf::{PsfLayout, check_len};

/// One kernel per channel for some of the patches, `[patch][channel][row][col]` on the pixel grid.
/// Element `(radius, radius)` is the pixel of the image point; rows are y ascending, columns x ascending.
#[derive(Debug, Clone, PartialEq)]
pub struct PatchKernels {
    /// Pixels from the centre to the edge. The kernel has `2 radius + 1` pixels on a side.
    pub radius: usize,
    /// The patches that have a kernel, ascending.
    pub patches: Vec<usize>,
    /// Kernel values of these patches.
    pub values: Vec<f32>,
}

impl PatchKernels {
    /// Kernels of zeros for the patches marked in `active`.
    pub fn zeros(radius: usize, active: &[bool]) -> Self {
        let patches: Vec<usize> = (0..active.len()).filter(|patch| active[*patch]).collect();
        let values = vec![0.0; patches.len() * CHANNELS * (2 * radius + 1).pow(2)];
        Self { radius, patches, values }
    }

    /// Pixels along one side.
    pub fn size(&self) -> usize {
        2 * self.radius + 1
    }

    /// Values of a patch: those of all its channels.
    fn per_patch(&self) -> usize {
        CHANNELS * self.size() * self.size()
    }

    /// Where the values of a patch are, if it has a kernel.
    fn range(&self, patch: usize) -> Option<Range<usize>> {
        let (n, slot) = (self.per_patch(), self.patches.binary_search(&patch).ok()?);
        Some(slot * n..(slot + 1) * n)
    }

    /// The kernel of one patch and channel, row by row.
    ///
    /// # Panics
    /// Panics if the patch has none.
    pub fn kernel(&self, patch: usize, channel: usize) -> &[f32] {
        let range = self.range(patch).unwrap_or_else(|| panic!("patch {patch} has no kernel"));
        let n = self.size() * self.size();
        &self.values[range][channel * n..(channel + 1) * n]
    }

    /// As [`PatchKernels::kernel`], to change it.
    pub(super) fn kernel_mut(&mut self, patch: usize, channel: usize) -> &mut [f32] {
        let range = self.range(patch).unwrap_or_else(|| panic!("patch {patch} has no kernel"));
        let n = self.size() * self.size();
        &mut self.values[range][channel * n..(channel + 1) * n]
    }

    /// Whether every patch marked in `active` has a kernel.
    pub(crate) fn covers(&self, active: &[bool]) -> bool {
        (0..active.len()).filter(|patch| active[*patch]).all(|patch| self.range(patch).is_some())
    }

    /// The kernels of the patches marked in `active`, which must have some.
    pub(crate) fn of_patches(&self, active: &[bool]) -> Self {
        let mut some = Self::zeros(self.radius, active);
        some.add(self);
        some
    }

    /// Adds the kernels that another set of the same radius has for these patches.
    pub(crate) fn add(&mut self, other: &Self) {
        let n = self.per_patch();
        for (patch, sum) in self.patches.iter().zip(self.values.chunks_exact_mut(n)) {
            if let Some(range) = other.range(*patch) {
                sum.iter_mut().zip(&other.values[range]).for_each(|(a, b)| *a += b);
            }
        }
    }
}

/// Kernel radius in pixels: the distance from the centre to the corner of the PSF grid, which a rotation by 45 degrees
/// brings onto an axis. Fails above [`MAX_RADIUS`].
pub fn kernel_radius(geometry: &RenderGeometry, layout: &PsfLayout) -> Result<usize, RenderError> {
    geometry.validate()?;
    layout.validate()?;
    let corner_um = (0.5 * (layout.grid as f64 - 1.0) * std::f64::consts::SQRT_2 + 0.5) * layout.pitch_um;
    let radius = (corner_um / geometry.pixel_um + 0.5).floor();
    if radius > MAX_RADIUS as f64 {
        return Err(RenderError::PsfTooLarge { radius });
    }
    Ok(radius as usize)
}

/// The PSF axes of a patch on the sensor: unit vectors along the PSF's columns (x) and rows (y, radially outward).
struct PatchFrame {
    along_x: (f64, f64),
    along_y: (f64, f64),
    radius_mm: f64,
    field_lo: usize,
    field_hi: usize,
    w_lo: f64,
    w_hi: f64,
}

impl PatchFrame {
    /// Those at a position on the sensor, um.
    fn new(geometry: &RenderGeometry, layout: &PsfLayout, (x, y): (f64, f64)) -> Self {
        let r = x.hypot(y);
        // On the axis the azimuth is undefined: do not rotate.
        let (ux, uy) = if r < 1e-6 * geometry.pixel_um { (0.0, 1.0) } else { (x / r, y / r) };
        let (field_lo, w_lo, w_hi) = layout.bracket(r * 1e-3);
        let field_hi = (field_lo + 1).min(layout.fields() - 1);
        Self { along_x: (uy, -ux), along_y: (ux, uy), radius_mm: r * 1e-3, field_lo, field_hi, w_lo, w_hi }
    }
}

/// Distributes PSF cells over kernel pixels: calls `visit(cell, pixel, share)` for each overlap of a cell that is not skipped.
///
/// The centre of a cell is rotated; the cell itself stays an axis-aligned box. Each pixel that the box overlaps receives a
/// share in proportion to the area. The shares of a cell sum to one, so energy is conserved exactly.
fn visit_shares(
    geometry: &RenderGeometry,
    layout: &PsfLayout,
    frame: &PatchFrame,
    radius: usize,
    skip: impl Fn(usize) -> bool,
    mut visit: impl FnMut(usize, usize, f64),
) {
    let (grid, cell, pixel) = (layout.grid, layout.pitch_um, geometry.pixel_um);
    let (size, reach) = (2 * radius + 1, radius as f64);
    let centre = 0.5 * (grid as f64 - 1.0);
    // First and last kernel index under the box around `u`.
    let span = |u: f64| {
        let index = |edge: f64| ((edge / pixel + 0.5).floor() + reach).clamp(0.0, 2.0 * reach) as usize;
        (index(u - 0.5 * cell), index(u + 0.5 * cell))
    };
    // Share of index k.
    let share = |u: f64, k: usize, first: usize, last: usize| {
        let middle = (k as f64 - reach) * pixel;
        let lower = if k == first { u - 0.5 * cell } else { middle - 0.5 * pixel };
        let upper = if k == last { u + 0.5 * cell } else { middle + 0.5 * pixel };
        (upper - lower) / cell
    };
    for row in 0..grid {
        let y_psf = (row as f64 - centre) * cell;
        for col in (0..grid).filter(|col| !skip(row * grid + col)) {
            let x_psf = (col as f64 - centre) * cell;
            // Rotate the cell centre to the azimuth of the patch, then share the cell among the pixels below it.
            let x = x_psf * frame.along_x.0 + y_psf * frame.along_y.0;
            let y = x_psf * frame.along_x.1 + y_psf * frame.along_y.1;
            let ((x0, x1), (y0, y1)) = (span(x), span(y));
            for ky in y0..=y1 {
                let share_y = share(y, ky, y0, y1);
                for kx in x0..=x1 {
                    visit(row * grid + col, ky * size + kx, share_y * share(x, kx, x0, x1));
                }
            }
        }
    }
}

/// The kernel of a position on the sensor, `[channel][row][col]`: that of a patch with its centre there.
pub(super) fn kernel_at(
    geometry: &RenderGeometry,
    layout: &PsfLayout,
    values: &[f32],
    radius: usize,
    position_um: (f64, f64),
) -> Vec<f64> {
    let (cells, pixels) = (layout.grid * layout.grid, (2 * radius + 1).pow(2));
    let frame = PatchFrame::new(geometry, layout, position_um);
    let (lo, hi) = (frame.field_lo * CHANNELS * cells, frame.field_hi * CHANNELS * cells);
    let mut sum = vec![0.0f64; CHANNELS * pixels];
    let light = |cell: usize, c: usize| {
        let (a, b) = (values[lo + c * cells + cell], values[hi + c * cells + cell]);
        frame.w_lo * a as f64 + frame.w_hi * b as f64
    };
    // Most cells of a compact PSF are dark, and need no turning.
    let is_dark = |cell: usize| (0..CHANNELS).all(|c| light(cell, c) == 0.0);
    visit_shares(geometry, layout, &frame, radius, is_dark, |cell, pixel, share| {
        for c in 0..CHANNELS {
            sum[c * pixels + pixel] += share * light(cell, c);
        }
    });
    sum
}

/// Kernels of the patches marked in `active`, linear in the PSF `values` (`[field][channel][row][col]`).
///
/// `K_p = integrate(rotate(w_lo PSF_lo + w_hi PSF_hi))`, with the two fields around the radius of the patch centre.
pub fn patch_kernels(
    geometry: &RenderGeometry,
    layout: &PsfLayout,
    values: &[f32],
    active: &[bool],
) -> Result<PatchKernels, RenderError> {
    let radius = kernel_radius(geometry, layout)?;
    check_len("PSF values", values.len(), layout.len())?;
    check_active(geometry, active)?;
    let mut out = PatchKernels::zeros(radius, active);
    let n = out.per_patch();
    let kernels = out.patches.par_iter().zip(out.values.par_chunks_exact_mut(n));
    kernels.for_each(|(patch, kernel)| {
        let sum = kernel_at(geometry, layout, values, radius, geometry.patch_centre_um(*patch));
        for (k, s) in kernel.iter_mut().zip(sum) {
            *k = s as f32;
        }
    });
    Ok(out)
}

/// Derivatives of a loss by the PSFs of a bank.
#[derive(Debug, Clone, PartialEq)]
pub struct PsfGradient {
    /// By `PsfBank::values`.
    pub values: Vec<f32>,
    /// By `PsfBank::field_radius_mm`, 1/mm: the PSFs stay as they are, and move outwards.
    pub radius: Vec<f64>,
}

/// Transpose of [`patch_kernels`]: from the cotangent of the kernels to those of the PSF `values` and of the field radii. Patches without
/// a kernel add nothing. What `wanted` (values, radii) does not mark is not computed and stays empty.
pub fn patch_kernels_adjoint(
    geometry: &RenderGeometry,
    layout: &PsfLayout,
    values: &[f32],
    d_kernels: &PatchKernels,
    wanted: [bool; 2],
) -> Result<PsfGradient, RenderError> {
    let radius = kernel_radius(geometry, layout)?;
    check_len("PSF values", values.len(), layout.len())?;
    let (cells, pixels) = (layout.grid * layout.grid, (2 * radius + 1).pow(2));
    check_len("kernel gradient", d_kernels.values.len(), d_kernels.patches.len() * CHANNELS * pixels)?;

    // Gather the cotangent of each patch's cells in parallel, then add the patches in fixed order.
    let each = d_kernels.patches.par_iter().zip(d_kernels.values.par_chunks_exact(CHANNELS * pixels));
    let parts: Vec<(PatchFrame, Vec<f32>, f64)> = each
        .map(|(&patch, kernel)| {
            let frame = PatchFrame::new(geometry, layout, geometry.patch_centre_um(patch));
            let mut sum = vec![0.0f64; CHANNELS * cells];
            visit_shares(
                geometry,
                layout,
                &frame,
                radius,
                |_| false,
                |cell, pixel, share| {
                    for c in 0..CHANNELS {
                        sum[c * cells + cell] += share * kernel[c * pixels + pixel] as f64;
                    }
                },
            );
            // A larger weight of the upper field takes away from the lower one.
            let (lo, hi) = (frame.field_lo * CHANNELS * cells, frame.field_hi * CHANNELS * cells);
            let between = |i: usize| f64::from(values[hi + i]) - f64::from(values[lo + i]);
            let by_w_hi =
                if wanted[1] { sum.iter().enumerate().map(|(i, bar)| bar * between(i)).sum() } else { 0.0 };
            (frame, sum.into_iter().map(|v| v as f32).collect(), by_w_hi)
        })
        .collect();
    let mut out = vec![0.0f32; if wanted[0] { layout.len() } else { 0 }];
    let per_field = CHANNELS * cells;
    let mut by_radius = vec![0.0; if wanted[1] { layout.fields() } else { 0 }];
    for (frame, part, by_w_hi) in &parts {
        if wanted[1] {
            layout.pull_back_bracket(frame.radius_mm, *by_w_hi, &mut by_radius);
        }
        if !wanted[0] {
            continue;
        }
        for (field, weight) in [(frame.field_lo, frame.w_lo as f32), (frame.field_hi, frame.w_hi as f32)] {
            for (o, p) in out[field * per_field..(field + 1) * per_field].iter_mut().zip(part) {
                *o += weight * p;
            }
        }
    }
    Ok(PsfGradient { values: out, radius: by_radius })
}

fn check_active(geometry: &RenderGeometry, active: &[bool]) -> Result<(), RenderError> {
    if active.len() == geometry.patch_count() {
        return Ok(());
    }
    let (expected, got) = (geometry.patch_count().to_string(), active.len().to_string());
    Err(RenderError::Mismatch { what: "flags of active patches", expected, got })
}

/// Checks that kernels, scene and placement fit the geometry.
pub(super) fn checked_window(
    geometry: &RenderGeometry,
    kernels: &PatchKernels,
    scene: &LinearImage,
    placement: Placement,
) -> Result<Window, RenderError> {
    let expected = kernels.patches.len() * kernels.per_patch();
    if kernels.values.len() != expected {
        let (expected, got) = (expected.to_string(), kernels.values.len().to_string());
        return Err(RenderError::Mismatch { what: "number of kernel values", expected, got });
    }
    let window = output_window(geometry, scene, kernels.radius, placement)?;
    if !kernels.covers(&geometry.active_patches(&window)) {
        let expected = "one of every patch that the window needs".to_owned();
        let got = format!("those of {} patches", kernels.patches.len());
        return Err(RenderError::Mismatch { what: "kernels", expected, got });
    }
    Ok(window)
}
