//! Local tone mapping: dark regions are lifted, and the detail in them kept.
//!
//! The logarithm l of the local light splits into a base b and detail. The base is that of a guided filter that is guided by l itself
//! (K. He, J. Sun, X. Tang, "Guided image filtering", TPAMI 2013; at low resolution as in "Fast guided filter", 2015): smooth over
//! the reach, but faithful to edges higher than the range, so that no halos appear beside them. All colours of a pixel get the gain
//! `2^(T(b) + (detail - 1) (l - b))`, with the curve
//!
//! `T(b) = strength * (log2 G - log2(1 + (G - 1) 2^(p b)))`, `G = 2^dark`, `p = 2^(2 asymmetry - 1)`,
//!
//! which lifts the dark by `dark` stops and leaves white where it is (the shape of E. Reinhard et al., SIGGRAPH 2002).

use std::ops::Range;

use burn::prelude::*;
use rayon::prelude::*;

use super::super::fixed::{
    BLOCK, GAIN, Grid, LINEAR, LOG2, OctaveTable, between, by_blocks, in_vectors, packed, shift_round,
};
use super::super::mesh::{Axis, spread};
use super::super::tape_grid::{Stencil, Theta, constant};

petzval_base::parameters! {
    /// Local tone mapping.
    pub struct ToneMap {
        /// Strength of the curve.
        strength: f64 = 0.0, "", 0.0..1.0, Linear, "0 leaves the tones";
        /// Lift of the darkest tones at full strength.
        dark: f64 = 2.0, "EV", 0.1..6.0, Linear, "2 makes the dark four times as bright";
        /// Reach of the base.
        reach: f64 = 32.0, "px", 8.0..128.0, Log, "regions smaller than this count as detail";
        /// Step of light above which an edge belongs to the base.
        range: f64 = 1.0, "EV", 0.1..4.0, Log, "small values keep edges, large ones smooth over them";
        /// Contrast of the detail.
        detail: f64 = 1.0, "", 0.0..2.0, Linear, "1 keeps it, 2 doubles it";
        /// How far the lift reaches into bright tones.
        asymmetry: f64 = 0.5, "", 0.0..1.0, Linear, "0 also lifts middle tones, 1 only the dark";
    }
}

/// Side of the cells over which the base takes mean and variance, pixels.
const CELL: usize = 16;

/// The darkest light whose logarithm is taken, as a power of two.
const DARKEST_LOG2: i32 = -14;

/// Knots of the curve per stop, as a power of two, and its range in stops.
const KNOT_BITS: u32 = 3;
const CURVE_STOPS: std::ops::Range<i32> = DARKEST_LOG2..5;

/// Bits below a power of two in its table, for the step to the next: a step is at most 2^17 (1 - 2^(-1/64)), 1412.
const POWER_BITS: u32 = 11;

/// What the stage knows about a frame: gain tables and the base's coefficients at the cells.
pub struct Registers {
    /// Slope a of the base, 12 bits, and its offset (1 - a) m, [`LOG2`]: `b = a l + offset`.
    slope: Vec<i32>,
    offset: Vec<i32>,
    rows: Axis,
    cols: Axis,
    /// [`packed`] knots of the curve, [`LOG2`]; as many as a power of two, so that an index of fewer bits needs no check.
    curve: [i32; 256],
    /// Powers of two of fractions, [`GAIN`] times 16, [`POWER_BITS`] up, and below them the step to the next.
    power: [i32; 64],
    detail: i32,
}

impl ToneMap {
    pub fn is_off(&self) -> bool {
        self.strength == 0.0 && self.detail == 1.0
    }

