//! Demosaicing of the roots of a mosaic, and suppression of false colours.
//!
//! The methods are those of [`Demosaic`](crate::develop::Demosaic), in whole numbers. They are the mean of neighbours, the filters of
//! Malvar, He and Cutler (ICASSP 2004), the directional method of Menon, Andriani and Calvagno (2007) with its refinement, in
//! `directional.rs`, and ratio-corrected demosaicing (2017), in `ratio.rs`. The differences of red and blue from green
//! are then pulled towards their median over 3x3 pixels, which takes single pixels of wrong colour at edges out (W. T. Freeman, US patent
//! 4,724,395, 1988).

mod directional;
mod ratio;

use std::sync::Arc;

use burn::prelude::*;

use self::directional::directional;
use crate::develop::Demosaic;
use crate::image::{CHANNELS, LinearImage};
use crate::isp::fixed::{Around, Grid, ROOT, WEIGHT, shift_round};
use crate::isp::tape_grid::{Stencil, Theta};
use crate::render::Placement;
use crate::sensor::CfaPattern;
use crate::tape::{Kernel, View, apply};

petzval_base::parameters! {
    /// Suppression of false colours after demosaicing.
    pub struct FalseColour {
        /// Share of the way to the median of the neighbours' colours.
        strength: f64 = 0.3, "", 0.0..1.0, Linear, "0 leaves the colours";
    }
}

/// Roots of the three colours from the roots of a mosaic.
pub fn fixed(method: Demosaic, mosaic: &Grid<i16>, cfa: CfaPattern) -> [Grid<i16>; 3] {
    match method {
        Demosaic::Bilinear => linear(mosaic, cfa, false),
        Demosaic::Malvar => linear(mosaic, cfa, true),
        Demosaic::Rcd => ratio::fixed(mosaic, cfa),
        Demosaic::Menon => directional(mosaic, cfa),
    }
}

/// Bilinear interpolation, with or without the corrections of Malvar, He and Cutler. Weights are multiples of 1/16.
fn linear(mosaic: &Grid<i16>, cfa: CfaPattern, is_corrected: bool) -> [Grid<i16>; 3] {
    let correction = i32::from(is_corrected);
    Grid::several_from_rows(
        mosaic.size(),
        #[inline(always)]
        |row, [red, green, blue]| {
            let width = red.len();
            let near = mosaic.around(row, width);
            let (left, right, up, down) = (near.at(0, -1), near.at(0, 1), near.at(-1, 0), near.at(1, 0));
            let corners = [near.at(-1, -1), near.at(-1, 1), near.at(1, -1), near.at(1, 1)];
            let (left2, right2, up2, down2) = (near.at(0, -2), near.at(0, 2), near.at(-2, 0), near.at(2, 0));
            let here = near.at(0, 0);
            let (green, blue) = (&mut green[..width], &mut blue[..width]);
            let (green_first, is_red_row) = cfa.row_kind(row);
            for c in 0..width {
                let v = i32::from(here[c]);
                let sum = |a: &[i16], b: &[i16]| i32::from(a[c]) + i32::from(b[c]);
                let (beside, above) = (sum(left, right), sum(up, down));
                let diagonal = sum(corners[0], corners[1]) + sum(corners[2], corners[3]);
                let (far_h, far_v) = (sum(left2, right2), sum(up2, down2));
                // At green: the colour of the row, and that of the other rows; 16ths.
                let of_row = 8 * beside + correction * (10 * v - 2 * diagonal - 2 * far_h + far_v);
                let of_others = 8 * above + correction * (10 * v - 2 * diagonal - 2 * far_v + far_h);
                // At red or blue: green, and the opposite colour; 16ths.
                let of_green = 4 * (beside + above) + correction * (8 * v - 2 * (far_h + far_v));
                let of_opposite = 4 * diagonal + correction * (12 * v - 3 * (far_h + far_v));
                let is_green = (c % 2 == 0) == green_first;
                let own = if is_green { ROOT.short(shift_round(of_row, 4)) } else { here[c] };
                let other = ROOT.short(shift_round(if is_green { of_others } else { of_opposite }, 4));
                green[c] = if is_green { here[c] } else { ROOT.short(shift_round(of_green, 4)) };
                red[c] = if is_red_row { own } else { other };
                blue[c] = if is_red_row { other } else { own };
            }
        },
    )
}

