//! Output: brightness and contrast, then the bits of the picture.
//!
//! `(v - 1/2) * contrast + 1/2 + brightness`, cut off at black and white.

use burn::prelude::*;

use super::super::fixed::{ENCODED, Grid, WEIGHT, in_vectors, shift_round};
use super::super::tape_grid::Theta;

petzval_base::parameters! {
    /// Brightness and contrast of the picture.
    pub struct Output {
        /// Added to every value, of white.
        brightness: f64 = 0.0, "", -0.25..0.25, Linear, "0 leaves the picture";
        /// Contrast about middle gray.
        contrast: f64 = 1.0, "", 0.5..2.0, Log, "1 leaves the picture";
    }
}

impl Output {
    /// Whole values of `bits` from encoded ones: red, green, blue, row by row.
    pub fn fixed(&self, rgb: &[Grid<i16>; 3], bits: u32) -> Vec<u16> {
        let (height, width) = (rgb[0].height, rgb[0].width);
        let half = ENCODED.one() / 2;
        let (contrast, offset) = (WEIGHT.of(self.contrast), half + ENCODED.of(self.brightness));
        let white = (1_i32 << bits) - 1;
        let mut data = vec![0; 3 * height * width];
        for (grid, plane) in rgb.iter().zip(data.chunks_exact_mut(height * width)) {
            use rayon::prelude::*;
            plane.par_chunks_exact_mut(width).enumerate().for_each(|(row, out)| {
                in_vectors(
                    #[inline(always)]
                    || {
                        for (out, v) in out.iter_mut().zip(grid.row(row)) {
                            let v = shift_round((i32::from(*v) - half) * contrast, WEIGHT.fraction) + offset;
                            // At most 2^14 times 2^16.
                            let v = v.clamp(0, ENCODED.one());
                            *out = ((v * white + (1 << (ENCODED.fraction - 1))) >> ENCODED.fraction) as u16;
                        }
                    },
                );
            });
        }
        data
    }

    /// The same on the tape, without rounding; it is cut off at black and white as well.
    pub fn smooth(rgb: [Tensor<4>; 3], theta: &Theta) -> Tensor<4> {
        let (contrast, brightness) = (theta.number("output.contrast"), theta.number("output.brightness"));
        let picture = Tensor::cat(rgb.to_vec(), 1);
        ((picture - 0.5) * contrast + 0.5 + brightness).clamp(0.0, 1.0)
    }
}

/// Luma and colour differences of an encoded pixel 0..1 by a standard, full range: Y 0..1, Cb and Cr -1/2..1/2.
///
/// `Y = kr R + (1 - kr - kb) G + kb B`, `Cb = (B - Y) / (2 (1 - kb))`, `Cr = (R - Y) / (2 (1 - kr))`.
pub fn ycbcr(rgb: [f64; 3], [kr, kb]: [f64; 2]) -> [f64; 3] {
    let [r, g, b] = rgb;
    let y = kr * r + (1.0 - kr - kb) * g + kb * b;
    [y, (b - y) / (2.0 * (1.0 - kb)), (r - y) / (2.0 * (1.0 - kr))]
}

/// Shares of red and blue in the luma of ITU-R BT.601.
pub const BT601: [f64; 2] = [0.299, 0.114];
/// Shares of red and blue in the luma of ITU-R BT.709.
pub const BT709: [f64; 2] = [0.2126, 0.0722];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn luma_and_colour_differences_are_those_of_the_standards() {
        let reference: serde_json::Value =
            serde_json::from_str(include_str!("../../../tests/fixtures/isp_reference.json")).unwrap();
        let triple = |value: &serde_json::Value| [0, 1, 2].map(|c| value[c].as_f64().unwrap());
        let of = &reference["ycbcr"];
        for (name, standard) in [("bt601_full", BT601), ("bt709_full", BT709)] {
            for (rgb, wanted) in of["rgb"].as_array().unwrap().iter().zip(of[name].as_array().unwrap()) {
                let (found, wanted) = (ycbcr(triple(rgb), standard), triple(wanted));
                for c in 0..3 {
                    assert!((found[c] - wanted[c]).abs() < 1e-6, "{name}: {found:?} {wanted:?}");
                }
            }
        }
    }
}
