//! Ratio-corrected demosaicing (Sanz Rodriguez 2017). Green follows from the ratio of a pixel's low-pass to that of its neighbour, red and
//! blue from colour differences. Every value is estimated along two directions. The two estimates are mixed by how much the mosaic varies
//! along each direction.

use super::tile::{Plane, Site, Tile};
use crate::image::CHANNELS;

/// Keeps quotients finite where a picture is flat.
const EPSILON: f32 = 1e-5;

/// The strip of a picture.
pub fn interpolate(tile: &Tile) -> [Vec<f32>; CHANNELS] {
    let s = tile.mosaic.stride;
    let v = &tile.mosaic.data;

    // Share of the variation along `one` in that along both directions: squares of a sixth-order high-pass at three pixels.
    let share = |one: usize, other: usize, margin: usize| {
        let mut out = Plane::zeros(tile);
        tile.each(margin, |_, i| {
            let high = |i: usize, d: usize| {
                let near = v[i - d] + v[i + d];
                let far = v[i - 3 * d] + v[i + 3 * d];
                (far - near - 3.0 * (v[i - 2 * d] + v[i + 2 * d]) + 6.0 * v[i]).powi(2)
            };
            let along = |d: usize| (high(i - d, d) + high(i, d) + high(i + d, d)).max(EPSILON * EPSILON);
            let (first, second) = (along(one), along(other));
            out.data[i] = first / (first + second);
        });
        out.data
    };
    // The share of a pixel, or the mean of its diagonal neighbours where that is further from one half.
    let decided = |shares: &[f32], i: usize| {
        let around = 0.25 * (shares[i - s - 1] + shares[i - s + 1] + shares[i + s - 1] + shares[i + s + 1]);
        if (0.5 - shares[i]).abs() < (0.5 - around).abs() { around } else { shares[i] }
    };
    let by_column = share(s, 1, 4);
    let mut low = Plane::zeros(tile);
    tile.each(1, |_, i| {
        low.data[i] = 0.25 * v[i]
            + 0.125 * (v[i - 1] + v[i + 1] + v[i - s] + v[i + s])
            + 0.0625 * (v[i - s - 1] + v[i - s + 1] + v[i + s - 1] + v[i + s + 1]);
    });
    // Green at red and blue.
    let mut green = tile.mosaic.clone();
    tile.each(5, |site, i| {
        if site.is_green() {
            return;
        }
        // The estimate from the neighbour at `i + d`, and the variation on that side; `at` steps along the direction.
        let side = |d: isize| {
            let at = |k: isize| i.wrapping_add_signed(k * d);
            let variation = EPSILON
                + (v[at(1)] - v[at(-1)]).abs()
                + (v[i] - v[at(2)]).abs()
                + (v[at(1)] - v[at(3)]).abs()
                + (v[at(2)] - v[at(4)]).abs();
            let (here, there) = (low.data[i], low.data[at(2)]);
            (v[at(1)] * (1.0 + (here - there) / (EPSILON + here.abs() + there.abs())), variation)
        };
        green.data[i] = of_four_sides(side, [s as isize, 1], decided(&by_column, i));
    });
    let g = &green.data;

    // Red at blue and blue at red, along the diagonals.
    let falling = share(s + 1, s - 1, 4);
    let [mut red, mut blue] = [tile.mosaic.clone(), tile.mosaic.clone()];
    tile.each(8, |site, i| {
        if site.is_green() {
            return;
        }
        let side = |d: isize| {
            let at = |k: isize| i.wrapping_add_signed(k * d);
            let variation = EPSILON
                + (v[at(1)] - v[at(-1)]).abs()
                + (v[at(1)] - v[at(3)]).abs()
                + (g[i] - g[at(2)]).abs();
            (v[at(1)] - g[at(1)], variation)
        };
        let value = g[i] + of_four_sides(side, [s as isize + 1, s as isize - 1], decided(&falling, i));
        match site {
            Site::Red => blue.data[i] = value,
            _ => red.data[i] = value,
        }
    });
    // Red and blue at green.
    let (red_known, blue_known) = (red.clone(), blue.clone());
    tile.each(11, |site, i| {
        if !site.is_green() {
            return;
        }
        let weight = decided(&by_column, i);
        let colour = |c: &[f32]| {
            let side = |d: isize| {
                let at = |k: isize| i.wrapping_add_signed(k * d);
                let variation = EPSILON
                    + (g[i] - g[at(2)]).abs()
                    + (c[at(1)] - c[at(-1)]).abs()
                    + (c[at(1)] - c[at(3)]).abs();
                (c[at(1)] - g[at(1)], variation)
            };
            g[i] + of_four_sides(side, [s as isize, 1], weight)
        };
        red.data[i] = colour(&red_known.data);
        blue.data[i] = colour(&blue_known.data);
    });
    [red, green, blue].map(|plane| tile.inside(&plane))
}

/// The value between the estimates of four neighbours: along each of two directions the opposite ones, each weighted by the variation on
/// the other side, and of the second direction the share `weight`. `side` gives estimate and variation of the neighbour at a step.
fn of_four_sides(side: impl Fn(isize) -> (f32, f32), steps: [isize; 2], weight: f32) -> f32 {
    let [first, second] = steps.map(|step| {
        let ((a, of_a), (b, of_b)) = (side(-step), side(step));
        (of_b * a + of_a * b) / (of_a + of_b)
    });
    (1.0 - weight) * first + weight * second
}
