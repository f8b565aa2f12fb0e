//! Dewarp: the distortion of the lens is undone by the camera's own map.
//!
//! Each pixel of the result is fetched from `pixel + strength * displacement` of the distorted picture, between pixels by cubic
//! convolution (R. G. Keys 1981, a = -1/2). The displacements lie on a mesh of the calibration. Places beyond the
//! picture are those of its edge, around which the picture is mirrored.

use std::sync::Arc;

use burn::prelude::*;

use super::super::fixed::{BLOCK, ColourPixel, ENCODED, Grid, by_blocks, shift_round};
use super::super::mesh::{Axis, spread};
use super::super::tape_grid::{Theta, constant};
use crate::isp::Mesh;
use crate::tape::{Kernel, View, apply};

petzval_base::parameters! {
    /// Correction of distortion.
    pub struct Dewarp {
        /// Share of the displacement that is undone.
        strength: f64 = 1.0, "", 0.0..1.0, Linear, "0 keeps the distortion";
    }
}

/// Bits behind the point of places between pixels, and of displacements.
const PLACE_BITS: u32 = 5;

/// Range of a displacement, [`PLACE_BITS`] behind the point: 16 bits with sign.
const DISPLACEMENT: [f64; 2] = [-32768.0, 32767.0];

/// Bits behind the point of the weights of the four pixels.
const WEIGHT_BITS: u32 = 8;

/// Weights of four neighbouring pixels at `t` behind the second one.
fn weights(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2]
}

/// Derivatives of [`weights`] by `t`.
fn slopes(t: f64) -> [f64; 4] {
    let t2 = t * t;
    [-1.5 * t2 + 2.0 * t - 0.5, 4.5 * t2 - 5.0 * t, -4.5 * t2 + 4.0 * t + 0.5, 1.5 * t2 - t]
}

impl Dewarp {
    /// The largest displacement of a mesh by rows or by columns, and the largest that the stage holds, pixels.
    pub fn furthest_px(&self, mesh: Option<&Mesh>) -> (f64, f64) {
        let values = mesh.into_iter().flat_map(|mesh| &mesh.planes).flatten();
        let furthest = values.fold(0.0_f64, |most, v| most.max(f64::from(v.abs())));
        (self.strength * furthest, -DISPLACEMENT[0] / f64::from(1 << PLACE_BITS))
    }

    /// Encoded values of the three colours.
    pub fn fixed(&self, rgb: [Grid<i16>; 3], mesh: Option<&Mesh>) -> [Grid<i16>; 3] {
        let Some(mesh) = mesh.filter(|_| self.strength > 0.0) else { return rgb };
        let (height, width) = (rgb[0].height, rgb[0].width);
        let (rows, cols) = (Axis::corners(height, mesh.rows), Axis::corners(width, mesh.cols));
        let scale = self.strength * f64::from(1 << PLACE_BITS);
        let whole = |v: &f32| (f64::from(*v) * scale).round().clamp(DISPLACEMENT[0], DISPLACEMENT[1]) as i32;
        let nodes = [0, 1].map(|k: usize| mesh.planes[k].iter().map(whole).collect::<Vec<i32>>());
        // Weights of every place between two pixels; they add up to exactly 1.
        let table: Vec<[i32; 4]> = (0..1 << PLACE_BITS)
            .map(|k| {
                let mut whole = weights(f64::from(k) / f64::from(1 << PLACE_BITS))
                    .map(|w| (w * f64::from(1 << WEIGHT_BITS)).round() as i32);
                whole[1] += (1 << WEIGHT_BITS) - whole.iter().sum::<i32>();
                whole
            })
            .collect();
        // Across, a weight counts for the four numbers of its pixel.
        let across: Vec<[i32; 16]> =
            table.iter().map(|weights| std::array::from_fn(|k| weights[k / 4])).collect();
        let inside = |at: i32, len: usize| at.max(0).min((len as i32 - 1) << PLACE_BITS);
        // The colours of a pixel side by side: one access fetches all of them.
        let colours = Grid::from_rows(
            [height, width],
            #[inline(always)]
            |row, out: &mut [ColourPixel]| {
                let [r, g, b] = rgb.each_ref().map(|grid| grid.around(row, out.len()).at(0, 0));
                for c in 0..out.len() {
                    out[c] = [r[c], g[c], b[c], 0];
                }
            },
        );
        Grid::several_from_rows(
            [height, width],
            #[inline(always)]
            |row, [r, g, b]| {
                let [down, right] =
                    nodes.each_ref().map(|plane| cols.spread_row(&rows.row_of_nodes(plane, row)));
                by_blocks(
                    [r, g, b],
                    #[inline(always)]
                    |pixels, [r, g, b]| {
                        // Places beyond the picture are those of its edge, around which the border mirrors it.
                        let (mut y, mut x) = ([0; BLOCK], [0; BLOCK]);
                        let (down, right) = (&down[pixels.clone()], &right[pixels.clone()]);
                        for c in 0..down.len().min(BLOCK) {
                            y[c] = inside(((row as i32) << PLACE_BITS) + down[c], height);
                            x[c] = inside((((pixels.start + c) as i32) << PLACE_BITS) + right[c], width);
                        }
                        let mut fetched = [[0; 4]; BLOCK];
                        for c in 0..down.len().min(BLOCK) {
                            let of_rows = &table[(y[c] & ((1 << PLACE_BITS) - 1)) as usize];
                            let of_cols = &across[(x[c] & ((1 << PLACE_BITS) - 1)) as usize];
                            let (row, col) = (y[c] >> PLACE_BITS, x[c] >> PLACE_BITS);
                            // Down the four columns, three colours and a gap each, then across: sixteen numbers at a time.
                            let mut columns = [0; 16];
                            for (k, weight) in of_rows.iter().enumerate() {
                                let line = colours.four(row + k as i32 - 1, col).as_flattened();
                                for (sum, value) in columns.iter_mut().zip(line) {
                                    *sum += i32::from(*value) * weight;
                                }
                            }
                            for k in 0..16 {
                                columns[k] = shift_round(columns[k], 4) * of_cols[k];
                            }
                            for k in 0..4 {
                                fetched[c][k] =
                                    columns[k] + columns[4 + k] + columns[8 + k] + columns[12 + k];
                            }
                        }
                        for (c, sums) in fetched.iter().enumerate() {
                            let of = |k: usize| ENCODED.clamp(shift_round(sums[k], 2 * WEIGHT_BITS - 4));
                            (r[c], g[c], b[c]) = (of(0), of(1), of(2));
                        }
                    },
                );
            },
        )
    }

