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
    BLOCK, Biweight, COLOUR, Grid, ROOT, WEIGHT, by_blocks, doubled, eight, shift_round,
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
    let size = rgb[0].size();
    let [y, u, v] = Grid::several_from_rows(
        size,
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
    let (strength, limit) = (WEIGHT.of(luma.strength), Biweight::new(luma.threshold * sigma));
    Grid::several_from_rows(
        size,
        #[inline(always)]
        |row, [r, g, b]| {
            let width = r.len();
            let [y, u, v] = [&y, &u, &v].map(|grid| grid.around(row, width));
            by_blocks(
                [r, g, b],
                #[inline(always)]
                |pixels, [r, g, b]| {
                    let near = eight(y, 1, pixels.start);
                    let [y, u, v] = [y, u, v].map(|plane| plane.block(0, 0, pixels.start));
                    let sums = match strength {
                        0 => [0; BLOCK],
                        _ => sums_over_eight(
                            #[inline(always)]
                            |k, c| limit.influence(near[k][c].saturating_sub(y[c])),
                        ),
                    };
                    for c in 0..BLOCK {
                        let [y, u, v] = [y[c], u[c], v[c]].map(i32::from);
                        let change = shift_round(sums[c].into(), 4) * strength;
                        let cleaned = ROOT.clamp(y + shift_round(change, WEIGHT.fraction));
                        [r[c], g[c], b[c]] = joined([cleaned, u, v]);
                    }
                },
            );
        },
    )
}

/// Sums of `of(neighbour, pixel)` over the eight neighbours of each pixel of a block, twice those beside.
///
/// One neighbour after the other over the block: each loop is a plain one over pixels, of 16-bit numbers alone.
#[inline(always)]
fn sums_over_eight(of: impl Fn(usize, usize) -> i16) -> [i16; BLOCK] {
    // Influences are rounded up, by half a step of each of the twelve.
    let mut sums = [-6; BLOCK];
    for k in 0..4 {
        for c in 0..BLOCK {
            sums[c] += doubled(of(k, c));
        }
        for c in 0..BLOCK {
            sums[c] += of(k + 4, c);
        }
    }
    sums
}

impl ChromaDenoise {
    fn fixed(&self, luma: &Grid<i16>, mut planes: [Grid<i16>; 2], sigma: f64) -> [Grid<i16>; 2] {
        if self.strength == 0.0 {
            return planes;
        }
        let strength = WEIGHT.of(self.strength);
        let [limit, guard] = [self.threshold, self.guard].map(|limit| Biweight::new(limit * sigma));
        for step in [2, 4] {
            planes = Grid::several_from_rows(
                luma.size(),
                #[inline(always)]
                |row, [to_u, to_v]| {
                    let width = to_u.len();
                    let [y, u, v] = [luma, &planes[0], &planes[1]].map(|grid| grid.around(row, width));
                    by_blocks(
                        [to_u, to_v],
                        #[inline(always)]
                        |pixels, [to_u, to_v]| {
                            let start = pixels.start;
                            let (near_y, near_u, near_v) =
                                (eight(y, step, start), eight(u, step, start), eight(v, step, start));
                            let [y, u, v] = [y, u, v].map(|plane| plane.block(0, 0, start));
                            // Weights by the luma.
                            let mut by_luma = [[0; BLOCK]; 8];
                            for k in 0..8 {
                                for c in 0..BLOCK {
                                    by_luma[k][c] = guard.weight(near_y[k][c].saturating_sub(y[c]));
                                }
                            }
                            for (at, near, to) in [(u, near_u, to_u), (v, near_v, to_v)] {
                                let sums = sums_over_eight(
                                    #[inline(always)]
                                    |k, c| {
                                        limit.influence_by(near[k][c].saturating_sub(at[c]), by_luma[k][c])
                                    },
                                );
                                for c in 0..BLOCK {
                                    let change = shift_round(sums[c].into(), 4) * strength;
                                    let cleaned = i32::from(at[c]) + shift_round(change, WEIGHT.fraction);
                                    to[c] = COLOUR.clamp(cleaned);
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

/// The stage in floating point on the tape, with a gradient.
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
