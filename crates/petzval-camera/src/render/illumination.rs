//! Relative illumination over the sensor: vignetting and the cos^4 law dim the picture towards the corners.

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

fn weight(geometry: &RenderGeometry, layout: &PsfLayout, row: usize, col: usize) -> RadialWeight {
    let (field_lo, w_lo, w_hi) = layout.bracket(geometry.radius_mm(row, col));
    RadialWeight { field_lo, w_lo: w_lo as f32, w_hi: w_hi as f32 }
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
    let at = |i: usize| weight(geometry, layout, placement.row + i / width, placement.col + i % width);
    Ok((0..height * width).into_par_iter().map(at).collect())
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
    let last = layout.fields() - 1;
    let mut out = LinearImage::zeros(CHANNELS, height, width);
    let (red, rest) = out.data.split_at_mut(height * width);
    let (green, blue) = rest.split_at_mut(height * width);
    let lines = |plane| <[f32] as ParallelSliceMut<f32>>::par_chunks_exact_mut(plane, width.max(1));
    lines(red).zip(lines(green)).zip(lines(blue)).enumerate().for_each(|(r, ((red, green), blue))| {
        for col in 0..width {
            let w = weight(geometry, layout, placement.row + r, placement.col + col);
            let (lo, hi) = (w.field_lo * CHANNELS, (w.field_lo + 1).min(last) * CHANNELS);
            let value = |c: usize| w.w_lo * illumination[lo + c] + w.w_hi * illumination[hi + c];
            (red[col], green[col], blue[col]) = (value(0), value(1), value(2));
        }
    });
    Ok(out)
}

/// Transpose of [`illumination_map`]: from the cotangent of the map to that of the table `[field][channel]`.
pub fn illumination_adjoint(
    geometry: &RenderGeometry,
    layout: &PsfLayout,
    placement: Placement,
    d_map: &LinearImage,
) -> Result<Vec<f32>, RenderError> {
    if d_map.channels != CHANNELS {
        return Err(RenderError::Channels {
            what: "gradient of the illumination map",
            channels: d_map.channels,
        });
    }
    let (height, width) = (d_map.height, d_map.width);
    let weights = illumination_weights(geometry, layout, placement, height, width)?;
    let last = layout.fields() - 1;
    let size = layout.fields() * CHANNELS;
    // Sum along each row in parallel, then over rows in fixed order.
    let rows: Vec<Vec<f64>> = (0..height)
        .into_par_iter()
        .map(|r| {
            let mut sum = vec![0.0f64; size];
            for c in 0..CHANNELS {
                for (i, w) in weights[r * width..(r + 1) * width].iter().enumerate() {
                    let g = d_map.get(c, r, i) as f64;
                    sum[w.field_lo * CHANNELS + c] += w.w_lo as f64 * g;
                    sum[(w.field_lo + 1).min(last) * CHANNELS + c] += w.w_hi as f64 * g;
                }
            }
            sum
        })
        .collect();
    let mut out = vec![0.0f64; size];
    for row in rows {
        out.iter_mut().zip(row).for_each(|(o, v)| *o += v);
    }
    Ok(out.into_iter().map(|v| v as f32).collect())
}
