//! Green equalisation: greens of rows with red and greens of rows with blue answer slightly differently, which demosaicing would turn
//! into a pattern of squares.
//!
//! `g + strength / 2 * influence(other - own)`: own is the local mean of greens of the same rows (weights 4 in the middle, 1 at
//! distance 2), other that of the four diagonal greens. Differences beyond the threshold are detail and stay.

use burn::prelude::*;

use super::super::fixed::{Biweight, COLOUR, Grid, ROOT, WEIGHT, shift_round};
use super::super::tape_grid::{Stencil, Theta, colour_mask, influence};
use crate::sensor::{CfaPattern, Colour};

petzval_base::parameters! {
    /// Green equalisation.
    pub struct GreenBalance {
        /// Share of the difference of the two greens that is taken out.
        strength: f64 = 0.5, "", 0.0..1.0, Linear, "0 leaves them as they are";
        /// Difference beyond which it is detail.
        threshold: f64 = 3.0, "sigma", 0.5..8.0, Log, "in standard deviations of the noise";
    }
}

impl GreenBalance {
    /// Roots of a mosaic to roots of a mosaic.
    pub fn fixed(&self, mosaic: Grid<i16>, cfa: CfaPattern, sigma: f64) -> Grid<i16> {
        if self.strength == 0.0 {
            return mosaic;
        }
        let (biweight, half) = (Biweight::new(self.threshold * sigma), WEIGHT.of(0.5 * self.strength));
        Grid::from_rows(
            mosaic.size(),
            #[inline(always)]
            |row, out| {
                let near = mosaic.around(row, out.len());
                let diagonal = [near.at(-1, -1), near.at(-1, 1), near.at(1, -1), near.at(1, 1)];
                let beside = [near.at(-2, 0), near.at(0, -2), near.at(0, 2), near.at(2, 0)];
                let here = near.at(0, 0);
                let first = usize::from(cfa.colour(row, 0) != Colour::Green);
                for c in 0..out.len() {
                    let v = i32::from(here[c]);
                    let sum =
                        |lines: &[&[i16]; 4]| -> i32 { lines.iter().map(|line| i32::from(line[c])).sum() };
                    let (other, own) = (sum(&diagonal), 4 * v + sum(&beside));
                    let apart = COLOUR.short(shift_round(2 * other - own, 3));
                    let change = i32::from(biweight.influence(apart)) * half;
                    let moved = ROOT.short(v + shift_round(change, WEIGHT.fraction));
                    out[c] = if c % 2 == first { moved } else { here[c] };
                }
            },
        )
    }

    /// The stage in floating point on the tape, with a gradient.
    pub fn smooth(mosaic: Tensor<4>, cfa: CfaPattern, sigma: Tensor<4>, theta: &Theta) -> Tensor<4> {
        let near = Stencil::new(&mosaic);
        let other = (near.at(-1, -1) + near.at(-1, 1) + near.at(1, -1) + near.at(1, 1)) * 0.25;
        let beside = near.at(-2, 0) + near.at(0, -2) + near.at(0, 2) + near.at(2, 0);
        let own = (mosaic.clone() * 4.0 + beside) * 0.125;
        let limit = theta.number("green_balance.threshold") * sigma;
        let change = influence(other - own, limit) * theta.number("green_balance.strength") * 0.5;
        mosaic.clone() + change * colour_mask(cfa, Colour::Green, &mosaic)
    }
}
