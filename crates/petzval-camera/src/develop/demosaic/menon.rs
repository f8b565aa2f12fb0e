//! Menon, Andriani, Calvagno, "Demosaicing with directional filtering and a posteriori decision", IEEE Trans. Image Processing 16(1),
//! 2007, with its refining step.
//!
//! Green is interpolated along the rows and along the columns. The direction in which the colour differences (measured minus green)
//! vary less is taken, pixel by pixel; red and blue follow along it. At the end, the high frequencies of all colours are made alike.

use super::tile::{Plane, Site, Tile};
use crate::image::CHANNELS;

/// Distance from the edge of strip and border at which each step begins: each looks further than the one before it.
const GREEN: usize = 6;
const CHROMA_AT_GREEN: usize = 7;
const OPPOSITE: usize = 8;
const REFINED_GREEN: usize = 9;
const REFINED_CHROMA: usize = 10;
const REFINED_OPPOSITE: usize = 11;

/// The strip of a picture.
pub fn interpolate(tile: &Tile) -> [Vec<f32>; CHANNELS] {
    let steps = directions(tile);
    let s = tile.mosaic.stride;
    let mosaic = &tile.mosaic.data;
    let mean = |plane: &[f32], i: usize, step: usize| 0.5 * (plane[i - step] + plane[i + step]);

    // Green at red and blue: the mean of its neighbours along the direction, corrected by the Laplacian of the measured colour.
    let mut green = tile.mosaic.clone();
    tile.each(GREEN, |site, i| {
        if !site.is_green() {
            let step = steps[i];
            let laplacian = 0.5 * mosaic[i] - 0.25 * (mosaic[i - 2 * step] + mosaic[i + 2 * step]);
            green.data[i] = mean(mosaic, i, step) + laplacian;
        }
    });
    // Red and blue at green: along the row or the column in which they were measured.
    let [mut red, mut blue] = [tile.mosaic.clone(), tile.mosaic.clone()];
    tile.each(CHROMA_AT_GREEN, |site, i| {
        let Some([of_red, of_blue]) = site.chroma_steps(s) else { return };
        red.data[i] = green.data[i] + mean(mosaic, i, of_red) - mean(&green.data, i, of_red);
        blue.data[i] = green.data[i] + mean(mosaic, i, of_blue) - mean(&green.data, i, of_blue);
    });
    // Red at blue and blue at red: along the chosen direction, in which both are known now.
    tile.each(OPPOSITE, |site, i| {
        let (here, step) = (mosaic[i], steps[i]);
        match site {
            Site::Red => blue.data[i] = here + mean(&blue.data, i, step) - mean(&red.data, i, step),
            Site::Blue => red.data[i] = here + mean(&red.data, i, step) - mean(&blue.data, i, step),
            _ => {}
        }
    });

    // Refine green at red and blue by the low-pass of the colour difference along the chosen direction.
    let third = |a: &[f32], b: &[f32], i: usize, step: usize| {
        (a[i - step] - b[i - step] + a[i] - b[i] + a[i + step] - b[i + step]) / 3.0
    };
    let before = green.clone();
    tile.each(REFINED_GREEN, |site, i| match site {
        Site::Red => green.data[i] = red.data[i] - third(&red.data, &before.data, i, steps[i]),
        Site::Blue => green.data[i] = blue.data[i] - third(&blue.data, &before.data, i, steps[i]),
        _ => {}
    });
    // Refine red and blue at green by the mean difference of the measured neighbours.
    tile.each(REFINED_CHROMA, |site, i| {
        let Some([of_red, of_blue]) = site.chroma_steps(s) else { return };
        red.data[i] = green.data[i] + mean(&red.data, i, of_red) - mean(&green.data, i, of_red);
        blue.data[i] = green.data[i] + mean(&blue.data, i, of_blue) - mean(&green.data, i, of_blue);
    });
    // Refine red at blue and blue at red by the low-pass of red minus blue along the chosen direction.
    let (red_before, blue_before) = (red.clone(), blue.clone());
    tile.each(REFINED_OPPOSITE, |site, i| {
        let low = || third(&red_before.data, &blue_before.data, i, steps[i]);
        match site {
            Site::Red => blue.data[i] = red_before.data[i] - low(),
            Site::Blue => red.data[i] = blue_before.data[i] + low(),
            _ => {}
        }
    });
    [red, green, blue].map(|plane| tile.inside(&plane))
}