    /// The logarithm of a mosaic's local light, [`LOG2`]: of the tent-weighted mean of 3x3 pixels, in which each colour has the same
    /// share at every pixel of the array.
    pub fn local_light(light: &Grid<i32>) -> Grid<i16> {
        let one = f64::from(LINEAR.one());
        let darkest = f64::from(DARKEST_LOG2).exp2();
        let table = OctaveTable::new(LINEAR.max, LOG2, |v| (v / one).max(darkest).log2());
        Grid::from_rows(
            light.size(),
            #[inline(always)]
            |row, out| {
                let near = light.around(row, out.len());
                let [a, b, c] = [near.at(-1, -1), near.at(-1, 0), near.at(-1, 1)];
                let [d, e, f] = [near.at(0, -1), near.at(0, 0), near.at(0, 1)];
                let [g, h, i] = [near.at(1, -1), near.at(1, 0), near.at(1, 1)];
                by_blocks(
                    [out],
                    #[inline(always)]
                    |pixels, [block]| {
                        let [a, b, c, d, e, f, g, h, i] =
                            [a, b, c, d, e, f, g, h, i].map(|line| &line[pixels.clone()]);
                        for k in 0..a.len().min(BLOCK) {
                            let (above, here, below) =
                                (a[k] + 2 * b[k] + c[k], d[k] + 2 * e[k] + f[k], g[k] + 2 * h[k] + i[k]);
                            block[k] = table.at(LINEAR.clamp((above + 2 * here + below + 8) >> 4));
                        }
                    },
                );
            },
        )
    }

    /// Splits the logarithm of local light into base and detail.
    pub fn registers(&self, light: &Grid<i16>) -> Registers {
        let (rows, cols) = (Axis::cells(light.height, CELL), Axis::cells(light.width, CELL));
        let (m, n) = (rows.nodes(), cols.nodes());
        // Means of cells: of the logarithm, and of its square with 22 bits behind the point.
        let of_row = |row: usize| {
            let rows = row * CELL..light.height.min((row + 1) * CELL);
            let sums = in_vectors(
                #[inline(always)]
                || sums_of_cells(light, rows.clone()),
            );
            let means = sums.into_iter().map(move |(count, sums)| {
                let count = (count * rows.len()) as i64;
                sums.map(|sum| sum / count)
            });
            means.collect::<Vec<_>>()
        };
        let means: Vec<[i64; 2]> = (0..m).into_par_iter().flat_map_iter(of_row).collect();
        let [mean, square]: [Vec<i64>; 2] = [0, 1].map(|k| means.iter().map(|of| of[k]).collect());
        let weights = [m, n].map(|nodes| self.weights(nodes));
        let blur = |plane: &[i64]| blurred(plane, (m, n), &weights);
        let (mean, square) = (blur(&mean), blur(&square));
        // The guided filter: slope = variance / (variance + range^2).
        let range = (self.range.powi(2) * f64::from(1 << (2 * LOG2.fraction))).round() as i64;
        let slope = mean.iter().zip(&square).map(|(m, s)| {
            let variance = (s - m * m).max(0);
            (variance << 12) / (variance + range).max(1)
        });
        let slope: Vec<i64> = slope.collect();
        let offset: Vec<i64> = slope.iter().zip(&mean).map(|(a, m)| ((4096 - a) * m) >> 12).collect();
        let narrow = |plane: Vec<i64>| plane.into_iter().map(|v| v as i32).collect();
        let curve = |k: usize| {
            let stops = f64::from(CURVE_STOPS.start) + k as f64 / f64::from(1 << KNOT_BITS);
            LOG2.of(self.curve(stops))
        };
        let power = |k: usize| (f64::from(GAIN.one()) * (k as f64 / 64.0).exp2() * 16.0).round() as i32;
        Registers {
            slope: narrow(blur(&slope)),
            offset: narrow(blur(&offset)),
            rows,
            cols,
            curve: std::array::from_fn(|k| packed(curve(k), curve(k + 1) - curve(k))),
            power: std::array::from_fn(|k| (power(k) << POWER_BITS) | (power(k + 1) - power(k))),
            detail: ((self.detail - 1.0) * 4096.0).round() as i32,
        }
    }

    /// The curve T: stops of gain of a base in stops.
    fn curve(&self, base: f64) -> f64 {
        let lift = self.dark.exp2();
        let power = (2.0 * self.asymmetry - 1.0).exp2();
        self.strength * (self.dark - (1.0 + (lift - 1.0) * (power * base).exp2()).log2())
    }