/// The middle one of nine values, by the exchanges of J. L. Smith ("Implementing median filters in XC4000E FPGAs", 1996).
#[inline(always)]
fn median(mut p: [i32; 9]) -> i32 {
    let mut k = 0;
    // A loop over a constant list, which unrolls into minima and maxima.
    while k < EXCHANGES.len() {
        let (a, b) = EXCHANGES[k];
        (p[a], p[b]) = (p[a].min(p[b]), p[a].max(p[b]));
        k += 1;
    }
    p[4]
}

/// Places that are compared: the smaller value goes to the first.
const EXCHANGES: [(usize, usize); 19] = [
    (1, 2),
    (4, 5),
    (7, 8),
    (0, 1),
    (3, 4),
    (6, 7),
    (1, 2),
    (4, 5),
    (7, 8),
    (0, 3),
    (5, 8),
    (4, 7),
    (3, 6),
    (1, 4),
    (2, 5),
    (4, 7),
    (4, 2),
    (6, 4),
    (4, 2),
];

/// Moves colours `v` towards the median of the nine differences from green `g` by a share, [`WEIGHT`].
#[inline(always)]
fn median_towards(v: Around<'_, i16>, g: Around<'_, i16>, share: i32, out: &mut [i16]) {
    let [v0, v1, v2] = [v.at(-1, -1), v.at(-1, 0), v.at(-1, 1)];
    let [v3, v4, v5] = [v.at(0, -1), v.at(0, 0), v.at(0, 1)];
    let [v6, v7, v8] = [v.at(1, -1), v.at(1, 0), v.at(1, 1)];
    let [g0, g1, g2] = [g.at(-1, -1), g.at(-1, 0), g.at(-1, 1)];
    let [g3, g4, g5] = [g.at(0, -1), g.at(0, 0), g.at(0, 1)];
    let [g6, g7, g8] = [g.at(1, -1), g.at(1, 0), g.at(1, 1)];
    for c in 0..out.len() {
        let apart = |v: &[i16], g: &[i16]| i32::from(v[c]) - i32::from(g[c]);
        let above = [apart(v0, g0), apart(v1, g1), apart(v2, g2)];
        let here = [apart(v3, g3), apart(v4, g4), apart(v5, g5)];
        let below = [apart(v6, g6), apart(v7, g7), apart(v8, g8)];
        let [a, b, d] = [above, here, below];
        let change = median([a[0], a[1], a[2], b[0], b[1], b[2], d[0], d[1], d[2]]) - b[1];
        out[c] = ROOT.short(i32::from(v4[c]) + shift_round(change * (share >> 1), 11));
    }
}

/// Steps to the neighbours of a 3x3 window, and to its middle.
const WINDOW: [(isize, isize); 9] =
    [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 0), (0, 1), (1, -1), (1, 0), (1, 1)];

impl FalseColour {
    /// Roots of the three colours with less false colour.
    pub fn fixed(&self, [red, green, blue]: [Grid<i16>; 3]) -> [Grid<i16>; 3] {
        if self.strength == 0.0 {
            return [red, green, blue];
        }
        let strength = WEIGHT.of(self.strength);
        let [red, blue] = Grid::several_from_rows(
            green.size(),
            #[inline(always)]
            |row, [to_red, to_blue]| {
                for (colour, out) in [(&red, to_red), (&blue, to_blue)] {
                    let width = out.len();
                    let (v, g) = (colour.around(row, width), green.around(row, width));
                    median_towards(v, g, strength, out);
                }
            },
        );
        [red, green, blue]
    }

