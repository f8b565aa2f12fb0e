//! Malvar, He, Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color images", ICASSP 2004.
//!
//! The bilinear value of a colour is corrected by the Laplacian of the measured colour. The gain is 1/2 for green at red and blue, 5/8 for
//! red and blue at green, and 3/4 for red at blue and blue at red. All weights are multiples of 1/16.

use super::tile::{Plane, Site, Tile};
use crate::image::CHANNELS;

/// The strip of a picture.
pub fn interpolate(tile: &Tile) -> [Vec<f32>; CHANNELS] {
    let s = tile.mosaic.stride;
    let v = &tile.mosaic.data;
    let [mut red, mut green, mut blue] = [(); CHANNELS].map(|()| Plane::zeros(tile));
    tile.each(2, |site, i| {
        let here = v[i];
        let cross = v[i - 1] + v[i + 1] + v[i - s] + v[i + s];
        let diagonal = v[i - s - 1] + v[i - s + 1] + v[i + s - 1] + v[i + s + 1];
        let (far_h, far_v) = (v[i - 2] + v[i + 2], v[i - 2 * s] + v[i + 2 * s]);
        if site.is_green() {
            let along_row = (5.0 * here + 4.0 * (v[i - 1] + v[i + 1]) - diagonal - far_h + 0.5 * far_v) / 8.0;
            let along_col = (5.0 * here + 4.0 * (v[i - s] + v[i + s]) - diagonal - far_v + 0.5 * far_h) / 8.0;
            let by_red = site == Site::GreenByRed;
            red.data[i] = if by_red { along_row } else { along_col };
            blue.data[i] = if by_red { along_col } else { along_row };
            green.data[i] = here;
        } else {
            green.data[i] = (4.0 * here + 2.0 * cross - far_h - far_v) / 8.0;
            let opposite = (6.0 * here + 2.0 * diagonal - 1.5 * (far_h + far_v)) / 8.0;
            let is_red = site == Site::Red;
            red.data[i] = if is_red { here } else { opposite };
            blue.data[i] = if is_red { opposite } else { here };
        }
    });
    [red, green, blue].map(|plane| tile.inside(&plane))
}

/// The transpose of [`interpolate`]: the cotangent of the mosaic and its border from those of the picture.
pub fn adjoint(tile: &Tile, bars: [Plane; CHANNELS]) -> Plane {
    let s = tile.mosaic.stride;
    let mut out = Plane::zeros(tile);
    let m = &mut out.data;
    let add = |m: &mut [f32], places: [usize; 4], value: f32| places.into_iter().for_each(|i| m[i] += value);
    tile.each(2, |site, i| {
        let [red, green, blue] = [0, 1, 2].map(|c: usize| bars[c].data[i]);
        let diagonal = [i - s - 1, i - s + 1, i + s - 1, i + s + 1];
        if site.is_green() {
            let by_red = site == Site::GreenByRed;
            let (along_row, along_col) = if by_red { (red, blue) } else { (blue, red) };
            m[i] += green + 0.625 * (along_row + along_col);
            add(m, [i - 1, i + 1, i - 1, i + 1], 0.25 * along_row);
            add(m, [i - s, i + s, i - s, i + s], 0.25 * along_col);
            add(m, diagonal, -0.125 * (along_row + along_col));
            for far in [i - 2, i + 2] {
                m[far] += -0.125 * along_row + 0.0625 * along_col;
            }
            for far in [i - 2 * s, i + 2 * s] {
                m[far] += 0.0625 * along_row - 0.125 * along_col;
            }
        } else {
            let (same, opposite) = if site == Site::Red { (red, blue) } else { (blue, red) };
            m[i] += same + 0.5 * green + 0.75 * opposite;
            add(m, [i - 1, i + 1, i - s, i + s], 0.25 * green);
            add(m, diagonal, 0.25 * opposite);
            add(m, [i - 2, i + 2, i - 2 * s, i + 2 * s], -0.125 * green - 0.1875 * opposite);
        }
    });
    out
}
