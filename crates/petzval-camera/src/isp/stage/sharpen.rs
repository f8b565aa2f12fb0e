//! Sharpening: the luma gets back more of what a Gaussian takes out of it.
//!
//! `d = Y - gauss(Y)`; noise below the coring is left out, `c = sign(d) max(|d| - coring, 0)`; all colours get
//! `clamp(amount c, -under, over)`. Y is `(R + 2 G + B) / 4` of encoded values.

use burn::prelude::*;

use super::super::fixed::{Around, BORDER, ENCODED, Grid, WEIGHT, shift_round};
use super::super::tape_grid::{Stencil, Theta, between};

petzval_base::parameters! {
    /// Sharpening.
    pub struct Sharpen {
        /// Amount of detail that is added.
        amount: f64 = 0.5, "", 0.0..4.0, Linear, "0 leaves the picture";
        /// Standard deviation of the Gaussian.
        sigma: f64 = 1.0, "px", 0.5..2.5, Log, "about the blur of the lens";
        /// Detail that counts as noise, of white.
        coring: f64 = 0.004, "", 0.0..0.125, Linear, "1/255 is 0.004";
        /// Greatest brightening, of white.
        over: f64 = 0.1, "", 0.0..1.0, Linear, "small values keep bright halos away";
        /// Greatest darkening, of white.
        under: f64 = 0.1, "", 0.0..1.0, Linear, "small values keep dark halos away";
    }
}

/// Steps to which the Gaussian reaches on either side.
const REACH: usize = BORDER;

/// The symmetric weighted mean of a row's neighbourhood along a step.
#[inline(always)]
fn blur(near: Around<'_, i16>, (down, right): (isize, isize), weights: &[i32]) -> Vec<i32> {
    let mut out: Vec<i32> = near.at(0, 0).iter().map(|v| i32::from(*v) * weights[0]).collect();
    for (k, weight) in weights.iter().enumerate().skip(1) {
        let (d, r) = (k as isize * down, k as isize * right);
        for ((out, a), b) in out.iter_mut().zip(near.at(-d, -r)).zip(near.at(d, r)) {
            *out += (i32::from(*a) + i32::from(*b)) * weight;
        }
    }
    out.iter_mut().for_each(|v| *v = shift_round(*v, WEIGHT.fraction));
    out
}

impl Sharpen {
    /// Weights of the middle and of each step to the side, [`WEIGHT`]; they add up to exactly 1.
    fn weights(&self) -> [i32; REACH + 1] {
        let at = |k: usize| (-0.5 * (k as f64 / self.sigma).powi(2)).exp();
        let sum = at(0) + 2.0 * (1..=REACH).map(at).sum::<f64>();
        let mut weights: [i32; REACH + 1] = std::array::from_fn(|k| WEIGHT.of(at(k) / sum));
        weights[0] += WEIGHT.one() - weights[0] - 2 * weights[1..].iter().sum::<i32>();
        weights
    }

    /// Encoded values of the three colours.
    pub fn fixed(&self, rgb: [Grid<i16>; 3]) -> [Grid<i16>; 3] {
        if self.amount == 0.0 {
            return rgb;
        }
        let (height, width) = (rgb[0].height, rgb[0].width);
        let weights = self.weights();
        let reach = (1..=REACH).rev().find(|k| weights[*k] != 0).unwrap_or(0);
        let luma = Grid::from_rows(
            height,
            width,
            #[inline(always)]
            |row, out| {
                let [r, g, b] = rgb.each_ref().map(|grid| grid.around(row, out.len()).at(0, 0));
                for c in 0..out.len() {
                    let [r, g, b] = [r[c], g[c], b[c]].map(i32::from);
                    out[c] = ENCODED.short(shift_round(r + 2 * g + b, 2));
                }
            },
        );
        // The Gaussian along the columns, then along the rows.
        let weights = &weights[..=reach];
        let down = Grid::from_rows(
            height,
            width,
            #[inline(always)]
            |row, out| {
                let blurred = blur(luma.around(row, out.len()), (1, 0), weights);
                out.iter_mut().zip(blurred).for_each(|(out, v)| *out = ENCODED.short(v));
            },
        );
        let (amount, coring) = (WEIGHT.of(self.amount), ENCODED.of(self.coring));
        let (over, under) = (ENCODED.of(self.over), ENCODED.of(self.under));
        Grid::several_from_rows(
            height,
            width,
            #[inline(always)]
            |row, outs| {
                let mut detail = blur(down.around(row, width), (0, 1), weights);
                for (v, y) in detail.iter_mut().zip(luma.row(row)) {
                    let d = i32::from(*y) - *v;
                    let cored = d - d.max(-coring).min(coring);
                    *v = shift_round(cored * (amount >> 2), WEIGHT.fraction - 2).max(-under).min(over);
                }
                for (grid, out) in rgb.iter().zip(outs) {
                    for ((out, v), d) in out.iter_mut().zip(grid.row(row)).zip(&detail) {
                        *out = ENCODED.short(i32::from(*v) + d);
                    }
                }
            },
        )
    }

