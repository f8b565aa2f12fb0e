//! Denoising of the mosaic: two scales of a robust mean of pixels of the same colour.
//!
//! `v + strength * sum_k w_k influence(v_k - v)` over the 3x3 neighbours at distance 2, then at distance 4 of the result; `w` is a
//! Gaussian of the distance in steps. It is one step of the robust minimisation whose fixed point the bilateral filter seeks (M. Elad,
//! "On the origin of the bilateral filter", IEEE TIP 2002), with no division. Each scale has its own limit of what counts as noise.

use burn::prelude::*;

use super::super::fixed::{BLOCK, Biweight, Grid, ROOT, WEIGHT, by_blocks, eight, shift_round};
use super::super::tape_grid::{Stencil, Theta, constant, influence};

petzval_base::parameters! {
    /// Denoising of the mosaic, before demosaicing.
    pub struct BayerDenoise {
        /// Share of the robust mean that is taken.
        strength: f64 = 0.5, "", 0.0..1.0, Linear, "0 leaves the noise";
        /// Differences at distance 2 beyond which they are detail.
        fine: f64 = 3.0, "sigma", 0.1..10.0, Log, "in standard deviations of the noise";
        /// Differences at distance 4 beyond which they are detail.
        coarse: f64 = 2.0, "sigma", 0.1..10.0, Log, "in standard deviations of the noise";
        /// Standard deviation of the weights, in pixels of one colour.
        reach: f64 = 1.0, "steps", 0.5..3.0, Log, "larger averages wider";
        /// Growth of the strength towards the corners, where shading correction lifts the noise.
        radial: f64 = 0.0, "", 0.0..2.0, Linear, "1 doubles the strength in the corners";
    }
}

/// The square of the distance from the middle, 1 at the corners, of pixels of a row; 12 bits behind the point.
#[inline(always)]
fn radius_squared(row: usize, col: usize, (height, width): (usize, usize), scale: i64) -> i32 {
    let (y, x) = (2 * row as i64 + 1 - height as i64, 2 * col as i64 + 1 - width as i64);
    (((y * y + x * x) * scale) >> 32) as i32
}

impl BayerDenoise {
    /// Weights of the four neighbours beside and of the four diagonal ones; with that of the middle they add up to 1.
    fn weights(&self) -> [f64; 2] {
        let beside = (-0.5 / self.reach.powi(2)).exp();
        let sum = 1.0 + 4.0 * beside + 4.0 * beside * beside;
        [beside / sum, beside * beside / sum]
    }

    /// Share of the variance of the noise in flat light that is averaged away.
    pub fn averaged(&self) -> f64 {
        let [beside, diagonal] = self.weights().map(|w| w * self.strength);
        let middle = 1.0 - 4.0 * beside - 4.0 * diagonal;
        // Both scales together: the squares of the weights multiply, as their neighbours do not overlap.
        1.0 - (middle.powi(2) + 4.0 * beside.powi(2) + 4.0 * diagonal.powi(2)).powi(2)
    }

    /// Roots of a mosaic to roots of a mosaic.
    pub fn fixed(&self, mosaic: Grid<i16>, sigma: f64) -> Grid<i16> {
        if self.strength == 0.0 {
            return mosaic;
        }
        let fine = self.scale_fixed(&mosaic, 2, self.fine * sigma);
        self.scale_fixed(&fine, 4, self.coarse * sigma)
    }

