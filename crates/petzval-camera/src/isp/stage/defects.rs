//! Defect pixels: a pixel far outside its eight neighbours of the same colour is hot or dead, and becomes like the two opposite
//! neighbours that differ least.
//!
//! Beyond the neighbours' extremes by more than the threshold, the replacement fades in over another threshold:
//! `v + slope * clamp(excess / threshold - 1, 0, 1) * (pair - v)`.

use burn::prelude::*;

use super::super::fixed::{Grid, ROOT, WEIGHT, shift_round};
use super::super::tape_grid::{Stencil, Theta};

petzval_base::parameters! {
    /// Correction of hot and dead pixels.
    pub struct Defects {
        /// Distance beyond the neighbours' extremes at which a pixel counts as defect, in the root of light.
        threshold: f64 = 0.08, "", 0.01..1.0, Log, "0.08 lets sharp points of light live";
        /// Share of a defect pixel that is replaced.
        slope: f64 = 1.0, "", 0.0..1.0, Linear, "0 leaves defects as they are";
    }
}

/// Steps to a neighbour and, with the opposite sign, to the one across.
const PAIRS: [(isize, isize); 4] = [(0, 2), (2, 0), (2, 2), (2, -2)];

impl Defects {
    /// Roots of a mosaic to roots of a mosaic.
    pub fn fixed(&self, mosaic: Grid<i16>) -> Grid<i16> {
        if self.slope == 0.0 {
            return mosaic;
        }
        let threshold = ROOT.of(self.threshold).max(1);
        let (inverse, slope) = ((1 << 24) / threshold, WEIGHT.of(self.slope));
        Grid::from_rows(
            mosaic.size(),
            #[inline(always)]
            |row, out| {
                let near = mosaic.around(row, out.len());
                let pairs = [
                    [near.at(0, 2), near.at(0, -2)],
                    [near.at(2, 0), near.at(-2, 0)],
                    [near.at(2, 2), near.at(-2, -2)],
                    [near.at(2, -2), near.at(-2, 2)],
                ];
                let here = near.at(0, 0);
                for c in 0..out.len() {
                    let v = i32::from(here[c]);
                    let (mut low, mut high, mut closest, mut sum) = (i32::MAX, i32::MIN, i32::MAX, 0);
                    for [one, across] in pairs {
                        let (a, b) = (i32::from(one[c]), i32::from(across[c]));
                        (low, high) = (low.min(a).min(b), high.max(a).max(b));
                        let apart = (a - b).abs();
                        sum = if apart < closest { a + b } else { sum };
                        closest = closest.min(apart);
                    }
                    let excess = (v - high).max(low - v) - threshold;
                    // Share of the threshold, 12 bits, times the slope.
                    let share = (excess.max(0).min(threshold) * inverse) >> 12;
                    let blend = (share * slope) >> 12;
                    out[c] = ROOT.short(
                        v + shift_round((shift_round(sum, 1) - v).clamp(-65535, 65535) * (blend >> 1), 11),
                    );
                }
            },
        )
    }

    /// The same on the tape. Which pair differs least is a decision without a gradient.
    pub fn smooth(mosaic: Tensor<4>, theta: &Theta) -> Tensor<4> {
        let near = Stencil::new(&mosaic);
        let pairs = PAIRS.map(|(down, right)| (near.at(down, right), near.at(-down, -right)));
        let [mut low, mut high] = [0, 1].map(|_| pairs[0].0.clone());
        let (mut closest, mut mean) =
            ((pairs[0].0.clone() - pairs[0].1.clone()).abs(), pairs[0].0.clone() * 0.0);
        for (k, (a, b)) in pairs.into_iter().enumerate() {
            low = low.min_pair(a.clone()).min_pair(b.clone());
            high = high.max_pair(a.clone()).max_pair(b.clone());
            let apart = (a.clone() - b.clone()).abs();
            let middle = (a + b) * 0.5;
            mean = match k {
                0 => middle,
                _ => mean.mask_where(apart.clone().lower(closest.clone()), middle),
            };
            closest = closest.min_pair(apart);
        }
        let excess = (mosaic.clone() - high).max_pair(low - mosaic.clone());
        let share = (excess / theta.number("defects.threshold") - 1.0).clamp(0.0, 1.0);
        mosaic.clone() + share * theta.number("defects.slope") * (mean - mosaic)
    }
}