/// The transpose of [`interpolate`] at fixed directions: the cotangent of the mosaic and its border from those of the picture. The steps
/// are those of the interpolation in reverse order.
pub fn adjoint(tile: &Tile, bars: [Plane; CHANNELS]) -> Plane {
    let steps = directions(tile);
    let s = tile.mosaic.stride;
    let mut mosaic = Plane::zeros(tile);
    let [mut red, mut green, mut blue] = bars.map(|plane| plane.data);
    // Adds a share of a cotangent to both neighbours.
    let both = |plane: &mut [f32], i: usize, step: usize, value: f32| {
        plane[i - step] += value;
        plane[i + step] += value;
    };
    tile.each(REFINED_OPPOSITE, |site, i| {
        let (same, opposite) = match site {
            Site::Red => (&mut red, &mut blue),
            Site::Blue => (&mut blue, &mut red),
            _ => return,
        };
        let d = std::mem::take(&mut opposite[i]);
        same[i] += d - d / 3.0;
        opposite[i] += d / 3.0;
        both(same, i, steps[i], -d / 3.0);
        both(opposite, i, steps[i], d / 3.0);
    });
    let of_chroma_at_green = |colour: &mut Vec<f32>, green: &mut Vec<f32>, i: usize, step: usize| {
        let d = std::mem::take(&mut colour[i]);
        green[i] += d;
        both(green, i, step, -0.5 * d);
        d
    };
    tile.each(REFINED_CHROMA, |site, i| {
        let Some(chroma) = site.chroma_steps(s) else { return };
        for (colour, step) in [&mut red, &mut blue].into_iter().zip(chroma) {
            let d = of_chroma_at_green(colour, &mut green, i, step);
            both(colour, i, step, 0.5 * d);
        }
    });
    tile.each(REFINED_GREEN, |site, i| {
        let colour = match site {
            Site::Red => &mut red,
            Site::Blue => &mut blue,
            _ => return,
        };
        let d = std::mem::take(&mut green[i]);
        colour[i] += d - d / 3.0;
        green[i] += d / 3.0;
        both(colour, i, steps[i], -d / 3.0);
        both(&mut green, i, steps[i], d / 3.0);
    });
    tile.each(OPPOSITE, |site, i| {
        let (same, opposite) = match site {
            Site::Red => (&mut red, &mut blue),
            Site::Blue => (&mut blue, &mut red),
            _ => return,
        };
        let d = std::mem::take(&mut opposite[i]);
        mosaic.data[i] += d;
        both(opposite, i, steps[i], 0.5 * d);
        both(same, i, steps[i], -0.5 * d);
    });
    tile.each(CHROMA_AT_GREEN, |site, i| {
        let Some(chroma) = site.chroma_steps(s) else { return };
        for (colour, step) in [&mut red, &mut blue].into_iter().zip(chroma) {
            let d = of_chroma_at_green(colour, &mut green, i, step);
            both(&mut mosaic.data, i, step, 0.5 * d);
        }
    });
    tile.each(GREEN, |site, i| {
        if !site.is_green() {
            let d = std::mem::take(&mut green[i]);
            mosaic.data[i] += 0.5 * d;
            both(&mut mosaic.data, i, steps[i], 0.5 * d);
            both(&mut mosaic.data, i, 2 * steps[i], -0.25 * d);
        }
    });
    // What was measured.
    tile.each(0, |site, i| {
        mosaic.data[i] += match site {
            Site::Red => red[i],
            Site::Blue => blue[i],
            _ => green[i],
        }
    });
    mosaic
}

/// The direction of each red and blue pixel, as the step to its neighbour: 1 along the row, the stride along the column.
fn directions(tile: &Tile) -> Vec<usize> {
    let s = tile.mosaic.stride;
    let mosaic = &tile.mosaic.data;
    // Differences of the measured colour from green by the row (step 1) or the column (step s).
    let difference = |step: usize| {
        let mut out = vec![0.0; mosaic.len()];
        tile.each(2, |site, i| {
            if !site.is_green() {
                let green = 0.5 * (mosaic[i - step] + mosaic[i + step]);
                let laplacian = 0.5 * mosaic[i] - 0.25 * (mosaic[i - 2 * step] + mosaic[i + 2 * step]);
                out[i] = mosaic[i] - (green + laplacian);
            }
        });
        out
    };
    let (along_row, along_col) = (difference(1), difference(s));
    // How much a difference varies around a pixel, along its own direction: the variations that straddle the pixel count three times, those
    // of the second rows (columns) beside it and of the other colour between them once.
    let variation = |of: &[f32], step: usize, across: usize, i: usize| {
        let d = |k: usize| (of[k] - of[k + 2 * step]).abs();
        let pair = |k: usize| d(k) + d(k - 2 * step);
        let beside = pair(i - 2 * across) + pair(i + 2 * across);
        3.0 * pair(i) + beside + d(i - across - step) + d(i + across - step)
    };
    let mut steps = vec![1; mosaic.len()];
    tile.each(GREEN, |site, i| {
        if !site.is_green() && variation(&along_col, s, 1, i) < variation(&along_row, 1, s, i) {
            steps[i] = s;
        }
    });
    steps
}
