//! Sine and cosine of a phase, several at a time.

use std::f64::consts::PI;

use pulp::Simd;

use crate::lanes::Lanes;

/// Terms of the series: the first one left out is below 1e-17.
const TERMS: usize = 12;

/// Coefficients in `t^2` of `sin(pi t) / t` (`first` = 1) or `cos(pi t)` (`first` = 0).
const fn series(first: usize) -> [f64; TERMS] {
    let mut coefficients = [0.0; TERMS];
    let mut term = if first == 1 { PI } else { 1.0 };
    let mut k = 0;
    while k < TERMS {
        coefficients[k] = term;
        let n = (2 * k + first) as f64;
        term *= -PI * PI / ((n + 1.0) * (n + 2.0));
        k += 1;
    }
    coefficients
}

const SINE: [f64; TERMS] = series(1);
const COSINE: [f64; TERMS] = series(0);

/// Adding this number rounds to an integer.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

/// Sine and cosine of `2 pi turns`, for up to 1e9 turns: to 4e-16 plus the rounding of `turns`.
#[inline(always)]
pub(super) fn sin_cos<S: Simd>(turns: Lanes<S>) -> [Lanes<S>; 2] {
    // Leave out whole turns: half of the phase is then within a quarter turn.
    let t = turns - ((turns + ROUNDING) - ROUNDING);
    let square = t * t;
    let (half_sin, half_cos) = (t * polynomial(&SINE, square), polynomial(&COSINE, square));
    // Double the angle.
    let twice = half_sin + half_sin;
    [twice * half_cos, t.constant(1.0) - twice * half_sin]
}

/// The series at `square`, by Horner's rule.
#[inline(always)]
fn polynomial<S: Simd>(series: &[f64; TERMS], square: Lanes<S>) -> Lanes<S> {
    let mut sum = square.constant(series[TERMS - 1]);
    // A loop, because a closure in place of it is compiled without the vector instructions of `S`.
    for c in series[..TERMS - 1].iter().rev() {
        sum = sum.mul_add(square, square.constant(*c));
    }
    sum
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use petzval_base::simd::dispatch;
    use pulp::WithSimd;

    use super::*;
    use crate::lanes::{MAX_LANES, width};

    struct Check([f64; MAX_LANES]);
    impl WithSimd for Check {
        type Output = ();
        fn with_simd<S: Simd>(self, simd: S) {
            let found = sin_cos(Lanes::load(simd, &self.0));
            let [mut sin, mut cos] = [[0.0; MAX_LANES]; 2];
            found[0].store(&mut sin);
            found[1].store(&mut cos);
            for (i, turns) in self.0.iter().enumerate().take(width::<S>()) {
                let (s, c) = (TAU * turns.fract()).sin_cos();
                assert!((sin[i] - s).abs() < 2e-15 && (cos[i] - c).abs() < 2e-15, "{turns}");
            }
        }
    }

    #[test]
    fn phases_of_every_quarter_agree_with_the_standard_library() {
        for block in 0..200 {
            dispatch(Check(std::array::from_fn(|i| (block * MAX_LANES + i) as f64 * 0.0137 - 21.0)));
        }
        dispatch(Check(std::array::from_fn(|i| i as f64 * 0.25 - 2.0)));
    }
}