    /// The same on the tape.
    pub fn smooth(rgb: [Tensor<4>; 3], theta: &Theta) -> [Tensor<4>; 3] {
        let number = |key: &str| theta.number(&format!("sharpen.{key}"));
        let luma = (rgb[0].clone() + rgb[1].clone() * 2.0 + rgb[2].clone()) * 0.25;
        let sigma = number("sigma");
        let falloff = (sigma.clone() * sigma).recip() * -0.5;
        let weights: Vec<Tensor<4>> = (0..=REACH).map(|k| (falloff.clone() * (k * k) as f64).exp()).collect();
        let sum = weights[1..].iter().fold(weights[0].clone(), |sum, w| sum + w.clone() * 2.0);
        let blur = |plane: Tensor<4>, step: (isize, isize)| {
            let near = Stencil::new(&plane);
            let mut out = plane * weights[0].clone();
            for (k, weight) in weights.iter().enumerate().skip(1) {
                let (d, r) = (k as isize * step.0, k as isize * step.1);
                out = out + (near.at(-d, -r) + near.at(d, r)) * weight.clone();
            }
            out / sum.clone()
        };
        let d = luma.clone() - blur(blur(luma, (1, 0)), (0, 1));
        let coring = number("coring");
        let cored = d.clone() - between(d, -coring.clone(), coring);
        let detail = between(cored * number("amount"), -number("under"), number("over"));
        rgb.map(|plane| plane + detail.clone())
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use super::*;

    #[test]
    fn it_is_an_unsharp_mask() {
        let reference: serde_json::Value =
            serde_json::from_str(include_str!("../../../tests/fixtures/isp_reference.json")).unwrap();
        let plane =
            |value: &serde_json::Value| -> Vec<Vec<f32>> { serde_json::from_value(value.clone()).unwrap() };
        let (given, wanted) = (plane(&reference["gray_noisy"]), plane(&reference["unsharp_skimage"]["out"]));
        let (height, width) = (given.len(), given[0].len());
        let device = Default::default();
        let parameters = [("amount", 1.5), ("sigma", 1.0), ("coring", 0.0), ("over", 1.0), ("under", 1.0)];
        let values = Tensor::from_data(TensorData::from(parameters.map(|(_, v)| v)), &device);
        let theta = Theta::new(values, parameters.map(|(key, _)| format!("sharpen.{key}")).to_vec());
        let gray = Tensor::<4>::from_data(TensorData::new(given.concat(), [1, 1, height, width]), &device);
        let [found, _, _] = Sharpen::smooth([gray.clone(), gray.clone(), gray], &theta);
        let found: Vec<f32> = found.into_data().try_to_vec().unwrap();
        // Its Gaussian ends four pixels away, where ours has 1.5e-6 of its weight left.
        for r in 4..height - 4 {
            for c in 4..width - 4 {
                let (found, wanted) = (found[r * width + c].clamp(0.0, 1.0), wanted[r][c]);
                assert!((found - wanted).abs() < 1e-5, "({r}, {c}): {found} {wanted}");
            }
        }
    }
}
