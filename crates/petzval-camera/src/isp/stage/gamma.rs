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

impl Gamma {
    /// The curve from light to encoded values; below 0 and above 1 it has the value of the end.
    pub fn curve(&self) -> impl Fn(f64) -> f64 {
        let Self { exponent, toe } = *self;
        let end = toe_end(exponent, toe);
        let a = toe * end * (exponent - 1.0);
        move |light: f64| {
            let x = light.clamp(0.0, 1.0);
            if x <= end { toe * x } else { (1.0 + a) * x.powf(1.0 / exponent) - a }
        }
    }

    /// The curve as a table from [`LINEAR`] to [`ENCODED`].
    pub fn table(&self) -> OctaveTable {
        let (one, curve) = (f64::from(LINEAR.one()), self.curve());
        OctaveTable::new(LINEAR.one(), ENCODED, |v| curve(v / one))
    }

    /// The same on the tape.
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

    #[test]
    fn it_is_the_curve_of_the_standards() {
        let reference: serde_json::Value =
            serde_json::from_str(include_str!("../../../tests/fixtures/isp_reference.json")).unwrap();
        let list = |value: &serde_json::Value| -> Vec<f64> {
            value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
        };
        let srgb = Gamma::default();
        let (linear, encoded) = (list(&reference["srgb"]["linear"]), list(&reference["srgb"]["encoded"]));
        for (x, wanted) in linear.iter().zip(&encoded) {
            // The standard rounds its constants so that its two pieces meet within 4e-5 only.
            assert!((srgb.curve()(*x) - wanted).abs() < 6e-4, "{x}: {} {wanted}", srgb.curve()(*x));
        }
        let bt709 = Gamma { exponent: 1.0 / 0.45, toe: 4.5 };
        for (x, wanted) in linear.iter().zip(list(&reference["bt709_oetf"])) {
            assert!((bt709.curve()(*x) - wanted).abs() < 6e-4, "{x}: {} {wanted}", bt709.curve()(*x));
        }
    }
}
