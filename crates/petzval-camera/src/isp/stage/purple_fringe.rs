//! Purple fringes: at high edges, residual longitudinal colour leaves red and blue without green; there they are cut towards green.
//!
//! `red - strength * e * p` and the same for blue, with `p = max(min(red, blue) - green - threshold, 0)` in roots of light and the edge
//! measure `e = min(4 (max - min of green over 5 pixels of a cross at distance 2), 1)`: purple things without an edge keep their colour.

use burn::prelude::*;

use super::super::fixed::{Grid, ROOT, WEIGHT, shift_round};
use super::super::tape_grid::{Stencil, Theta};

petzval_base::parameters! {
    /// Suppression of purple fringes.
    pub struct PurpleFringe {
        /// Share of the purple that is taken out at an edge.
        strength: f64 = 0.0, "", 0.0..1.0, Linear, "0 leaves it";
        /// Purple below which nothing happens, in the root of light.
        threshold: f64 = 0.02, "", 0.0..0.5, Linear, "noise is about 0.005";
    }
}

/// Steps of the cross.
const CROSS: [(isize, isize); 4] = [(-2, 0), (0, -2), (0, 2), (2, 0)];

impl PurpleFringe {
    /// Roots of the three colours.
    pub fn fixed(&self, [red, green, blue]: [Grid<i16>; 3]) -> [Grid<i16>; 3] {
        if self.strength == 0.0 {
            return [red, green, blue];
        }
        let (strength, threshold) = (WEIGHT.of(self.strength), ROOT.of(self.threshold));
        let [red, blue] = Grid::several_from_rows(
            green.size(),
            #[inline(always)]
            |row, [to_red, to_blue]| {
                let width = to_red.len();
                let near = green.around(row, width);
                let [above, left, right, below] =
                    [near.at(-2, 0), near.at(0, -2), near.at(0, 2), near.at(2, 0)];
                let (r, g, b) =
                    (red.around(row, width).at(0, 0), near.at(0, 0), blue.around(row, width).at(0, 0));
                let to_blue = &mut to_blue[..width];
                for c in 0..width {
                    let high = g[c].max(above[c]).max(left[c]).max(right[c]).max(below[c]);
                    let low = g[c].min(above[c]).min(left[c]).min(right[c]).min(below[c]);
                    let edge = (4 * (i32::from(high) - i32::from(low))).min(ROOT.one());
                    let [r, g, b] = [r[c], g[c], b[c]].map(i32::from);
                    let purple = (r.min(b) - g - threshold).max(0);
                    let share = (edge * strength) >> ROOT.fraction;
                    let cut = shift_round(purple * (share >> 1), 11);
                    (to_red[c], to_blue[c]) = (ROOT.short(r - cut), ROOT.short(b - cut));
                }
            },
        );
        [red, green, blue]
    }

    /// The stage in floating point on the tape, with a gradient.
    pub fn smooth([red, green, blue]: [Tensor<4>; 3], theta: &Theta) -> [Tensor<4>; 3] {
        let near = Stencil::new(&green);
        let cross = CROSS.map(|(d, r)| near.at(d, r));
        let high = cross.iter().fold(green.clone(), |high, v| high.max_pair(v.clone()));
        let low = cross.iter().fold(green.clone(), |low, v| low.min_pair(v.clone()));
        let edge = ((high - low) * 4.0).clamp_max(1.0);
        let purple =
            red.clone().min_pair(blue.clone()) - green.clone() - theta.number("purple_fringe.threshold");
        let cut = purple.clamp_min(0.0) * edge * theta.number("purple_fringe.strength");
        [red - cut.clone(), green, blue - cut]
    }
}