    /// The stage in floating point on the tape, with a gradient.
    pub fn smooth(rgb: [Tensor<4>; 3], mesh: Option<&Mesh>, theta: &Theta) -> [Tensor<4>; 3] {
        let Some(mesh) = mesh else { return rgb };
        let [_, _, height, width] = rgb[0].dims();
        let (rows, cols) = (Axis::corners(height, mesh.rows), Axis::corners(width, mesh.cols));
        let displacement = |k: usize| {
            let nodes: Tensor<4> = constant(mesh.planes[k].clone(), [1, 1, mesh.rows, mesh.cols], &rgb[0]);
            spread(nodes, &rows, &cols) * theta.number("dewarp.strength")
        };
        let moved = Tensor::cat(vec![displacement(0), displacement(1)], 1);
        let kernel = Arc::new(Fetch { height, width });
        rgb.map(|plane| apply(kernel.clone(), [plane.into_dispatch(), moved.clone().into_dispatch()]))
    }
}

/// Fetching of displaced pixels as a kernel of a plane `[1, 1, height, width]` and displacements `[1, 2, height, width]`, pixels.
#[derive(Debug)]
struct Fetch {
    height: usize,
    width: usize,
}

impl Fetch {
    /// Rows, columns and places of the four by four pixels of an output pixel.
    fn places(&self, i: usize, moved: &[f32]) -> ([usize; 4], [usize; 4], f64, f64) {
        let n = self.height * self.width;
        let inside = |at: f64, len: usize| at.clamp(0.0, len as f64 - 1.0);
        let y = inside((i / self.width) as f64 + f64::from(moved[i]), self.height);
        let x = inside((i % self.width) as f64 + f64::from(moved[n + i]), self.width);
        let mirrored =
            |at: isize, len: usize| at.unsigned_abs().min((2 * (len as isize - 1) - at).unsigned_abs());
        let four = |at: f64, len: usize| std::array::from_fn(|k| mirrored(at as isize + k as isize - 1, len));
        (four(y, self.height), four(x, self.width), y - y.floor(), x - x.floor())
    }
}

impl Kernel for Fetch {
    fn forward(&self, inputs: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let (plane, moved) = (inputs[0].values, inputs[1].values);
        let value = |i: usize| {
            let (rows, cols, y, x) = self.places(i, moved);
            let (of_rows, of_cols) = (weights(y), weights(x));
            let mut sum = 0.0;
            for (row, a) in rows.iter().zip(of_rows) {
                for (col, b) in cols.iter().zip(of_cols) {
                    sum += a * b * f64::from(plane[row * self.width + col]);
                }
            }
            sum as f32
        };
        ((0..self.height * self.width).map(value).collect(), vec![1, 1, self.height, self.width])
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], wanted: &[bool]) -> Vec<Vec<f32>> {
        let n = self.height * self.width;
        let (plane, moved) = (inputs[0].values, inputs[1].values);
        let mut d_plane = vec![0.0_f64; if wanted[0] { n } else { 0 }];
        let mut d_moved = vec![0.0_f32; if wanted[1] { 2 * n } else { 0 }];
        for i in 0..n {
            let (rows, cols, y, x) = self.places(i, moved);
            let (of_rows, of_cols, by_y, by_x) = (weights(y), weights(x), slopes(y), slopes(x));
            let (mut down, mut right) = (0.0, 0.0);
            for k in 0..4 {
                for j in 0..4 {
                    let at = rows[k] * self.width + cols[j];
                    if wanted[0] {
                        d_plane[at] += of_rows[k] * of_cols[j] * f64::from(gradient[i]);
                    }
                    if wanted[1] {
                        let v = f64::from(plane[at]);
                        down += by_y[k] * of_cols[j] * v;
                        right += of_rows[k] * by_x[j] * v;
                    }
                }
            }
            if wanted[1] {
                d_moved[i] = (down * f64::from(gradient[i])) as f32;
                d_moved[n + i] = (right * f64::from(gradient[i])) as f32;
            }
        }
        vec![d_plane.into_iter().map(|v| v as f32).collect(), d_moved]
    }
}