    fn scale_fixed(&self, mosaic: &Grid<i16>, step: isize, limit: f64) -> Grid<i16> {
        let (height, width) = (mosaic.height, mosaic.width);
        let biweight = Biweight::new(limit);
        let [beside, diagonal] = self.weights().map(|w| WEIGHT.of(w));
        let (strength, radial) = (WEIGHT.of(self.strength), WEIGHT.of(self.radial));
        let corner = ((height * height + width * width) as f64).max(1.0);
        let scale = ((1_u64 << 44) as f64 / corner).round() as i64;
        Grid::from_rows(
            [height, width],
            #[inline(always)]
            |row, out| {
                let near = mosaic.around(row, out.len());
                by_blocks(
                    [out],
                    #[inline(always)]
                    |pixels, [out]| {
                        let here = near.block(0, 0, pixels.start);
                        let lines = eight(near, step, pixels.start);
                        // Beside and diagonally: loops of 16-bit numbers alone. Four influences are rounded up, by two steps together.
                        let [mut of_four, mut of_corners] = [[-2_i16; BLOCK]; 2];
                        for k in 0..4 {
                            let (beside, diagonal) = (lines[k], lines[4 + k]);
                            for c in 0..BLOCK {
                                of_four[c] += biweight.influence(beside[c].saturating_sub(here[c]));
                                of_corners[c] += biweight.influence(diagonal[c].saturating_sub(here[c]));
                            }
                        }
                        for c in 0..BLOCK {
                            let sum = i32::from(of_four[c]) * beside + i32::from(of_corners[c]) * diagonal;
                            let share = if radial == 0 {
                                strength
                            } else {
                                let square = radius_squared(row, pixels.start + c, (height, width), scale);
                                let more = (square * radial) >> WEIGHT.fraction;
                                (strength + ((strength * more) >> WEIGHT.fraction)).min(WEIGHT.one())
                            };
                            let change = shift_round(sum, WEIGHT.fraction) * share;
                            out[c] = ROOT.clamp(i32::from(here[c]) + shift_round(change, WEIGHT.fraction));
                        }
                    },
                );
            },
        )
    }

    /// The stage in floating point on the tape, with a gradient.
    pub fn smooth(mosaic: Tensor<4>, sigma: Tensor<4>, theta: &Theta) -> Tensor<4> {
        let number = |key: &str| theta.number(&format!("bayer_denoise.{key}"));
        let reach = number("reach");
        let beside = (reach.clone() * reach).recip().mul_scalar(-0.5).exp();
        let diagonal = beside.clone() * beside.clone();
        let sum = beside.clone() * 4.0 + diagonal.clone() * 4.0 + 1.0;
        let weights = [beside / sum.clone(), diagonal / sum];
        let [_, _, height, width] = mosaic.dims();
        let square = |i: usize| {
            let (y, x) = (
                2.0 * (i / width) as f32 + 1.0 - height as f32,
                2.0 * (i % width) as f32 + 1.0 - width as f32,
            );
            (y * y + x * x) / (height * height + width * width) as f32
        };
        let radius: Tensor<4> =
            constant((0..height * width).map(square).collect(), [1, 1, height, width], &mosaic);
        let share = (number("strength") * (radius * number("radial") + 1.0)).clamp_max(1.0);
        let mut out = mosaic;
        for (step, limit) in [(2, number("fine")), (4, number("coarse"))] {
            let limit = limit * sigma.clone();
            let near = Stencil::new(&out);
            let sum = |places: [(isize, isize); 4]| {
                let of = |(d, r): (isize, isize)| {
                    influence(near.at(d * step, r * step) - out.clone(), limit.clone())
                };
                places.map(of).into_iter().reduce(|a, b| a + b).expect("four places")
            };
            let four = sum([(-1, 0), (0, -1), (0, 1), (1, 0)]) * weights[0].clone();
            let corners = sum([(-1, -1), (-1, 1), (1, -1), (1, 1)]) * weights[1].clone();
            out = out.clone() + (four + corners) * share.clone();
        }
        out
    }

    /// [`BayerDenoise::averaged`] on the tape.
    pub fn smooth_averaged(theta: &Theta) -> Tensor<4> {
        let (reach, strength) = (theta.number("bayer_denoise.reach"), theta.number("bayer_denoise.strength"));
        let beside = (reach.clone() * reach).recip().mul_scalar(-0.5).exp();
        let sum = beside.clone() * 4.0 + beside.clone() * beside.clone() * 4.0 + 1.0;
        let [b, d] =
            [beside.clone() / sum.clone() * strength.clone(), beside.clone() * beside / sum * strength];
        let middle = (b.clone() + d.clone()) * -4.0 + 1.0;
        let kept = middle.clone() * middle + b.clone() * b * 4.0 + d.clone() * d * 4.0;
        -(kept.clone() * kept) + 1.0
    }
}
