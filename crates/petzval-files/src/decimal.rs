//! Exact multiplication by powers of ten: converting nanometres to micrometres moves the decimal point of the printed number,
//! so that no digit is lost to rounding.

use super::toml_number::number;

/// The number that a text prints, times ten to a power; `None` if the text is not a finite number.
pub(super) fn shifted(text: &str, power: i32) -> Option<f64> {
    let plain: f64 = text.parse().ok().filter(|v: &f64| v.is_finite())?;
    let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let Some(exponent) = exponent.parse::<i32>().ok().and_then(|e| e.checked_add(power)) else {
        return Some(plain * 10f64.powi(power));
    };
    format!("{mantissa}e{exponent}").parse().ok().filter(|v: &f64| v.is_finite())
}

/// The decimal text of `value` times ten to a power. [`shifted`] by minus that power gives back the same bits.
pub(super) fn shifted_text(value: f64, power: i32) -> String {
    let printed = format!("{value:e}");
    let (mantissa, exponent) = printed.split_once('e').unwrap_or((&printed, "0"));
    let exact = format!("{mantissa}e{}", exponent.parse::<i32>().unwrap_or(0) + power);
    // Write it without an exponent if that loses no bit.
    let plain = exact.parse().map(number).unwrap_or_default();
    match shifted(&plain, -power) {
        Some(back) if back.to_bits() == value.to_bits() => plain,
        _ => exact,
    }
}

/// A number for messages. Very large and very small numbers have an exponent.
pub(super) fn shown(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-4..1e7).contains(&value.abs());
    if plain { format!("{value}") } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifting_the_decimal_point_loses_no_digit() {
        assert_eq!(shifted("587.6", -3), Some(0.5876));
        assert_eq!([0.0, -2.5, 1e300, 1e-9].map(shown), ["0", "-2.5", "1e300", "1e-9"]);
        assert_eq!(shifted("-5.5e+2", -3), Some(-0.55));
        assert_eq!(shifted("nan", -3), None);
        assert_eq!(shifted("1e400", -3), None);
        assert_eq!(shifted_text(0.5876, 3), "587.6");
        let mut state = 1u64;
        for _ in 0..10_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let value = 0.2 + (state >> 11) as f64 / (1u64 << 53) as f64 * 20.0;
            let back = shifted(&shifted_text(value, 3), -3).unwrap();
            assert_eq!(back.to_bits(), value.to_bits(), "{value:?}");
        }
    }
}
