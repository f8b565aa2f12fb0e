//! Gamma: from linear light to the values of a display.
//!
//! A power with a straight toe: `toe x` below x0, and `(1 + a) x^(1 / exponent) - a` above, where x0 and a make curve and slope
//! continuous: `1 + toe x0 (exponent - 1) = toe exponent x0^(1 - 1 / exponent)` and `a = toe x0 (exponent - 1)`. Exponent 2.4 and toe 12.92
//! are sRGB (IEC 61966-2-1); exponent 2.22 and toe 4.5 are ITU-R BT.709.

use burn::prelude::*;

use super::super::fixed::{ENCODED, LINEAR, OctaveTable};
use super::super::tape_grid::Theta;

petzval_base::parameters! {
    /// Gamma curve.
    pub struct Gamma {
        /// Exponent of the power.
        exponent: f64 = 2.4, "", 1.4..3.0, Linear, "2.4 with a toe of 12.92 is sRGB";
        /// Slope of the toe.
        toe: f64 = 12.92, "", 2.0..20.0, Log, "4.5 with an exponent of 2.22 is ITU-R BT.709";
    }
}

/// Where the toe ends: the root of `f(x) = 1 + toe x (exponent - 1) - toe exponent x^(1 - 1 / exponent)` below the minimum of f, which
/// is at 1 / (a power of the toe).
fn toe_end(exponent: f64, toe: f64) -> f64 {
    let f = |x: f64| 1.0 + toe * x * (exponent - 1.0) - toe * exponent * x.powf(1.0 - 1.0 / exponent);
    // f falls from 1 at 0 to its minimum at 1, where it is 1 - toe.
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if f(middle) > 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The curve at light x in 0..1, whose toe ends at `end` and whose offset is a.
fn of_pieces(x: f64, exponent: f64, toe: f64, (end, a): (f64, f64)) -> f64 {
    if x <= end { toe * x } else { (1.0 + a) * x.powf(1.0 / exponent) - a }
}

impl Gamma {
    /// Where the toe ends, and the offset a, for which curve and slope are continuous.
    fn pieces(&self) -> (f64, f64) {
        let end = toe_end(self.exponent, self.toe);
        (end, self.toe * end * (self.exponent - 1.0))
    }

    /// The curve from light to encoded values; below 0 and above 1 it has the value of the end.
    pub fn curve(&self) -> impl Fn(f64) -> f64 {
        let (&Self { exponent, toe }, pieces) = (self, self.pieces());
        move |light: f64| of_pieces(light.clamp(0.0, 1.0), exponent, toe, pieces)
    }

    /// The curve as a table from [`LINEAR`] to [`ENCODED`].
    pub fn table(&self) -> OctaveTable {
        let (one, curve) = (f64::from(LINEAR.one()), self.curve());
        OctaveTable::new(LINEAR.one(), ENCODED, |v| curve(v / one))
    }

    /// The stage in floating point on the tape, with a gradient.
    pub fn smooth(&self, light: Tensor<4>, theta: &Theta) -> Tensor<4> {
        let (exponent, toe) = (theta.number("gamma.exponent"), theta.number("gamma.toe"));
        // One step of Newton from the end that was found off the tape leaves its value and gives it its derivatives.
        let found = toe_end(self.exponent, self.toe);
        let slope = self.toe * (self.exponent - 1.0) * (1.0 - found.powf(-1.0 / self.exponent));
        let power = ((-exponent.clone().recip() + 1.0) * found.ln()).exp();
        let f = toe.clone() * (exponent.clone() - 1.0) * found + 1.0 - toe.clone() * exponent.clone() * power;
        let end = -f / slope + found;
        let a = toe.clone() * end.clone() * (exponent.clone() - 1.0);
        let dims = light.dims();
        let x = light.clamp(0.0, 1.0);
        let above = x.clone().max_pair(end.clone().expand(dims));
        let of_power = (above.log() / exponent).exp() * (a.clone() + 1.0) - a;
        let below = x.clone().min_pair(end.expand(dims)) * toe.clone();
        let is_below = x.lower_elem(found);
        of_power.mask_where(is_below, below)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SRGB: Gamma = Gamma { exponent: 2.4, toe: 12.92 };
    const BT709: Gamma = Gamma { exponent: 1.0 / 0.45, toe: 4.5 };

    /// Light, and its encoded values by sRGB and by BT.709.
    fn reference() -> [Vec<f64>; 3] {
        let reference: serde_json::Value =
            serde_json::from_str(include_str!("../../../tests/fixtures/isp_reference.json")).unwrap();
        [&reference["srgb"]["linear"], &reference["srgb"]["encoded"], &reference["bt709_oetf"]]
            .map(|value| serde_json::from_value(value.clone()).unwrap())
    }

    #[test]
    fn with_the_rounded_constants_of_the_standards_it_is_their_curve() {
        let [linear, srgb, bt709] = reference();
        for (gamma, end, a, encoded) in [(SRGB, 0.003_130_8, 0.055, srgb), (BT709, 0.018, 0.099, bt709)] {
            for (x, wanted) in linear.iter().zip(&encoded) {
                let found = of_pieces(*x, gamma.exponent, gamma.toe, (end, a));
                assert!((found - wanted).abs() < 1e-6, "{gamma:?} at {x}: {found} {wanted}");
            }
        }
    }

    #[test]
    fn its_own_constants_leave_no_step_and_stay_near_the_standards() {
        // ITU-R BT.2020 gives the constants of its 10-bit and 12-bit curves, those of BT.709 without the rounding.
        let (end, a) = BT709.pieces();
        assert!((end - 0.018_053_968_510_807).abs() < 1e-12 && (a - 0.099_296_826_809_44).abs() < 1e-12);
        // The standards round end and offset, which leaves a step and a kink; most of the difference is the rounded offset, up to 1.1e-5 of
        // sRGB and 3.0e-4 of BT.709, times what the power lacks to 1.
        let [linear, srgb, bt709] = reference();
        for (gamma, tolerance, encoded) in [(SRGB, 1.1e-5, srgb), (BT709, 3e-4, bt709)] {
            let far = |(x, wanted): (&f64, &f64)| (gamma.curve()(*x) - wanted).abs();
            let farthest = linear.iter().zip(&encoded).map(far).fold(0.0, f64::max);
            assert!(farthest < tolerance && farthest > 0.5 * tolerance, "{gamma:?}: {farthest}");
        }
    }
}