    /// The stage in floating point on the tape, with a gradient.
    pub fn smooth([red, green, blue]: [Tensor<4>; 3], theta: &Theta) -> [Tensor<4>; 3] {
        let strength = theta.number("false_colour.strength");
        let pulled = |colour: Tensor<4>| {
            let difference = colour - green.clone();
            let near = Stencil::new(&difference);
            let mut p = WINDOW.map(|(d, r)| near.at(d, r));
            for (a, b) in EXCHANGES {
                let (low, high) = (p[a].clone().min_pair(p[b].clone()), p[a].clone().max_pair(p[b].clone()));
                (p[a], p[b]) = (low, high);
            }
            let pulled = difference.clone() + (p[4].clone() - difference) * strength.clone();
            pulled + green.clone()
        };
        [pulled(red), green.clone(), pulled(blue)]
    }
}

/// Demosaicing on the tape: `[1, 1, height, width]` to the three colours, by the methods in floating point. The array is Bayer's.
pub fn smooth(method: Demosaic, mosaic: Tensor<4>, cfa: CfaPattern) -> [Tensor<4>; 3] {
    if method == Demosaic::Rcd {
        return ratio::smooth(&mosaic, cfa);
    }
    let [_, _, height, width] = mosaic.dims();
    let rgb: Tensor<4> =
        apply(Arc::new(DemosaicKernel { method, cfa, height, width }), [mosaic.into_dispatch()]);
    [0, 1, 2].map(|c: usize| rgb.clone().slice([0..1, c..c + 1, 0..height, 0..width]))
}

/// Demosaicing as a kernel.
#[derive(Debug)]
struct DemosaicKernel {
    method: Demosaic,
    cfa: CfaPattern,
    height: usize,
    width: usize,
}

const CHECKED: &str = "the frame was checked before";

impl Kernel for DemosaicKernel {
    fn forward(&self, inputs: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let origin = Placement { row: 0, col: 0 };
        let rgb = self.method.apply(inputs[0].values, self.height, self.width, self.cfa, origin);
        (rgb.expect(CHECKED).data, vec![1, CHANNELS, self.height, self.width])
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], _: &[bool]) -> Vec<Vec<f32>> {
        let data = gradient.to_vec();
        let d_rgb = LinearImage { channels: CHANNELS, height: self.height, width: self.width, data };
        let origin = Placement { row: 0, col: 0 };
        vec![self.method.adjoint(inputs[0].values, &d_rgb, self.cfa, origin).expect(CHECKED)]
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use super::*;

    #[test]
    fn false_colours_go_to_the_median_of_other_libraries() {
        let reference: serde_json::Value =
            serde_json::from_str(include_str!("../../../../tests/fixtures/isp_reference.json")).unwrap();
        let plane = |key: &str| -> Vec<Vec<f32>> { serde_json::from_value(reference[key].clone()).unwrap() };
        let (given, wanted) = (plane("gray_noisy"), plane("median3_reflect"));
        let (height, width) = (given.len(), given[0].len());
        let device = Default::default();
        // All of the way, where green is black: the median of red itself.
        let theta = Theta::new(
            Tensor::from_data(TensorData::from([1.0_f32]), &device),
            vec!["false_colour.strength".to_owned()],
        );
        let red = Tensor::<4>::from_data(TensorData::new(given.concat(), [1, 1, height, width]), &device);
        let [smooth, _, _] = FalseColour::smooth([red.clone(), red.zeros_like(), red.clone()], &theta);
        let smooth: Vec<f32> = smooth.into_data().try_to_vec().unwrap();
        let whole = |factor: f64| {
            Grid::from_rows([height, width], |row, out: &mut [i16]| {
                let roots = given[row].iter().map(|v| ROOT.of(factor * f64::from(*v)) as i16);
                out.iter_mut().zip(roots).for_each(|(out, v)| *out = v);
            })
        };
        let [fixed, _, _] = FalseColour { strength: 1.0 }.fixed([whole(1.0), whole(0.0), whole(1.0)]);
        // At the outermost pixels the border rules differ.
        for r in 1..height - 1 {
            for c in 1..width - 1 {
                let (found, wanted) = (smooth[r * width + c], wanted[r][c]);
                assert!((found - wanted).abs() < 1e-6, "({r}, {c}): {found} {wanted}");
                // A median commutes with rounding.
                assert_eq!(i32::from(fixed.row(r)[c]), ROOT.of(wanted.into()), "({r}, {c})");
            }
        }
    }
}
