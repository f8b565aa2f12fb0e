//! Denoising after demosaicing: of the luma, and of the colour differences, which need it more and tolerate more of it.
//!
//! With `Y = (R + 2 G + B) / 4`, `U = R - G`, `V = B - G` in roots of light:
//!
//! * `Y + strength * sum_k w_k influence(Y_k - Y)` over 3x3 pixels;
//! * U and V at distances 2 and 4, `U + strength * sum_k w_k influence(U_k - U) g(Y_k - Y)`: `g`, the weight of Tukey's biweight, keeps
//!   colours from running over edges of the luma (joint filtering: G. Petschnigg et al., SIGGRAPH 2004).
//!
//! The weights are 1/8 and 1/16 beside and diagonally, 1/4 in the middle.

use burn::prelude::*;

use super::super::fixed::{
    Around, BLOCK, COLOUR, Grid, Influence, ROOT, WEIGHT, block_of, by_blocks, shift_round,
};
use super::super::tape_grid::{Stencil, Theta, biweight, influence};

petzval_base::parameters! {
    /// Denoising of the luma after demosaicing.
    pub struct LumaDenoise {
        /// Share of the robust mean that is taken.
        strength: f64 = 0.2, "", 0.0..1.0, Linear, "0 leaves the noise";
        /// Differences beyond which they are detail.
        threshold: f64 = 2.0, "sigma", 0.1..10.0, Log, "in standard deviations of the raw noise";
    }
}

petzval_base::parameters! {
    /// Denoising of the colours after demosaicing.
    pub struct ChromaDenoise {
        /// Share of the robust mean that is taken.
        strength: f64 = 0.7, "", 0.0..1.0, Linear, "0 leaves the noise";
        /// Differences of colour beyond which they are detail.
        threshold: f64 = 5.0, "sigma", 0.1..20.0, Log, "in standard deviations of the raw noise";
        /// Differences of luma across which colours are not averaged.
        guard: f64 = 8.0, "sigma", 1.0..40.0, Log, "in standard deviations of the raw noise";
    }
}

/// Steps to the neighbours, beside first.
const NEAR: [(isize, isize); 8] = [(-1, 0), (0, -1), (0, 1), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)];

/// Luma, [`ROOT`], and colour differences, [`COLOUR`], of three colours.
#[inline(always)]
fn split([r, g, b]: [i16; 3]) -> [i16; 3] {
    let [r, g, b] = [r, g, b].map(i32::from);
    [ROOT.short(shift_round(r + 2 * g + b, 2)), COLOUR.short(r - g), COLOUR.short(b - g)]
}

/// The three colours of luma and colour differences.
#[inline(always)]
fn joined([y, u, v]: [i32; 3]) -> [i32; 3] {
    let g = y - shift_round(u + v, 2);
    [ROOT.clamp(u + g), ROOT.clamp(g), ROOT.clamp(v + g)]
}

/// Denoises roots of the three colours.
pub fn fixed(luma: &LumaDenoise, chroma: &ChromaDenoise, rgb: [Grid<i16>; 3], sigma: f64) -> [Grid<i16>; 3] {
    if luma.strength == 0.0 && chroma.strength == 0.0 {
        return rgb;
    }
    let (height, width) = (rgb[0].height, rgb[0].width);
    let [y, u, v] = Grid::several_from_rows(
        height,
        width,
        #[inline(always)]
        |row, [y, u, v]| {
            let width = y.len();
            let [r, g, b] = rgb.each_ref().map(|grid| grid.around(row, width).at(0, 0));
            let (u, v) = (&mut u[..width], &mut v[..width]);
            for c in 0..width {
                [y[c], u[c], v[c]] = split([r[c], g[c], b[c]]);
            }
        },
    );
    drop(rgb);
    let [u, v] = chroma.fixed(&y, [u, v], sigma);
    let (strength, limit) = (WEIGHT.of(luma.strength), Influence::new(luma.threshold * sigma));
    Grid::several_from_rows(
        height,
        width,
        #[inline(always)]
        |row, [r, g, b]| {
            let width = r.len();
            let near = eight(y.around(row, width), 1);
            let here = [&y, &u, &v].map(|grid| grid.around(row, width).at(0, 0));
            by_blocks(
                [r, g, b],
                #[inline(always)]
                |pixels, [r, g, b]| {
                    let y = block_of(here[0], &pixels);
                    let (u, v) = (block_of(here[1], &pixels), block_of(here[2], &pixels));
                    let mut sums = [0; BLOCK];
                    for k in 0..8 {
                        let (line, doubled) = (block_of(near[k], &pixels), u32::from(k < 4));
                        for c in 0..BLOCK {
                            sums[c] += limit.of(line[c] - y[c]) << doubled;
                        }
                    }
                    for c in 0..BLOCK {
                        let change = shift_round(sums[c], 4) * strength;
                        let cleaned = ROOT.clamp(y[c] + shift_round(change, WEIGHT.fraction));
                        [r[c], g[c], b[c]] = joined([cleaned, u[c], v[c]]);
                    }
                },
            );
        },
    )
}

