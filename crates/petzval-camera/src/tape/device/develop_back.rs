//! The transposes of linear development on a device. Every pixel gathers what its neighbours give back.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;

use super::bordered::{BARS, BORDER, NUMBERS, Place, Sizes, Step, colour, is_within, margin_of, place};
use crate::develop::Demosaic;
use crate::image::CHANNELS;

/// Cotangents of the interpolated planes from those of the picture, in a border of zeros; that of the mosaic is zero.
#[cube(launch)]
pub fn begin_back(
    d_picture: &[f32],
    planes: &[f32],
    numbers: &[f32],
    bars: &mut [f32],
    sizes: Sizes,
    #[comptime] is_stabilised: bool,
) {
    let at = ABSOLUTE_POS;
    let stride = sizes.width + 2 * BORDER;
    let rows = sizes.height + 2 * BORDER;
    let plane = rows * stride;
    if at < bars.len() / BARS {
        let frame = at / plane;
        let i = at % plane;
        let row = i / stride;
        let col = i % stride;
        let is_inside =
            row >= BORDER && row < sizes.height + BORDER && col >= BORDER && col < sizes.width + BORDER;
        for c in 0..CHANNELS {
            let mut bar = 0.0f32;
            if is_inside {
                let of = (frame * CHANNELS + c) * sizes.height + row - BORDER;
                bar = d_picture[of * sizes.width + col - BORDER];
                if comptime!(is_stabilised) {
                    // The slope of the square that takes values back to light.
                    let root = (0.25f32 * numbers[frame * NUMBERS + 4]).sqrt();
                    bar *= 2.0f32 * max(planes[(frame * CHANNELS + c) * plane + i], root);
                }
            }
            bars[(frame * BARS + c) * plane + i] = bar;
        }
        bars[(frame * BARS + CHANNELS) * plane + i] = 0.0f32;
    }
}

/// The cotangent that a red or blue neighbour of a green pixel gives back, if its direction points here: own colour's plane of the
/// neighbour is `from`.
#[cube]
fn pointed(
    place: &Place,
    steps: &[f32],
    bars: &[f32],
    row: usize,
    col: usize,
    is_column: bool,
    plane: usize,
    margin: usize,
) -> f32 {
    let mut bar = 0.0f32;
    if is_within(place, row, col, margin) {
        let i = row * place.stride + col;
        let is_along_col = steps[place.frame * place.plane + i] > 0.5f32;
        if is_along_col == is_column {
            bar = bars[plane + i];
        }
    }
    bar
}

/// A cotangent, zero outside the margin.
#[cube]
fn within(place: &Place, bars: &[f32], row: usize, col: usize, plane: usize, margin: usize) -> f32 {
    let mut bar = 0.0f32;
    if is_within(place, row, col, margin) {
        bar = bars[plane + row * place.stride + col];
    }
    bar
}