    /// Gaussian weights between the cells of an axis, 16 bits: for each cell those of the cells about it that have any. They add up to
    /// exactly 1, so that a mean lies between the values and fits their format.
    fn weights(&self, nodes: usize) -> Vec<Weights> {
        let sigma = self.reach / CELL as f64;
        let weight = |a: usize, b: usize| (-0.5 * (a.abs_diff(b) as f64 / sigma).powi(2)).exp();
        let line = |to: usize| {
            let sum: f64 = (0..nodes).map(|from| weight(to, from)).sum();
            let of = |from: usize| (weight(to, from) / sum * 65536.0).round() as i64;
            let first = (0..nodes).position(|from| of(from) > 0).unwrap_or(to);
            let mut all: Vec<i64> = (first..nodes).map(of).take_while(|weight| *weight > 0).collect();
            all[to - first] += 65536 - all.iter().sum::<i64>();
            Weights { first, of: all }
        };
        (0..nodes).map(line).collect()
    }

    /// Gains of the pixels of a white-balanced mosaic on the tape.
    pub fn smooth(light: &Tensor<4>, theta: &Theta) -> Tensor<4> {
        let number = |key: &str| theta.number(&format!("tone_map.{key}"));
        let [_, _, height, width] = light.dims();
        let near = Stencil::new(light);
        let tent = |down| near.at(down, -1) + near.at(down, 0) * 2.0 + near.at(down, 1);
        let mean = (tent(-1) + tent(0) * 2.0 + tent(1)) / 16.0;
        let ln2 = std::f64::consts::LN_2;
        let l = mean.clamp_min(f64::from(DARKEST_LOG2).exp2()).log() / ln2;

        // Means over cells as products with matrices of ones, then Gaussian blurs as products with matrices that the reach sets.
        let (rows, cols) = (Axis::cells(height, CELL), Axis::cells(width, CELL));
        let cells = |len: usize| -> Tensor<4> {
            let nodes = len.div_ceil(CELL);
            let share = |i: usize| {
                let (node, pixel) = (i / len, i % len);
                let size = CELL.min(len - node * CELL) as f32;
                if pixel / CELL == node { 1.0 / size } else { 0.0 }
            };
            constant((0..nodes * len).map(share).collect(), [1, 1, nodes, len], light)
        };
        let (down, right) = (cells(height), cells(width).transpose());
        let sigma = number("reach") / CELL as f64;
        let gauss = |nodes: usize| {
            let square = |i: usize| (i / nodes).abs_diff(i % nodes).pow(2) as f32;
            let squares: Tensor<4> =
                constant((0..nodes * nodes).map(square).collect(), [1, 1, nodes, nodes], light);
            let weights = (squares / (sigma.clone() * sigma.clone()) * -0.5).exp();
            weights.clone() / weights.sum_dim(3)
        };
        let (over_rows, over_cols) = (gauss(rows.nodes()), gauss(cols.nodes()).transpose());
        let blur = |cells: Tensor<4>| over_rows.clone().matmul(cells).matmul(over_cols.clone());
        let of_cells = |plane: Tensor<4>| blur(down.clone().matmul(plane).matmul(right.clone()));
        let (mean, square) = (of_cells(l.clone()), of_cells(l.clone() * l.clone()));
        let variance = (square - mean.clone() * mean.clone()).clamp_min(0.0);
        let range = number("range");
        let slope = variance.clone() / (variance + range.clone() * range);
        let offset = blur((-slope.clone() + 1.0) * mean);
        let base = spread(blur(slope), &rows, &cols) * l.clone() + spread(offset, &rows, &cols);

        let dark = number("dark");
        let lift = (dark.clone() * ln2).exp();
        let power = ((number("asymmetry") * 2.0 - 1.0) * ln2).exp();
        let inside = ((base.clone() * power * ln2).exp() * (lift - 1.0) + 1.0).log() / ln2;
        let curve = (-inside + dark) * number("strength");
        let stops = curve + (l - base) * (number("detail") - 1.0);
        (stops * ln2).exp().clamp_max(GAIN.value(GAIN.max))
    }
}

/// Weights of neighbouring cells.
struct Weights {
    /// The first of them.
    first: usize,
    of: Vec<i64>,
}

