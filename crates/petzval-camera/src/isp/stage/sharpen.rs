//! Sharpening: amplifies the detail of the luma that a Gaussian blur removes.
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

/// Weights of a Gaussian of standard deviation `sigma`, px, in the middle and at `N - 1` steps to either side, with the sum 1.
fn gaussian<const N: usize>(sigma: f64) -> [f64; N] {
    let at = |k: usize| (-0.5 * (k as f64 / sigma).powi(2)).exp();
    let sum = at(0) + 2.0 * (1..N).map(at).sum::<f64>();
    std::array::from_fn(|k| at(k) / sum)
}

impl Sharpen {
    /// Weights of the middle and of each step to the side, [`WEIGHT`]; they add up to exactly 1.
    fn weights(&self) -> [i32; REACH + 1] {
        let mut weights: [i32; REACH + 1] = gaussian(self.sigma).map(|v| WEIGHT.of(v));
        weights[0] += WEIGHT.one() - weights[0] - 2 * weights[1..].iter().sum::<i32>();
        weights
    }

    /// Encoded values of the three colours.
    pub fn fixed(&self, rgb: [Grid<i16>; 3]) -> [Grid<i16>; 3] {
        if self.amount == 0.0 {
            return rgb;
        }
        let size = rgb[0].size();
        let weights = self.weights();
        let reach = (1..=REACH).rev().find(|k| weights[*k] != 0).unwrap_or(0);
        let luma = Grid::from_rows(
            size,
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
            size,
            #[inline(always)]
            |row, out| {
                let blurred = blur(luma.around(row, out.len()), (1, 0), weights);
                out.iter_mut().zip(blurred).for_each(|(out, v)| *out = ENCODED.short(v));
            },
        );
        let (amount, coring) = (WEIGHT.of(self.amount), ENCODED.of(self.coring));
        let (over, under) = (ENCODED.of(self.over), ENCODED.of(self.under));
        Grid::several_from_rows(
            size,
            #[inline(always)]
            |row, outs| {
                let mut detail = blur(down.around(row, size[1]), (0, 1), weights);
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

    /// The stage in floating point on the tape, with a gradient.
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

    /// Rows of a gray picture.
    type Plane = Vec<Vec<f64>>;

    /// Which pixel stands for one outside the picture: its mirror image in the outermost pixel, or in the edge of it.
    #[derive(Clone, Copy)]
    enum Mirror {
        Pixel,
        Edge,
    }

    impl Mirror {
        fn place(self, at: isize, len: usize) -> usize {
            let (len, shift) = (len as isize, if matches!(self, Self::Edge) { 1 } else { 0 });
            let inside = if at < 0 { -at - shift } else { at };
            (if inside >= len { 2 * len - 2 + shift - inside } else { inside }) as usize
        }
    }

    /// The blur along columns, then rows, in f64: `weights` of the middle and of the steps to either side.
    fn blurred(plane: &Plane, weights: &[f64], mirror: Mirror) -> Plane {
        let (height, width) = (plane.len(), plane[0].len());
        let along = |len: usize, at: usize, of: &dyn Fn(usize) -> f64| -> f64 {
            let side = |k: usize| {
                let k = k as isize;
                of(mirror.place(at as isize - k, len)) + of(mirror.place(at as isize + k, len))
            };
            weights[0] * of(at) + (1..weights.len()).map(|k| weights[k] * side(k)).sum::<f64>()
        };
        let down: Plane =
            (0..height).map(|r| (0..width).map(|c| along(height, r, &|r| plane[r][c])).collect()).collect();
        down.iter().map(|row| (0..width).map(|c| along(width, c, &|c| row[c])).collect()).collect()
    }

    /// The formula of the stage, of a gray picture in f64.
    fn sharpened(set: &Sharpen, plane: &Plane, weights: &[f64], mirror: Mirror) -> Plane {
        let of = |(v, blurred): (&f64, &f64)| {
            let d = v - blurred;
            let cored = d.signum() * (d.abs() - set.coring).max(0.0);
            v + (set.amount * cored).clamp(-set.under, set.over)
        };
        let blur = blurred(plane, weights, mirror);
        plane.iter().zip(&blur).map(|(row, blur)| row.iter().zip(blur).map(of).collect()).collect()
    }

    fn reference(key: &str) -> serde_json::Value {
        let all: serde_json::Value =
            serde_json::from_str(include_str!("../../../tests/fixtures/isp_reference.json")).unwrap();
        all[key].clone()
    }

    fn plane(value: &serde_json::Value) -> Plane {
        serde_json::from_value(value.clone()).unwrap()
    }

    fn farthest(a: &Plane, b: &Plane) -> f64 {
        assert_eq!((a.len(), a[0].len()), (b.len(), b[0].len()));
        a.concat().iter().zip(b.concat()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    const UNSHARP: Sharpen = Sharpen { amount: 1.5, sigma: 1.0, coring: 0.0, over: 1.0, under: 1.0 };

    #[test]
    fn the_formula_is_the_gaussian_and_the_unsharp_mask_of_other_libraries() {
        // They end the Gaussian at four standard deviations: 5 and 4 pixels.
        let given = plane(&reference("gray_noisy"));
        let blur = blurred(&given, &gaussian::<6>(1.2), Mirror::Edge);
        let far = farthest(&blur, &plane(&reference("gaussian_s1.2_reflect")));
        assert!(far < 1e-6, "{far}");
        let mut sharp = sharpened(&UNSHARP, &given, &gaussian::<5>(1.0), Mirror::Edge);
        sharp.iter_mut().flatten().for_each(|v| *v = v.clamp(0.0, 1.0));
        let far = farthest(&sharp, &plane(&reference("unsharp_skimage")["out"]));
        assert!(far < 1e-6, "{far}");
    }

    #[test]
    fn the_stage_is_the_formula() {
        let given = plane(&reference("gray_noisy"));
        let (height, width) = (given.len(), given[0].len());
        let device = Default::default();
        let values: Vec<f32> = given.concat().into_iter().map(|v| v as f32).collect();
        let gray = Tensor::<4>::from_data(TensorData::new(values, [1, 1, height, width]), &device);
        let cut = Sharpen { coring: 0.01, over: 0.05, under: 0.03, sigma: 1.7, ..UNSHARP };
        for set in [UNSHARP, cut] {
            let parameters = [
                ("amount", set.amount),
                ("sigma", set.sigma),
                ("coring", set.coring),
                ("over", set.over),
                ("under", set.under),
            ];
            let numbers = Tensor::from_data(TensorData::from(parameters.map(|(_, v)| v as f32)), &device);
            let theta = Theta::new(numbers, parameters.map(|(key, _)| format!("sharpen.{key}")).to_vec());
            let [smooth, _, _] = Sharpen::smooth([gray.clone(), gray.clone(), gray.clone()], &theta);
            let smooth: Vec<f32> = smooth.into_data().try_to_vec().unwrap();
            let smooth: Plane =
                smooth.chunks(width).map(|row| row.iter().map(|v| f64::from(*v)).collect()).collect();
            let wanted = sharpened(&set, &given, &gaussian::<{ REACH + 1 }>(set.sigma), Mirror::Pixel);
            let far = farthest(&smooth, &wanted);
            assert!(far < 1e-6, "{far}");
            let whole = || {
                Grid::from_rows([height, width], |row, out| {
                    out.iter_mut().zip(&given[row]).for_each(|(out, v)| *out = ENCODED.of(*v) as i16);
                })
            };
            let [fixed, _, _] = set.fixed([whole(), whole(), whole()]);
            let fixed: Plane = (0..height)
                .map(|row| fixed.row(row).iter().map(|v| ENCODED.value((*v).into())).collect())
                .collect();
            // Weights have 12 bits, and each of the two blurs is rounded to 14.
            let far = farthest(&fixed, &wanted);
            assert!(far < 1e-3, "{far}");
        }
    }
}