/// The transpose of one step of Menon's method: every pixel gathers from its neighbours.
#[cube(launch)]
pub fn step_back(
    words: &[u32],
    steps: &[f32],
    bars: &[f32],
    out: &mut [f32],
    sizes: Sizes,
    #[comptime] step: Step,
) {
    let at = ABSOLUTE_POS;
    if at < steps.len() {
        let place = place(at, words, &sizes);
        let margin = comptime!(margin_of(step));
        let red = place.frame * BARS * place.plane;
        let green = red + place.plane;
        let blue = green + place.plane;
        let i = place.i;
        let mut d_red = bars[red + i];
        let mut d_green = bars[green + i];
        let mut d_blue = bars[blue + i];
        let mut d_mosaic = bars[blue + place.plane + i];
        let is_green = place.in_red_row != place.in_red_col;
        let is_own = is_within(&place, place.row, place.col, margin);
        // Nothing is given back to the outermost pixels: no step begins beside them.
        if is_within(&place, place.row, place.col, 2) {
            let up = place.row - 1;
            let down = place.row + 1;
            let left = place.col - 1;
            let right = place.col + 1;
            if comptime!(matches!(step, Step::RefinedChroma | Step::ChromaAtGreen)) {
                if is_green {
                    if is_own {
                        d_green += d_red + d_blue;
                        d_red = 0.0f32;
                        d_blue = 0.0f32;
                    }
                } else {
                    // The four green neighbours took this pixel's colour from it.
                    let own = select(place.in_red_row, red, blue);
                    let half = 0.5f32
                        * (within(&place, bars, place.row, left, own, margin)
                            + within(&place, bars, place.row, right, own, margin)
                            + within(&place, bars, up, place.col, own, margin)
                            + within(&place, bars, down, place.col, own, margin));
                    d_green -= half;
                    if comptime!(matches!(step, Step::ChromaAtGreen)) {
                        d_mosaic += half;
                    } else if place.in_red_row {
                        d_red += half;
                    } else {
                        d_blue += half;
                    }
                }
            } else if is_green {
                // Neighbours in this row are red where the row is one of red; those in the column are the others. What they gave is the
                // cotangent of their green, or of the colour that they did not measure.
                let is_of_green = comptime!(matches!(step, Step::RefinedGreen | Step::Green));
                let own_in_row = select(place.in_red_row, red, blue);
                let own_in_col = select(place.in_red_row, blue, red);
                let mut from_row = green;
                let mut from_col = green;
                if comptime!(!is_of_green) {
                    from_row = own_in_col;
                    from_col = own_in_row;
                }
                let by_row = pointed(&place, steps, bars, place.row, left, false, from_row, margin)
                    + pointed(&place, steps, bars, place.row, right, false, from_row, margin);
                let by_col = pointed(&place, steps, bars, up, place.col, true, from_col, margin)
                    + pointed(&place, steps, bars, down, place.col, true, from_col, margin);
                let of_red = select(place.in_red_row, by_row, by_col);
                let of_blue = select(place.in_red_row, by_col, by_row);
                // `of_red` comes from red pixels.
                if comptime!(matches!(step, Step::RefinedOpposite)) {
                    d_red += (of_blue - of_red) / 3.0f32;
                    d_blue += (of_red - of_blue) / 3.0f32;
                } else if comptime!(matches!(step, Step::RefinedGreen)) {
                    d_red -= of_red / 3.0f32;
                    d_blue -= of_blue / 3.0f32;
                    d_green += (of_red + of_blue) / 3.0f32;
                } else if comptime!(matches!(step, Step::Opposite)) {
                    d_red += 0.5f32 * (of_blue - of_red);
                    d_blue += 0.5f32 * (of_red - of_blue);
                } else {
                    d_mosaic += 0.5f32 * (of_red + of_blue);
                }
            } else {
                if is_own {
                    let other = select(place.in_red_row, d_blue, d_red);
                    let mut to_own = 0.0f32;
                    if comptime!(matches!(step, Step::RefinedOpposite)) {
                        to_own = other - other / 3.0f32;
                        if place.in_red_row {
                            d_blue = other / 3.0f32;
                        } else {
                            d_red = other / 3.0f32;
                        }
                    } else if comptime!(matches!(step, Step::RefinedGreen)) {
                        to_own = d_green - d_green / 3.0f32;
                        d_green /= 3.0f32;
                    } else if comptime!(matches!(step, Step::Opposite)) {
                        d_mosaic += other;
                        if place.in_red_row {
                            d_blue = 0.0f32;
                        } else {
                            d_red = 0.0f32;
                        }
                    } else {
                        d_mosaic += 0.5f32 * d_green;
                        d_green = 0.0f32;
                    }
                    if place.in_red_row {
                        d_red += to_own;
                    } else {
                        d_blue += to_own;
                    }
                }
                if comptime!(matches!(step, Step::Green)) {
                    // The Laplacian of the pixels two steps away.
                    let far = pointed(&place, steps, bars, place.row, place.col - 2, false, green, margin)
                        + pointed(&place, steps, bars, place.row, place.col + 2, false, green, margin)
                        + pointed(&place, steps, bars, place.row - 2, place.col, true, green, margin)
                        + pointed(&place, steps, bars, place.row + 2, place.col, true, green, margin);
                    d_mosaic -= 0.25f32 * far;
                }
            }
        }
        out[red + i] = d_red;
        out[green + i] = d_green;
        out[blue + i] = d_blue;
        out[blue + place.plane + i] = d_mosaic;
    }
}

