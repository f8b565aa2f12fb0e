//! Demosaicing of the roots of a mosaic, and suppression of false colours.
//!
//! The methods are those of [`Demosaic`](crate::isp::Demosaic), in whole numbers: the mean of neighbours, the filters of Malvar, He and
//! Cutler (ICASSP 2004), and the directional method of Menon, Andriani and Calvagno (2007) with its refinement, in
//! `demosaic_directional.rs`. The differences of red and blue from green are then pulled towards their median over 3x3 pixels, which takes
//! single pixels of wrong colour at edges out (W. T. Freeman, US patent 4,724,395, 1988).

use std::sync::Arc;

use burn::prelude::*;

use super::super::fixed::{Grid, ROOT, WEIGHT, shift_round};
use super::super::tape_grid::{Stencil, Theta};
use super::demosaic_directional::directional;
use crate::image::{CHANNELS, LinearImage};
use crate::isp::Demosaic;
use crate::render::Placement;
use crate::sensor::{CfaPattern, Colour};
use crate::tape::{HostKernel, apply};

petzval_base::parameters! {
    /// Suppression of false colours after demosaicing.
    pub struct FalseColour {
        /// Share of the way to the median of the neighbours' colours.
        strength: f64 = 0.3, "", 0.0..1.0, Linear, "0 leaves the colours";
    }
}

/// Roots of the three colours from the roots of a mosaic. The ratio-corrected method divides pixel by pixel, which this chip does not; it
/// takes the directional one instead.
pub fn fixed(method: Demosaic, mosaic: &Grid, cfa: CfaPattern) -> [Grid; 3] {
    match method {
        Demosaic::Bilinear => linear(mosaic, cfa, false),
        Demosaic::Malvar => linear(mosaic, cfa, true),
        Demosaic::Rcd | Demosaic::Menon => directional(mosaic, cfa),
    }
}

/// Bilinear interpolation, with or without the corrections of Malvar, He and Cutler. Weights are multiples of 1/16.
fn linear(mosaic: &Grid, cfa: CfaPattern, is_corrected: bool) -> [Grid; 3] {
    let correction = i32::from(is_corrected);
    Grid::three_from_rows(mosaic.height, mosaic.width, |row, [red, green, blue]| {
        let width = red.len();
        let line = |down, right| &mosaic.near(row, down, right)[..width];
        let (left, right, up, down) = (line(0, -1), line(0, 1), line(-1, 0), line(1, 0));
        let corners = [line(-1, -1), line(-1, 1), line(1, -1), line(1, 1)];
        let (left2, right2, up2, down2) = (line(0, -2), line(0, 2), line(-2, 0), line(2, 0));
        let here = line(0, 0);
        let (green, blue) = (&mut green[..width], &mut blue[..width]);
        // Every row holds green and one other colour, which the row is named after.
        let green_first = cfa.colour(row, 0) == Colour::Green;
        let is_red_row = cfa.colour(row, usize::from(green_first)) == Colour::Red;
        for c in 0..width {
            let v = here[c];
            let (beside, above) = (left[c] + right[c], up[c] + down[c]);
            let diagonal = corners[0][c] + corners[1][c] + corners[2][c] + corners[3][c];
            let (far_h, far_v) = (left2[c] + right2[c], up2[c] + down2[c]);
            // At green: the colour of the row, and that of the other rows; 16ths.
            let of_row = 8 * beside + correction * (10 * v - 2 * diagonal - 2 * far_h + far_v);
            let of_others = 8 * above + correction * (10 * v - 2 * diagonal - 2 * far_v + far_h);
            // At red or blue: green, and the opposite colour; 16ths.
            let of_green = 4 * (beside + above) + correction * (8 * v - 2 * (far_h + far_v));
            let of_opposite = 4 * diagonal + correction * (12 * v - 3 * (far_h + far_v));
            let is_green = (c % 2 == 0) == green_first;
            let own = if is_green { ROOT.clamp(shift_round(of_row, 4)) } else { v };
            let other = ROOT.clamp(shift_round(if is_green { of_others } else { of_opposite }, 4));
            green[c] = if is_green { v } else { ROOT.clamp(shift_round(of_green, 4)) };
            red[c] = if is_red_row { own } else { other };
            blue[c] = if is_red_row { other } else { own };
        }
    })
}

/// The middle one of nine values, by the exchanges of J. L. Smith ("Implementing median filters in XC4000E FPGAs", 1996).
#[inline(always)]
fn median(mut p: [i32; 9]) -> i32 {
    for (a, b) in EXCHANGES {
        (p[a], p[b]) = (p[a].min(p[b]), p[a].max(p[b]));
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

/// Steps to the neighbours of a 3x3 window, and to its middle.
const WINDOW: [(isize, isize); 9] =
    [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 0), (0, 1), (1, -1), (1, 0), (1, 1)];

impl FalseColour {
    /// Roots of the three colours with less false colour.
    pub fn fixed(&self, [red, green, blue]: [Grid; 3]) -> [Grid; 3] {
        if self.strength == 0.0 {
            return [red, green, blue];
        }
        let strength = WEIGHT.of(self.strength);
        let [red, _, blue] = Grid::three_from_rows(green.height, green.width, |row, [to_red, _, to_blue]| {
            for (colour, out) in [(&red, to_red), (&blue, to_blue)] {
                let width = out.len();
                let of =
                    WINDOW.map(|(d, r)| (&colour.near(row, d, r)[..width], &green.near(row, d, r)[..width]));
                for c in 0..width {
                    let differences = of.map(|(v, g)| v[c] - g[c]);
                    let change = shift_round((median(differences) - differences[4]) * (strength >> 1), 11);
                    out[c] = ROOT.clamp(of[4].0[c] + change);
                }
            }
        });
        [red, green, blue]
    }

    /// The same on the tape.
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
    let [_, _, height, width] = mosaic.dims();
    // The ratio-corrected method has no gradient.
    let method = if method == Demosaic::Rcd { Demosaic::Menon } else { method };
    let rgb: Tensor<4> = apply(Arc::new(DemosaicKernel { method, cfa, height, width }), mosaic);
    [0, 1, 2].map(|c: usize| rgb.clone().slice([0..1, c..c + 1, 0..height, 0..width]))
}

/// Demosaicing as a host kernel.
#[derive(Debug)]
struct DemosaicKernel {
    method: Demosaic,
    cfa: CfaPattern,
    height: usize,
    width: usize,
}

const CHECKED: &str = "the frame was checked before";

impl HostKernel for DemosaicKernel {
    fn output_shape(&self) -> Vec<usize> {
        vec![1, CHANNELS, self.height, self.width]
    }

    fn forward(&self, inputs: &[&[f32]]) -> Vec<f32> {
        let origin = Placement { row: 0, col: 0 };
        self.method.apply(inputs[0], self.height, self.width, self.cfa, origin).expect(CHECKED).data
    }

    fn adjoint(&self, inputs: &[&[f32]], d_output: &[f32]) -> Vec<Vec<f32>> {
        let d_rgb = LinearImage {
            channels: CHANNELS,
            height: self.height,
            width: self.width,
            data: d_output.to_vec(),
        };
        let origin = Placement { row: 0, col: 0 };
        vec![self.method.adjoint(inputs[0], &d_rgb, self.cfa, origin).expect(CHECKED)]
    }
}
