//! Bilinear demosaicing: the mean of the nearest pixels of the colour. Arrays other than Bayer's use
//! [`super::linear_interpolation`].

use rayon::prelude::*;

use super::linear_interpolation::LinearInterpolation;
use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;
use crate::sensor::{CfaPattern, SensorError};

/// What errors call the cotangent of a developed picture.
pub(super) const GRADIENT: &str = "gradient of the developed picture";

/// Interpolates the colours that each pixel did not measure. The top-left pixel of the mosaic is at `placement`.
///
/// In a Bayer array, green is the mean of the four edge neighbours; red and blue are means of the two or four nearest
/// pixels of their colour. Borders mirror about the outermost pixel, which keeps the phase of the mosaic. The mosaic has at
/// least 2x2 pixels.
///
/// Any other array uses linear interpolation between the nearest pixels of the colour, along the row, the column or both. A
/// colour without a filter in the array comes from the clear pixels. The mosaic has at least one tile. The border is not
/// mirrored.
///
/// Fails if the mosaic is smaller or has the wrong length, or if the array has neither the colour nor clear pixels.
pub fn demosaic_bilinear(
    mosaic: &[f32],
    height: usize,
    width: usize,
    cfa: CfaPattern,
    placement: Placement,
) -> Result<LinearImage, SensorError> {
    check_mosaic(mosaic.len(), height, width)?;
    if !cfa.is_bayer() {
        return Ok(LinearInterpolation::new(cfa, placement, height, width)?.fill(mosaic, height, width));
    }
    let mut out = LinearImage::zeros(CHANNELS, height, width);
    out.data.par_chunks_exact_mut(width).enumerate().for_each(|(line, values)| {
        let (channel, row) = (line / height, line % height);
        // The outermost pixels mirror.
        for col in [0, width - 1] {
            let (count, near) = neighbours(cfa, placement, channel, row, col, height, width);
            values[col] = near[..count].iter().map(|&i| mosaic[i]).sum::<f32>() / count as f32;
        }
        let line = |step| &mosaic[mirror(row, step, height) * width..][..width];
        let lines = [line(-1), &mosaic[row * width..][..width], line(1)];
        // The array repeats every two pixels.
        for first in [1, 2] {
            fill(values, first, lines, Near::of(cfa, placement, channel, row, first));
        }
    });
    Ok(out)
}

/// The means of every second pixel of a row from `first` on, except the outermost, of the mosaic's row and those above and below.
fn fill(values: &mut [f32], first: usize, [above, here, below]: [&[f32]; 3], near: Near) {
    let columns = (first..values.len() - 1).step_by(2);
    match near {
        Near::Here => columns.for_each(|c| values[c] = here[c]),
        Near::Edges => {
            columns.for_each(|c| values[c] = (above[c] + here[c - 1] + here[c + 1] + below[c]) / 4.0);
        }
        Near::Row => columns.for_each(|c| values[c] = (here[c - 1] + here[c + 1]) / 2.0),
        Near::Column => columns.for_each(|c| values[c] = (above[c] + below[c]) / 2.0),
        Near::Corners => {
            columns.for_each(|c| {
                values[c] = (above[c - 1] + above[c + 1] + below[c - 1] + below[c + 1]) / 4.0;
            });
        }
    }
}

/// Transpose of [`demosaic_bilinear`]: from the cotangent of the picture to the cotangent of the mosaic.
pub fn demosaic_bilinear_adjoint(
    d_rgb: &LinearImage,
    cfa: CfaPattern,
    placement: Placement,
) -> Result<Vec<f32>, SensorError> {
    let (height, width) = (d_rgb.height, d_rgb.width);
    if d_rgb.channels != CHANNELS || d_rgb.data.len() != CHANNELS * height * width {
        let got = format!("{} planes, {} values", d_rgb.channels, d_rgb.data.len());
        return Err(SensorError::shape(GRADIENT, "3 planes", got));
    }
    check_mosaic(height * width, height, width)?;
    if !cfa.is_bayer() {
        return Ok(LinearInterpolation::new(cfa, placement, height, width)?.gather(d_rgb));
    }
    // Scatter each plane's cotangent to the pixels that it was interpolated from, then add the planes in fixed order.
    let planes: Vec<Vec<f32>> = (0..CHANNELS)
        .into_par_iter()
        .map(|channel| {
            let mut sum = vec![0.0f32; height * width];
            for (i, &g) in d_rgb.plane(channel).iter().enumerate() {
                let (count, near) = neighbours(cfa, placement, channel, i / width, i % width, height, width);
                near[..count].iter().for_each(|&k| sum[k] += g / count as f32);
            }
            sum
        })
        .collect();
    let [red, green, blue] = [&planes[0], &planes[1], &planes[2]];
    Ok(red.iter().zip(green).zip(blue).map(|((r, g), b)| r + g + b).collect())
}

/// Where the pixels lie whose mean gives a colour at a pixel of a Bayer array.
#[derive(Clone, Copy)]
enum Near {
    /// The pixel itself.
    Here,
    /// Its four edge neighbours.
    Edges,
    /// Its two neighbours in the row.
    Row,
    /// Its two neighbours in the column.
    Column,
    /// Its four corner neighbours.
    Corners,
}

impl Near {
    fn of(cfa: CfaPattern, placement: Placement, channel: usize, row: usize, col: usize) -> Self {
        let colour =
            |dr: usize, dc: usize| cfa.colour(placement.row + row + dr, placement.col + col + dc).plane();
        let channel = Some(channel);
        // The pattern repeats every two pixels, so the neighbours on both sides have the same colour.
        match () {
            () if colour(0, 0) == channel => Self::Here,
            () if channel == Some(1) => Self::Edges,
            () if colour(0, 1) == channel => Self::Row,
            () if colour(1, 0) == channel => Self::Column,
            () => Self::Corners,
        }
    }
}

/// The row or column one step from `i`, of `len`; borders mirror about the outermost pixel.
fn mirror(i: usize, step: isize, len: usize) -> usize {
    match (i, step) {
        (0, -1) => 1,
        (i, 1) if i + 1 == len => len - 2,
        (i, step) => i.wrapping_add_signed(step),
    }
}

/// The pixels whose mean gives `channel` at `(row, col)`: their number, and their indices in the mosaic.
fn neighbours(
    cfa: CfaPattern,
    placement: Placement,
    channel: usize,
    row: usize,
    col: usize,
    height: usize,
    width: usize,
) -> (usize, [usize; 4]) {
    let at = |dr: isize, dc: isize| mirror(row, dr, height) * width + mirror(col, dc, width);
    match Near::of(cfa, placement, channel, row, col) {
        Near::Here => (1, [at(0, 0), 0, 0, 0]),
        Near::Edges => (4, [at(-1, 0), at(0, -1), at(0, 1), at(1, 0)]),
        Near::Row => (2, [at(0, -1), at(0, 1), 0, 0]),
        Near::Column => (2, [at(-1, 0), at(1, 0), 0, 0]),
        Near::Corners => (4, [at(-1, -1), at(-1, 1), at(1, -1), at(1, 1)]),
    }
}

/// Checks that a mosaic has the values of its shape, and at least 2x2 pixels.
pub(crate) fn check_mosaic(len: usize, height: usize, width: usize) -> Result<(), SensorError> {
    if len == height * width && height >= 2 && width >= 2 {
        return Ok(());
    }
    let got = format!("{len} values for {height}x{width}");
    Err(SensorError::shape("mosaic", "height x width values, at least 2x2 pixels", got))
}