/// The cotangent of the bordered mosaic: its own colour's, and what the steps of Menon's method gave it or what neighbours took by the
/// other methods.
#[cube(launch)]
pub fn measured_back(
    words: &[u32],
    bars: &[f32],
    d_mosaic: &mut [f32],
    sizes: Sizes,
    #[comptime] demosaic: Demosaic,
) {
    let at = ABSOLUTE_POS;
    if at < d_mosaic.len() {
        let place = place(at, words, &sizes);
        let first = place.frame * BARS * place.plane;
        let own = first + colour(place.in_red_row, place.in_red_col) * place.plane;
        let i = own + place.i;
        let s = place.stride;
        let is_green = place.in_red_row != place.in_red_col;
        let mut sum = bars[i];
        if comptime!(demosaic == Demosaic::Menon) {
            sum += bars[first + CHANNELS * place.plane + place.i];
        } else if is_within(&place, place.row, place.col, 2) {
            // Cotangents are zero in the border: what is beyond two pixels of the edge of the frame gives nothing back.
            let edges = bars[i - 1] + bars[i + 1] + bars[i - s] + bars[i + s];
            let corners = bars[i - s - 1] + bars[i - s + 1] + bars[i + s - 1] + bars[i + s + 1];
            if comptime!(demosaic == Demosaic::Bilinear) {
                sum += select(is_green, 0.25f32 * edges, 0.5f32 * edges + 0.25f32 * corners);
            } else {
                // The planes of the row's and of the column's colour; at red and blue, of the own and of the opposite one.
                let red = first + place.i;
                let blue = red + 2 * place.plane;
                let row = select(place.in_red_row, red, blue);
                let col = select(place.in_red_row, blue, red);
                let row_h = bars[row - 2] + bars[row + 2];
                let row_v = bars[row - 2 * s] + bars[row + 2 * s];
                let col_h = bars[col - 2] + bars[col + 2];
                let col_v = bars[col - 2 * s] + bars[col + 2 * s];
                if is_green {
                    let others = bars[row - s - 1]
                        + bars[row - s + 1]
                        + bars[row + s - 1]
                        + bars[row + s + 1]
                        + bars[col - s - 1]
                        + bars[col - s + 1]
                        + bars[col + s - 1]
                        + bars[col + s + 1];
                    sum += 0.625f32 * (bars[row] + bars[col]) + 0.25f32 * edges - 0.125f32 * others;
                    sum += 0.0625f32 * (col_h + row_v) - 0.125f32 * (row_h + col_v);
                } else {
                    let green = red + place.plane;
                    let far = bars[green - 2] + bars[green + 2] + bars[green - 2 * s] + bars[green + 2 * s];
                    sum += 0.5f32 * bars[green] + 0.75f32 * bars[col] + 0.5f32 * edges + 0.25f32 * corners;
                    sum -= 0.125f32 * far + 0.1875f32 * (col_h + col_v);
                }
            }
        }
        d_mosaic[at] = sum;
    }
}

/// The cotangent of each digital number: its pixel's, and those of the border that mirrors it.
#[cube(launch)]
pub fn fold(
    d_mosaic: &[f32],
    mosaic: &[f32],
    numbers: &[f32],
    words: &[u32],
    d_raw: &mut [f32],
    sizes: Sizes,
    #[comptime] is_stabilised: bool,
) {
    let at = ABSOLUTE_POS;
    if at < d_raw.len() {
        let stride = sizes.width + 2 * BORDER;
        let rows = sizes.height + 2 * BORDER;
        let col = at % sizes.width;
        let row = at / sizes.width % sizes.height;
        let frame = at / (sizes.width * sizes.height);
        let base = frame * rows * stride;
        let down = 2 * (sizes.height - 1);
        let across = 2 * (sizes.width - 1);
        let mut sum = 0.0f32;
        // A pixel is seen once in each direction of a period; the outermost ones only once.
        for row_way in 0..2u32 {
            let mut r = (row + BORDER) % down;
            if row_way == 1u32 {
                r = (BORDER + BORDER * down - row) % down;
            }
            if row_way == 0u32 || (row != 0 && row != sizes.height - 1) {
                while r < rows {
                    for col_way in 0..2u32 {
                        let mut c = (col + BORDER) % across;
                        if col_way == 1u32 {
                            c = (BORDER + BORDER * across - col) % across;
                        }
                        if col_way == 0u32 || (col != 0 && col != sizes.width - 1) {
                            while c < stride {
                                sum += d_mosaic[base + r * stride + c];
                                c += across;
                            }
                        }
                    }
                    r += down;
                }
            }
        }
        let in_red_row = row % 2 == words[2 * frame] as usize;
        let in_red_col = col % 2 == words[2 * frame + 1] as usize;
        let of = frame * NUMBERS;
        if comptime!(is_stabilised) {
            // The slope of the root, by the root itself: 1 / (2 root), and no steeper than where its straight line begins.
            let root = mosaic[base + (row + BORDER) * stride + col + BORDER];
            sum /= 2.0f32 * max(root, (0.25f32 * numbers[of + 4]).sqrt());
        }
        d_raw[at] = sum * numbers[of + 1 + colour(in_red_row, in_red_col)];
    }
}
