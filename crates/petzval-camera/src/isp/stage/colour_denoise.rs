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

use super::super::fixed::{Around, Grid, Influence, ROOT, WEIGHT, shift_round};
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

/// Luma and colour differences of three colours.
#[inline(always)]
fn split(r: i32, g: i32, b: i32) -> [i32; 3] {
    [shift_round(r + 2 * g + b, 2), r - g, b - g]
}

/// The three colours of luma and colour differences.
#[inline(always)]
fn joined(y: i32, u: i32, v: i32) -> [i32; 3] {
    let g = y - shift_round(u + v, 2);
    [ROOT.clamp(u + g), ROOT.clamp(g), ROOT.clamp(v + g)]
}

/// Denoises roots of the three colours.
pub fn fixed(luma: &LumaDenoise, chroma: &ChromaDenoise, rgb: [Grid; 3], sigma: f64) -> [Grid; 3] {
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
            let (r, g, b) = (
                rgb[0].around(row, width).at(0, 0),
                rgb[1].around(row, width).at(0, 0),
                rgb[2].around(row, width).at(0, 0),
            );
            let (u, v) = (&mut u[..width], &mut v[..width]);
            for c in 0..y.len() {
                [y[c], u[c], v[c]] = split(r[c], g[c], b[c]);
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
            let (y, u, v) =
                (y.around(row, width).at(0, 0), u.around(row, width).at(0, 0), v.around(row, width).at(0, 0));
            let (g, b) = (&mut g[..width], &mut b[..width]);
            r.fill(0);
            for (k, line) in near.into_iter().enumerate() {
                let line = &line[..width];
                for c in 0..width {
                    r[c] += limit.of(line[c] - y[c]) << u32::from(k < 4);
                }
            }
            for c in 0..width {
                let cleaned =
                    ROOT.clamp(y[c] + shift_round(shift_round(r[c], 4) * strength, WEIGHT.fraction));
                [r[c], g[c], b[c]] = joined(cleaned, u[c], v[c]);
            }
        },
    )
}

/// The eight neighbours at a distance, in the order of [`NEAR`].
#[inline(always)]
fn eight(near: Around<'_>, step: isize) -> [&[i32]; 8] {
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
    fn fixed(&self, luma: &Grid, mut planes: [Grid; 2], sigma: f64) -> [Grid; 2] {
        if self.strength == 0.0 {
            return planes;
        }
        let (strength, limit) = (WEIGHT.of(self.strength), Influence::new(self.threshold * sigma));
        let guard = ROOT.of(self.guard * sigma).max(1);
        let inverse = (1 << 24) / guard;
        for step in [2, 4] {
            let [u, v] = Grid::several_from_rows(
                luma.height,
                luma.width,
                #[inline(always)]
                |row, [to_u, to_v]| {
                    let width = to_u.len();
                    let (y, u, v) =
                        (luma.around(row, width), planes[0].around(row, width), planes[1].around(row, width));
                    let (near_y, near_u, near_v) = (eight(y, step), eight(u, step), eight(v, step));
                    let (y, u, v) = (y.at(0, 0), u.at(0, 0), v.at(0, 0));
                    let to_v = &mut to_v[..width];
                    to_u.fill(0);
                    to_v.fill(0);
                    for k in 0..8 {
                        let (line_y, line_u, line_v) =
                            (&near_y[k][..width], &near_u[k][..width], &near_v[k][..width]);
                        for c in 0..width {
                            // Weight by the luma, 12 bits.
                            let apart = (line_y[c] - y[c]).abs().min(guard);
                            let share = (apart * inverse) >> 12;
                            let rest = (1 << 12) - ((share * share) >> 12);
                            let weight = ((rest * rest) >> 12) << u32::from(k < 4);
                            to_u[c] += shift_round(limit.of(line_u[c] - u[c]) * weight, 12);
                            to_v[c] += shift_round(limit.of(line_v[c] - v[c]) * weight, 12);
                        }
                    }
                    for c in 0..width {
                        to_u[c] = u[c] + shift_round(shift_round(to_u[c], 4) * strength, WEIGHT.fraction);
                        to_v[c] = v[c] + shift_round(shift_round(to_v[c], 4) * strength, WEIGHT.fraction);
                    }
                },
            );
            planes = [u, v];
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
