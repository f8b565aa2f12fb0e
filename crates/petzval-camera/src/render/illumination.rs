//! Relative illumination over the sensor: vignetting, the cos^4 law and distortion change the light towards the corners.

use std::ops::Range;

use rayon::prelude::*;

use super::geometry::check_window;
use super::{Placement, RenderError, RenderGeometry};
use crate::image::{CHANNELS, LinearImage};
use crate::psf::{PsfLayout, check_len};

/// Interpolation weights of one pixel: its illumination is
/// `w_lo * table[field_lo] + w_hi * table[min(field_lo + 1, last)]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadialWeight {
    /// Field at or below the pixel's radius.
    pub field_lo: usize,
    /// Weight of that field.
    pub w_lo: f32,
    /// Weight of the next field.
    pub w_hi: f32,
}

/// The weights of a run of pixels along a row.
fn row_weights<'a>(
    geometry: &'a RenderGeometry,
    layout: &'a PsfLayout,
    row: usize,
    cols: Range<usize>,
) -> impl Iterator<Item = RadialWeight> + 'a {
    // The fields around a pixel are those around its neighbour, or the next ones.
    let mut last = 0;
    cols.map(move |col| {
        let (field_lo, w_lo, w_hi) = layout.bracket_near(geometry.radius_mm(row, col), last);
        last = field_lo;
        RadialWeight { field_lo, w_lo: w_lo as f32, w_hi: w_hi as f32 }
    })
}

/// The weights of every pixel of a window, row by row: linear interpolation in image radius.
pub fn illumination_weights(
    geometry: &RenderGeometry,
    layout: &PsfLayout,
    placement: Placement,
    height: usize,
    width: usize,
) -> Result<Vec<RadialWeight>, RenderError> {
    layout.validate()?;
    check_window(geometry, placement, height, width)?;
    let cols = placement.col..placement.col + width;
    let rows = placement.row..placement.row + height;
    Ok(rows.into_par_iter().flat_map_iter(|row| row_weights(geometry, layout, row, cols.clone())).collect())
}

/// Relative illumination of every pixel of a window, three planes, from a table `[field][channel]`.
pub fn illumination_map(
    geometry: &RenderGeometry,
    layout: &PsfLayout,
    illumination: &[f32],
    placement: Placement,
    height: usize,
    width: usize,
) -> Result<LinearImage, RenderError> {
    check_len("relative illumination", illumination.len(), layout.fields() * CHANNELS)?;
    layout.validate()?;
    check_window(geometry, placement, height, width)?;
    let (table, _) = illumination.as_chunks::<CHANNELS>();
    let last = layout.fields() - 1;
    let mut out = LinearImage::zeros(CHANNELS, height, width);
    let (red, rest) = out.data.split_at_mut(height * width);
    let (green, blue) = rest.split_at_mut(height * width);
    let lines = |plane| <[f32] as ParallelSliceMut<f32>>::par_chunks_exact_mut(plane, width.max(1));
    lines(red).zip(lines(green)).zip(lines(blue)).enumerate().for_each(|(r, ((red, green), blue))| {
        let cols = placement.col..placement.col + width;
        for (col, w) in row_weights(geometry, layout, placement.row + r, cols).enumerate() {
            let (lo, hi) = (&table[w.field_lo], &table[(w.field_lo + 1).min(last)]);
            let value = |c: usize| w.w_lo * lo[c] + w.w_hi * hi[c];
            (red[col], green[col], blue[col]) = (value(0), value(1), value(2));
        }
    });
    Ok(out)
}

/// Transpose of [`illumination_map`]: from the cotangent of the map to those of the table `[field][channel]` and of the field radii
/// (1/mm). What `wanted` (table, radii) does not mark is not computed and stays empty.
pub fn illumination_adjoint(
    geometry: &RenderGeometry,
    layout: &PsfLayout,
    illumination: &[f32],
    placement: Placement,
    d_map: &LinearImage,
    wanted: [bool; 2],
) -> Result<(Vec<f32>, Vec<f64>), RenderError> {
    if d_map.channels != CHANNELS {
        return Err(RenderError::Channels {
            what: "gradient of the illumination map",
            channels: d_map.channels,
        });
    }
    let (height, width) = (d_map.height, d_map.width);
    check_len("relative illumination", illumination.len(), layout.fields() * CHANNELS)?;
    let weights = illumination_weights(geometry, layout, placement, height, width)?;
    let last = layout.fields() - 1;
    let size = if wanted[0] { layout.fields() * CHANNELS } else { 0 };
    let radii = if wanted[1] { layout.fields() } else { 0 };
    // Sum along each row in parallel, then over rows in fixed order.
    let rows: Vec<(Vec<f64>, Vec<f64>)> = (0..height)
        .into_par_iter()
        .map(|r| {
            let (mut sum, mut by_radius) = (vec![0.0f64; size], vec![0.0; radii]);
            let mut by_w_hi = vec![0.0; width];
            for c in 0..CHANNELS {
                for (i, w) in weights[r * width..(r + 1) * width].iter().enumerate() {
                    let g = d_map.get(c, r, i) as f64;
                    let (lo, hi) = (w.field_lo * CHANNELS + c, (w.field_lo + 1).min(last) * CHANNELS + c);
                    if wanted[0] {
                        sum[lo] += w.w_lo as f64 * g;
                        sum[hi] += w.w_hi as f64 * g;
                    }
                    by_w_hi[i] += f64::from(illumination[hi] - illumination[lo]) * g;
                }
            }
            for (i, bar) in by_w_hi.into_iter().enumerate().take(if wanted[1] { width } else { 0 }) {
                let radius_mm = geometry.radius_mm(placement.row + r, placement.col + i);
                layout.pull_back_bracket(radius_mm, bar, &mut by_radius);
            }
            (sum, by_radius)
        })
        .collect();
    let (mut out, mut by_radius) = (vec![0.0f64; size], vec![0.0; radii]);
    for (row, radius) in rows {
        out.iter_mut().zip(row).for_each(|(o, v)| *o += v);
        by_radius.iter_mut().zip(radius).for_each(|(o, v)| *o += v);
    }
    Ok((out.into_iter().map(|v| v as f32).collect(), by_radius))
}
