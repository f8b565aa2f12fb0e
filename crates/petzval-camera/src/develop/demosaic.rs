//! Bilinear demosaicing: the mean of the nearest pixels that saw the colour. Arrays that are not Bayer's go to [`super::interpolation`].

use rayon::prelude::*;

use super::interpolation::Interpolation;
use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;
use crate::sensor::{CfaPattern, SensorError};

/// Fills in the colours that each pixel did not see, from a mosaic whose top-left pixel is at `placement`.
///
/// Of a Bayer array, green: the mean of the four edge neighbours; red and blue: of the two or four nearest of their colour. Borders
/// mirror about the outermost pixel, which keeps the phase of the mosaic. At least 2x2 pixels.
///
/// Of any other array: linear interpolation between the nearest pixels that saw the colour, along the row, the column or both;
/// a colour that the array does not have comes from its clear pixels. At least one tile. The border is not mirrored.
pub fn demosaic_bilinear(
    mosaic: &[f32],
    height: usize,
    width: usize,
    cfa: CfaPattern,
    placement: Placement,
) -> Result<LinearImage, SensorError> {
    check(mosaic.len(), height, width)?;
    if !cfa.is_bayer() {
        return Ok(Interpolation::new(cfa, placement, height, width)?.fill(mosaic, height, width));
    }
    let mut out = LinearImage::zeros(CHANNELS, height, width);
    out.data.par_chunks_exact_mut(width).enumerate().for_each(|(line, values)| {
        let (channel, row) = (line / height, line % height);
        for (col, value) in values.iter_mut().enumerate() {
            let (count, near) = neighbours(cfa, placement, channel, row, col, height, width);
            *value = near[..count].iter().map(|&i| mosaic[i]).sum::<f32>() / count as f32;
        }
    });
    Ok(out)
}

/// Transpose of [`demosaic_bilinear`]: gradient with respect to the mosaic.
pub fn demosaic_bilinear_adjoint(
    d_rgb: &LinearImage,
    cfa: CfaPattern,
    placement: Placement,
) -> Result<Vec<f32>, SensorError> {
    let (height, width) = (d_rgb.height, d_rgb.width);
    if d_rgb.channels != CHANNELS || d_rgb.data.len() != CHANNELS * height * width {
        let got = format!("{} planes, {} values", d_rgb.channels, d_rgb.data.len());
        return Err(SensorError::Shape {
            what: "gradient of the developed picture",
            expected: "3 planes".into(),
            got,
        });
    }
    check(height * width, height, width)?;
    if !cfa.is_bayer() {
        return Ok(Interpolation::new(cfa, placement, height, width)?.gather(d_rgb));
    }
    // Each colour hands its gradient to the pixels it came from; the three add up in order.
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

/// The pixels whose mean gives `channel` at `(row, col)`: how many, and their indices in the mosaic.
fn neighbours(
    cfa: CfaPattern,
    placement: Placement,
    channel: usize,
    row: usize,
    col: usize,
    height: usize,
    width: usize,
) -> (usize, [usize; 4]) {
    let mirror = |i: usize, step: isize, len: usize| match (i, step) {
        (0, -1) => 1,
        (i, 1) if i + 1 == len => len - 2,
        (i, step) => i.wrapping_add_signed(step),
    };
    let at = |dr: isize, dc: isize| mirror(row, dr, height) * width + mirror(col, dc, width);
    let colour =
        |dr: usize, dc: usize| cfa.colour(placement.row + row + dr, placement.col + col + dc).plane();
    let channel = Some(channel);
    // Phases repeat every two pixels, so the next row and column stand for both sides.
    if colour(0, 0) == channel {
        (1, [at(0, 0), 0, 0, 0])
    } else if channel == Some(1) {
        (4, [at(-1, 0), at(0, -1), at(0, 1), at(1, 0)])
    } else if colour(0, 1) == channel {
        (2, [at(0, -1), at(0, 1), 0, 0])
    } else if colour(1, 0) == channel {
        (2, [at(-1, 0), at(1, 0), 0, 0])
    } else {
        (4, [at(-1, -1), at(-1, 1), at(1, -1), at(1, 1)])
    }
}

fn check(len: usize, height: usize, width: usize) -> Result<(), SensorError> {
    if len == height * width && height >= 2 && width >= 2 {
        return Ok(());
    }
    let got = format!("{len} values for {height}x{width}");
    Err(SensorError::Shape {
        what: "mosaic",
        expected: "height x width values, at least 2x2 pixels".into(),
        got,
    })
}
