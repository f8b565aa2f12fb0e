//! Logarithm, exponential, sine and cosine from sums, products and bit patterns.
//!
//! The standard library's functions take one number per call, and their last bits differ between machines. The functions
//! here have no branches, so the compiler turns a loop over them into vector code. They use no fused multiply-add, so they
//! give the same bits at every vector width. All are Taylor series on a reduced argument; the tests state their accuracy.

const MANTISSA: u64 = (1 << 52) - 1;
/// Bits of the double sqrt(1/2), rounded down.
const SQRT_HALF: u64 = 0x3FE6_A09E_667F_3BCC;
const ONE: u64 = 1023 << 52;
/// ln 2 in two parts. The first ends in zero bits, so its product with a whole number below 2^20 is exact.
const LN_2: [f64; 2] = [f64::from_bits(0x3FE6_2E42_FEE0_0000), 1.908_214_929_270_587_7e-10];

/// The double in (0, 1) of the upper 52 bits: the middle of one of 2^52 equal cells, so never 0 or 1.
#[inline(always)]
pub(super) fn unit(bits: u64) -> f64 {
    f64::from_bits(bits >> 12 | ONE) - (1.0 - f64::EPSILON / 2.0)
}

/// `(atanh(s) - s) / s^3` for `w = s^2 <= 0.0295`, as a series of eleven terms.
#[inline(always)]
pub(super) fn atanh_tail(w: f64) -> f64 {
    let mut sum = 1.0 / 23.0;
    for odd in [21.0, 19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0] {
        sum = sum * w + 1.0 / odd;
    }
    sum
}

/// Natural logarithm of a positive normal number, to 2 units in the last place.
///
/// `x = 2^e m` with `m` in `[sqrt(1/2), sqrt(2))`, and `ln m = 2 atanh((m - 1) / (m + 1))`.
#[inline(always)]
pub(super) fn ln(x: f64) -> f64 {
    let above = x.to_bits().wrapping_sub(SQRT_HALF);
    let m = f64::from_bits((above & MANTISSA) + SQRT_HALF);
    // Convert the exponent to a double: biased to be positive, it is written into the mantissa of 2^52.
    let biased = above.wrapping_add(ONE) >> 52;
    let e = f64::from_bits(biased | (1075 << 52)) - ((1u64 << 52) as f64 + 1023.0);
    let s = (m - 1.0) / (m + 1.0);
    let w = s * s;
    let tail = 2.0 * s * (w * atanh_tail(w));
    e * LN_2[0] + (2.0 * s + (tail + e * LN_2[1]))
}

/// Exponential of a number in -700..700, to 2 units in the last place.
///
/// `exp(x) = 2^n exp(r)` with the whole number `n` nearest to `x / ln 2` and `|r| <= ln(2) / 2`.
#[inline(always)]
pub(super) fn exp(x: f64) -> f64 {
    let (n, bits) = nearest(x * std::f64::consts::LOG2_E);
    let r = (x - n * LN_2[0]) - n * LN_2[1];
    let mut sum = 1.0 / 6_227_020_800.0;
    for factorial in
        [479_001_600.0, 39_916_800.0, 3_628_800.0, 362_880.0, 40_320.0, 5_040.0, 720.0, 120.0, 24.0, 6.0, 2.0]
    {
        sum = sum * r + 1.0 / factorial;
    }
    let power = f64::from_bits(bits.wrapping_add(1023) << 52);
    ((sum * r) * r + r + 1.0) * power
}

/// Sine and cosine of `turns` (0..1) full turns, to 2e-16.
///
/// The nearest whole number of quarter turns selects sine or cosine and the sign. The remainder is at most an eighth of a turn.
#[inline(always)]
pub(super) fn sin_cos_turns(turns: f64) -> (f64, f64) {
    let (quarter, bits) = nearest(4.0 * turns);
    let x = (4.0 * turns - quarter) * std::f64::consts::FRAC_PI_2;
    let w = x * x;
    let mut sin = -1.0 / 1_307_674_368_000.0;
    for term in [6_227_020_800.0, -39_916_800.0, 362_880.0, -5_040.0, 120.0, -6.0] {
        sin = sin * w + 1.0 / term;
    }
    sin = sin * w * x + x;
    let mut cos = 1.0 / 20_922_789_888_000.0;
    for term in [-87_178_291_200.0, 479_001_600.0, -3_628_800.0, 40_320.0, -720.0, 24.0, -2.0] {
        cos = cos * w + 1.0 / term;
    }
    cos = cos * w + 1.0;
    let (s, c) = if bits & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let sign = |value: f64, negative: u64| f64::from_bits(value.to_bits() ^ (negative & 2) << 62);
    (sign(s, bits), sign(c, bits.wrapping_add(1)))
}

/// The whole number nearest to `x` (|x| < 2^51), and its low bits as two's complement.
#[inline(always)]
fn nearest(x: f64) -> (f64, u64) {
    const SHIFT: f64 = 1.5 * (1u64 << 52) as f64;
    let shifted = x + SHIFT;
    (shifted - SHIFT, shifted.to_bits().wrapping_sub(SHIFT.to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_agree_with_the_standard_library() {
        let ulp = |x: f64| f64::EPSILON * x.abs();
        for i in 1..200_000u64 {
            let u = unit(i.wrapping_mul(0x9E37_79B9_7F4A_7C15));
            for x in [u, u * 1e-12, 1.0 - u * 1e-9, 1.0 + u, u * 1e30] {
                assert!((ln(x) - x.ln()).abs() <= 2.0 * ulp(x.ln()), "ln {x}");
            }
            for x in [-10.0 * u, 600.0 * (u - 0.5)] {
                assert!((exp(x) - x.exp()).abs() <= 2.0 * ulp(x.exp()), "exp {x}");
            }
            let (sin, cos) = sin_cos_turns(u);
            // The library's argument is rounded once more, by up to 4.5e-16.
            let (s, c) = (std::f64::consts::TAU * u).sin_cos();
            assert!((sin - s).abs() < 8e-16 && (cos - c).abs() < 8e-16, "{u}");
            assert!((sin * sin + cos * cos - 1.0).abs() < 5e-16);
        }
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(ln(1.0), 0.0);
    }

    #[test]
    fn unit_never_reaches_its_ends() {
        assert_eq!(unit(0), f64::EPSILON / 2.0);
        assert_eq!(unit(u64::MAX), 1.0 - f64::EPSILON / 2.0);
        assert!(unit(0) > 0.0 && unit(u64::MAX) < 1.0);
    }
}
