//! Colour matrix: from the camera's colours to linear sRGB.
//!
//! `M = S (C + D)`: C is the calibrated matrix (the identity without one), D holds the six mixing terms, whose rows add up to 0 so that
//! white stays white, and S is the saturation, `S = s I + (1 - s) 1 (0.2126, 0.7152, 0.0722)` (the luminance of ITU-R BT.709).

use burn::prelude::*;

use super::super::fixed::{LINEAR, WEIGHT, shift_round};
use super::super::tape_grid::Theta;
use crate::spectral::{Matrix3, product};

petzval_base::parameters! {
    /// Colour matrix and saturation.
    pub struct Colours {
        /// Changes of the matrix: green and blue in red, red and blue in green, red and green in blue.
        mixing: [f64; 6] = [0.0; 6], "", -2.0..2.0, Linear, "0 is the calibrated matrix";
        /// Saturation.
        saturation: f64 = 1.0, "", 0.0..2.0, Linear, "0 is gray, 1 as calibrated";
    }
}

/// Shares of the colours in luminance, ITU-R BT.709.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// The place of each mixing term in the matrix.
const PLACES: [(usize, usize); 6] = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)];

impl Colours {
    /// The whole matrix.
    pub fn matrix(&self, calibrated: Option<Matrix3>) -> Matrix3 {
        let mut mixed = calibrated.unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        for ((row, col), change) in PLACES.into_iter().zip(self.mixing) {
            mixed[row][col] += change;
            mixed[row][row] -= change;
        }
        let s = self.saturation;
        let of = |row: usize, col: usize| if row == col { s } else { 0.0 } + (1.0 - s) * LUMINANCE[col];
        product(&[0, 1, 2].map(|row| [0, 1, 2].map(|col| of(row, col))), &mixed)
    }

    /// The matrix as whole numbers, [`WEIGHT`].
    pub fn registers(&self, calibrated: Option<Matrix3>) -> [[i32; 3]; 3] {
        self.matrix(calibrated).map(|row| row.map(|v| WEIGHT.of(v)))
    }

    /// The stage in floating point on the tape, with a gradient.
    pub fn smooth(rgb: [Tensor<4>; 3], calibrated: Option<Matrix3>, theta: &Theta) -> [Tensor<4>; 3] {
        let mut mixed = [0, 1, 2].map(|row| {
            let of = |col: usize| calibrated.map_or(f64::from(u8::from(row == col)), |m| m[row][col]);
            let terms = rgb.clone().into_iter().enumerate().map(|(col, plane)| plane * of(col));
            terms.reduce(|a, b| a + b).expect("three colours")
        });
        for (k, (row, col)) in PLACES.into_iter().enumerate() {
            let change = theta.number(&format!("colours.mixing[{k}]"));
            mixed[row] = mixed[row].clone() + (rgb[col].clone() - rgb[row].clone()) * change;
        }
        let luminance = mixed.iter().zip(LUMINANCE).map(|(plane, share)| plane.clone() * share);
        let luminance = luminance.reduce(|a, b| a + b).expect("three colours");
        let s = theta.number("colours.saturation");
        mixed.map(|plane| luminance.clone() + (plane - luminance.clone()) * s.clone())
    }
}

/// Colours, [`LINEAR`], by a matrix, [`WEIGHT`].
#[inline(always)]
pub fn mixed(matrix: &[[i32; 3]; 3], rgb: [i32; 3]) -> [i32; 3] {
    // The upper and the lower 12 bits are multiplied apart, so that sums fit 32 bits; only the lower ones have digits to round.
    let sum = |row: &[i32; 3], [r, g, b]: [i32; 3]| row[0] * r + row[1] * g + row[2] * b;
    let (upper, lower) = (rgb.map(|v| v >> WEIGHT.fraction), rgb.map(|v| v & (WEIGHT.one() - 1)));
    let of = |row: &[i32; 3]| LINEAR.clamp(sum(row, upper) + shift_round(sum(row, lower), WEIGHT.fraction));
    [of(&matrix[0]), of(&matrix[1]), of(&matrix[2])]
}