/// A plane of cells, blurred by the weights of its rows and of its columns.
fn blurred(plane: &[i64], (m, n): (usize, usize), [rows, cols]: &[Vec<Weights>; 2]) -> Vec<i64> {
    let round = |sum: i64| (sum + (1 << 15)) >> 16;
    let mut across = vec![0; m * n];
    for (to, from) in across.chunks_exact_mut(n).zip(plane.chunks_exact(n)) {
        for (to, Weights { first, of }) in to.iter_mut().zip(cols) {
            *to = round(of.iter().zip(&from[*first..]).map(|(w, v)| w * v).sum());
        }
    }
    let mut out = vec![0; m * n];
    for (to, Weights { first, of }) in out.chunks_exact_mut(n).zip(rows) {
        for (weight, from) in of.iter().zip(across[first * n..].chunks_exact(n)) {
            to.iter_mut().zip(from).for_each(|(sum, v)| *sum += weight * v);
        }
        to.iter_mut().for_each(|sum| *sum = round(*sum));
    }
    out
}

/// Columns of each cell of some rows of pixels, and the sums of its values and of their squares.
#[inline(always)]
fn sums_of_cells(light: &Grid<i16>, rows: Range<usize>) -> Vec<(usize, [i64; 2])> {
    let mut cells: Vec<_> = (0..light.width.div_ceil(CELL))
        .map(|cell| (CELL.min(light.width - cell * CELL), [0_i64; 2]))
        .collect();
    for row in rows {
        let (whole, rest) = light.row(row).as_chunks::<CELL>();
        let (of_whole, of_rest) = cells.split_at_mut(whole.len());
        for (pixels, (_, sums)) in whole.iter().zip(of_whole) {
            add_sums(pixels, sums);
        }
        of_rest.iter_mut().for_each(|(_, sums)| add_sums(rest, sums));
    }
    cells
}

/// Adds values and their squares.
#[inline(always)]
fn add_sums(pixels: &[i16], sums: &mut [i64; 2]) {
    sums[0] += i64::from(pixels.iter().map(|v| i32::from(*v)).sum::<i32>());
    sums[1] += pixels.iter().map(|v| i64::from(i32::from(*v).pow(2))).sum::<i64>();
}

impl Registers {
    /// Slope and offset of the base at a row of pixels.
    #[inline(always)]
    pub fn row(&self, row: usize) -> [Vec<i32>; 2] {
        [&self.slope, &self.offset].map(|plane| self.cols.spread_row(&self.rows.row_of_nodes(plane, row)))
    }

    /// The gain, [`GAIN`], of a pixel of local light l, [`LOG2`], where the base has slope a and offset b.
    #[inline(always)]
    pub fn gain(&self, (a, b): (i32, i32), l: i32) -> i32 {
        let base = LOG2.clamp(shift_round(a * l, 12) + b);
        let start = CURVE_STOPS.start << LOG2.fraction;
        let last = (CURVE_STOPS.end - CURVE_STOPS.start) << LOG2.fraction;
        let at = (base - start).clamp(0, last);
        const STEP: u32 = LOG2.fraction - KNOT_BITS;
        let stops = between(self.curve[(at >> STEP) as usize % 256], at & ((1 << STEP) - 1), STEP);
        let stops = stops + shift_round((l - base) * self.detail, 12);
        // 2^stops: the table holds the fraction, a shift the whole stops; gains end at 16.
        let stops = stops.clamp(-(12 << LOG2.fraction), (4 << LOG2.fraction) - 1);
        let (whole, fraction) = (stops >> LOG2.fraction, stops & (LOG2.one() - 1));
        const FINE: u32 = LOG2.fraction - 6;
        let (knot, rest) = ((fraction >> FINE) as usize % 64, fraction & ((1 << FINE) - 1));
        let (power, step) = (self.power[knot] >> POWER_BITS, self.power[knot] & ((1 << POWER_BITS) - 1));
        let power = power + ((step * rest) >> FINE);
        GAIN.clamp(if whole >= 4 { GAIN.max } else { shift_round(power, (4 - whole) as u32) })
    }
}
