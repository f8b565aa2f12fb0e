//! Menon, Andriani, Calvagno, "Demosaicing with directional filtering and a posteriori decision", IEEE Trans. Image Processing 16(1),
//! 2007, with its refining step.
//!
//! Green is interpolated along the rows and along the columns. The direction in which the colour differences (measured minus green)
//! vary less is taken, pixel by pixel; red and blue follow along it. At the end, the high frequencies of all colours are made alike.

use super::tile::{Plane, Site, Tile};
use crate::image::CHANNELS;

pub fn interpolate(tile: &Tile) -> [Vec<f32>; CHANNELS] {
    let s = tile.mosaic.stride;
    let mosaic = &tile.mosaic.data;
    let mean = |plane: &[f32], i: usize, step: usize| 0.5 * (plane[i - step] + plane[i + step]);

    // Colour differences with green from the row (step 1) and from the column (step s).
    let difference = |step: usize| {
        let mut out = Plane::zeros(tile);
        tile.each(2, |site, i| {
            if !site.is_green() {
                // Green: the mean of its neighbours, corrected by the Laplacian of the measured colour.
                let laplacian = 0.5 * mosaic[i] - 0.25 * (mosaic[i - 2 * step] + mosaic[i + 2 * step]);
                out.data[i] = mosaic[i] - (mean(mosaic, i, step) + laplacian);
            }
        });
        out.data
    };
    let (along_row, along_col) = (difference(1), difference(s));
    // How much a difference varies around a pixel, along its own direction: the variations that straddle the pixel count three times, those
    // of two rows (columns) away and those of the other colour beside them once.
    let variation = |of: &[f32], step: usize, across: usize, i: usize| {
        let d = |k: usize| (of[k] - of[k + 2 * step]).abs();
        let pair = |k: usize| d(k) + d(k - 2 * step);
        3.0 * pair(i)
            + pair(i - 2 * across)
            + pair(i + 2 * across)
            + d(i - across - step)
            + d(i + across - step)
    };
    let mut green = tile.mosaic.clone();
    let mut is_along_row = vec![false; mosaic.len()];
    tile.each(6, |site, i| {
        if !site.is_green() {
            is_along_row[i] = variation(&along_col, s, 1, i) >= variation(&along_row, 1, s, i);
            green.data[i] = mosaic[i] - if is_along_row[i] { along_row[i] } else { along_col[i] };
        }
    });
    let step_of = |i: usize| if is_along_row[i] { 1 } else { s };

    // Red and blue at green: along the row or the column in which they were measured.
    let [mut red, mut blue] = [tile.mosaic.clone(), tile.mosaic.clone()];
    tile.each(7, |site, i| {
        let step = match site {
            Site::GreenByRed => [1, s],
            Site::GreenByBlue => [s, 1],
            _ => return,
        };
        let difference = |step: usize| mean(mosaic, i, step) - mean(&green.data, i, step);
        red.data[i] = green.data[i] + difference(step[0]);
        blue.data[i] = green.data[i] + difference(step[1]);
    });
    // Red at blue and blue at red: along the chosen direction, in which both are known now.
    tile.each(8, |site, i| {
        let step = step_of(i);
        let other = mosaic[i];
        match site {
            Site::Red => blue.data[i] = other + mean(&blue.data, i, step) - mean(&red.data, i, step),
            Site::Blue => red.data[i] = other + mean(&red.data, i, step) - mean(&blue.data, i, step),
            _ => {}
        }
    });

    // Refine green at red and blue: the low-pass of the colour difference along the chosen direction in place of the difference.
    let third = |a: &[f32], b: &[f32], i: usize, step: usize| {
        (a[i - step] - b[i - step] + a[i] - b[i] + a[i + step] - b[i + step]) / 3.0
    };
    let before = green.clone();
    tile.each(9, |site, i| match site {
        Site::Red => green.data[i] = red.data[i] - third(&red.data, &before.data, i, step_of(i)),
        Site::Blue => green.data[i] = blue.data[i] - third(&blue.data, &before.data, i, step_of(i)),
        _ => {}
    });
    // Refine red and blue at green by the mean difference of the measured neighbours.
    tile.each(10, |site, i| {
        let step = match site {
            Site::GreenByRed => [1, s],
            Site::GreenByBlue => [s, 1],
            _ => return,
        };
        red.data[i] = green.data[i] + mean(&red.data, i, step[0]) - mean(&green.data, i, step[0]);
        blue.data[i] = green.data[i] + mean(&blue.data, i, step[1]) - mean(&green.data, i, step[1]);
    });
    // Refine red at blue and blue at red by the low-pass of red minus blue along the chosen direction.
    let (red_before, blue_before) = (red.clone(), blue.clone());
    tile.each(11, |site, i| {
        let low = |i| third(&red_before.data, &blue_before.data, i, step_of(i));
        match site {
            Site::Red => blue.data[i] = red_before.data[i] - low(i),
            Site::Blue => red.data[i] = blue_before.data[i] + low(i),
            _ => {}
        }
    });
    [red, green, blue].map(|plane| tile.inside(&plane))
}
