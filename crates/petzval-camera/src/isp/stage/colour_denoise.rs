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

use super::super::fixed::{Grid, Influence, ROOT, WEIGHT, shift_round};
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
    let [y, u, v] = Grid::three_from_rows(height, width, |row, [y, u, v]| {
        let [r, g, b] = rgb.each_ref().map(|grid| &grid.row(row)[..y.len()]);
        let (u, v) = (&mut u[..y.len()], &mut v[..y.len()]);
        for c in 0..y.len() {
            [y[c], u[c], v[c]] = split(r[c], g[c], b[c]);
        }
    });
    drop(rgb);
    let [u, v] = chroma.fixed(&y, [u, v], sigma);
    let (strength, limit) = (WEIGHT.of(luma.strength), Influence::new(luma.threshold * sigma));
    Grid::three_from_rows(height, width, |row, [r, g, b]| {
        let width = r.len();
        let near = NEAR.map(|(down, right)| &y.near(row, down, right)[..width]);
        let [y, u, v] = [&y, &u, &v].map(|grid| &grid.row(row)[..width]);
        let (g, b) = (&mut g[..width], &mut b[..width]);
        for c in 0..width {
            let mut sum = 0;
            for k in 0..8 {
                sum += limit.of(near[k][c] - y[c]) << u32::from(k < 4);
            }
            let cleaned = ROOT.clamp(y[c] + shift_round(shift_round(sum, 4) * strength, WEIGHT.fraction));
            [r[c], g[c], b[c]] = joined(cleaned, u[c], v[c]);
        }
    })
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
            let [u, v, _] = Grid::three_from_rows(luma.height, luma.width, |row, [to_u, to_v, _]| {
                let width = to_u.len();
                let of = |grid| NEAR.map(|(d, r)| &Grid::near(grid, row, step * d, step * r)[..width]);
                let (near_y, near_u, near_v) = (of(luma), of(&planes[0]), of(&planes[1]));
                let [y, u, v] = [luma, &planes[0], &planes[1]].map(|grid| &grid.row(row)[..width]);
                let to_v = &mut to_v[..width];
                for c in 0..width {
                    let (mut sum_u, mut sum_v) = (0, 0);
                    for k in 0..8 {
                        // Weight by the luma, 12 bits.
                        let apart = (near_y[k][c] - y[c]).abs().min(guard);
                        let share = (apart * inverse) >> 12;
                        let rest = (1 << 12) - ((share * share) >> 12);
                        let weight = ((rest * rest) >> 12) << u32::from(k < 4);
                        sum_u += shift_round(limit.of(near_u[k][c] - u[c]) * weight, 12);
                        sum_v += shift_round(limit.of(near_v[k][c] - v[c]) * weight, 12);
                    }
                    to_u[c] = u[c] + shift_round(shift_round(sum_u, 4) * strength, WEIGHT.fraction);
                    to_v[c] = v[c] + shift_round(shift_round(sum_v, 4) * strength, WEIGHT.fraction);
                }
            });
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