/// The eight neighbours at a distance, in the order of [`NEAR`].
#[inline(always)]
fn eight(near: Around<'_, i16>, step: isize) -> [&[i16]; 8] {
    [
        near.at(-step, 0),
        near.at(0, -step),
        near.at(0, step),
        near.at(step, 0),
        near.at(-step, -step),
        near.at(-step, step),
        near.at(step, -step),
        near.at(step, step),
    ]
}

impl ChromaDenoise {
    fn fixed(&self, luma: &Grid<i16>, mut planes: [Grid<i16>; 2], sigma: f64) -> [Grid<i16>; 2] {
        if self.strength == 0.0 {
            return planes;
        }
        let (strength, limit) = (WEIGHT.of(self.strength), Influence::new(self.threshold * sigma));
        let guard = ROOT.of(self.guard * sigma).max(1);
        let inverse = (1 << 24) / guard;
        for step in [2, 4] {
            planes = Grid::several_from_rows(
                luma.height,
                luma.width,
                #[inline(always)]
                |row, [to_u, to_v]| {
                    let width = to_u.len();
                    let [y, u, v] = [luma, &planes[0], &planes[1]].map(|grid| grid.around(row, width));
                    let (near_y, near_u, near_v) = (eight(y, step), eight(u, step), eight(v, step));
                    let here = [y.at(0, 0), u.at(0, 0), v.at(0, 0)];
                    by_blocks(
                        [to_u, to_v],
                        #[inline(always)]
                        |pixels, [to_u, to_v]| {
                            let y = block_of(here[0], &pixels);
                            let (u, v) = (block_of(here[1], &pixels), block_of(here[2], &pixels));
                            let (mut of_u, mut of_v) = ([0; BLOCK], [0; BLOCK]);
                            // One neighbour after the other over the block: each loop is a plain one over pixels.
                            for k in 0..8 {
                                let line_y = block_of(near_y[k], &pixels);
                                let (line_u, line_v) =
                                    (block_of(near_u[k], &pixels), block_of(near_v[k], &pixels));
                                let doubled = u32::from(k < 4);
                                for c in 0..BLOCK {
                                    // Weight by the luma, 12 bits.
                                    let apart = (line_y[c] - y[c]).abs().min(guard);
                                    let share = (apart * inverse) >> 12;
                                    let rest = (1 << 12) - ((share * share) >> 12);
                                    let weight = ((rest * rest) >> 12) << doubled;
                                    of_u[c] += shift_round(limit.of(line_u[c] - u[c]) * weight, 12);
                                    of_v[c] += shift_round(limit.of(line_v[c] - v[c]) * weight, 12);
                                }
                            }
                            for (at, sums, to) in [(&u, &of_u, to_u), (&v, &of_v, to_v)] {
                                for c in 0..BLOCK {
                                    let change = shift_round(sums[c], 4) * strength;
                                    to[c] = COLOUR.clamp(at[c] + shift_round(change, WEIGHT.fraction));
                                }
                            }
                        },
                    );
                },
            );
        }
        planes
    }
}

/// The same on the tape.
pub fn smooth([red, green, blue]: [Tensor<4>; 3], sigma: Tensor<4>, theta: &Theta) -> [Tensor<4>; 3] {
    let luma = (red.clone() + green.clone() * 2.0 + blue.clone()) * 0.25;
    let differences = [red - green.clone(), blue - green];
    let (limit, guard) = (
        theta.number("chroma_denoise.threshold") * sigma.clone(),
        theta.number("chroma_denoise.guard") * sigma.clone(),
    );
    let strength = theta.number("chroma_denoise.strength");
    let [u, v] = differences.map(|mut plane| {
        for step in [2, 4] {
            let (near, near_y) = (Stencil::new(&plane), Stencil::new(&luma));
            let of = |(k, (d, r)): (usize, (isize, isize))| {
                let weight = biweight(near_y.at(step * d, step * r) - luma.clone(), guard.clone());
                let moved = influence(near.at(step * d, step * r) - plane.clone(), limit.clone());
                moved * weight * if k < 4 { 0.125 } else { 0.0625 }
            };
            let sum = NEAR.into_iter().enumerate().map(of).reduce(|a, b| a + b).expect("eight neighbours");
            plane = plane.clone() + sum * strength.clone();
        }
        plane
    });
    let (near, limit) = (Stencil::new(&luma), theta.number("luma_denoise.threshold") * sigma);
    let of = |(k, (d, r)): (usize, (isize, isize))| {
        influence(near.at(d, r) - luma.clone(), limit.clone()) * if k < 4 { 0.125 } else { 0.0625 }
    };
    let sum = NEAR.into_iter().enumerate().map(of).reduce(|a, b| a + b).expect("eight neighbours");
    let luma = luma.clone() + sum * theta.number("luma_denoise.strength");
    let green = luma - (u.clone() + v.clone()) * 0.25;
    [u + green.clone(), green.clone(), v + green]
}
