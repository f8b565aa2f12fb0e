//! Numbers as text for a reader: with true minus signs, without negative zero, and with a dash for unknown values.

/// Text of an unknown value.
const UNKNOWN: &str = "–";

/// A value with a number of decimals; a dash if it is not finite.
///
/// A typographic minus sign keeps columns aligned. A value that rounds to zero has no sign.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return UNKNOWN.into();
    }
    let digits = format!("{:.decimals$}", value.abs());
    let is_zero = digits.bytes().all(|b| matches!(b, b'0' | b'.'));
    if value < 0.0 && !is_zero { format!("\u{2212}{digits}") } else { digits }
}

/// A value with at most a number of decimals.
pub(crate) fn short(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// A value with its unit, which may be empty.
pub(crate) fn with_unit(value: f64, decimals: usize, unit: &str) -> String {
    let value = fixed(value, decimals);
    if unit.is_empty() { value } else { format!("{value}\u{a0}{unit}") }
}

/// A difference with its sign, `±0` if it rounds to nothing.
pub(crate) fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    if !value.is_finite() || text.starts_with('\u{2212}') {
        text
    } else if is_nothing(value, decimals) {
        format!("±{text}")
    } else {
        format!("+{text}")
    }
}

/// Whether a value rounds to zero at a number of decimals.
pub(crate) fn is_nothing(value: f64, decimals: usize) -> bool {
    (value * 10_f64.powi(decimals as i32)).round() == 0.0
}

/// Decimals at which a value with a standard error ends: those of the first digit of the error, or of its second where the first is 1.
///
/// Negative for an error above 20: the value ends at tens. `None` without an error above 0. An error of 0.23 gives 1, one of 0.12 gives
/// 2, so that rounding changes the error by less than a quarter of it.
pub(crate) fn decimals_of(error: f64) -> Option<i32> {
    if !(error > 0.0 && error.is_finite()) {
        return None;
    }
    // Rounded to two digits first: 0.0996 is 0.10, not 0.1.
    let digits = format!("{error:.1e}");
    let (first, exponent) = (digits.as_bytes()[0], digits.split_once('e')?.1.parse::<i32>().ok()?);
    Some(if first == b'1' { 1 - exponent } else { -exponent })
}

/// A value that ends where its standard error begins, with the error: `1.3 ± 0.2`. Without an error, or with one that rounds to nothing at
/// the most `decimals`, the value alone.
pub fn with_error(value: f64, error: f64, decimals: usize) -> String {
    joined(value, error, decimals, fixed)
}

/// The same with the sign of the value: `+1.3 ± 0.2`.
pub fn signed_with_error(value: f64, error: f64, decimals: usize) -> String {
    joined(value, error, decimals, signed)
}

fn joined(value: f64, error: f64, decimals: usize, text: fn(f64, usize) -> String) -> String {
    match decimals_of(error).filter(|_| !is_nothing(error, decimals)) {
        Some(known) => {
            let known = known.min(decimals as i32);
            format!("{} ± {}", text(whole(value, known), known.max(0) as usize), rounded(error, known))
        }
        None => text(value, decimals),
    }
}

/// A value to a number of decimals; a negative number of them ends at tens, hundreds, ...
pub(crate) fn rounded(value: f64, decimals: i32) -> String {
    fixed(whole(value, decimals), decimals.max(0) as usize)
}

/// A value whose last places are 0 where it ends before its decimal point.
fn whole(value: f64, decimals: i32) -> f64 {
    if decimals >= 0 {
        return value;
    }
    let unit = 10_f64.powi(-decimals);
    (value / unit).round() * unit
}

/// A number of unknown size with about five significant digits: `11.340`, `−4.0600·10⁻⁵`, `∞`.
pub(crate) fn significant(value: f64) -> String {
    if value.is_infinite() {
        return if value > 0.0 { "∞".into() } else { "\u{2212}∞".into() };
    }
    if value == 0.0 || value.is_nan() {
        return fixed(value, 0);
    }
    let exponent = value.abs().log10().floor() as i32;
    if (-2..5).contains(&exponent) {
        return fixed(value, (4 - exponent).clamp(0, 5) as usize);
    }
    format!("{}·10{}", fixed(value / 10_f64.powi(exponent), 4), superscript(exponent))
}

/// A value over a power of ten, with as few digits as it needs: `1.5·10⁻⁵`.
pub(crate) fn power_of_ten(value: f64, power: i32) -> String {
    format!("{}·10{}", short(value / 10_f64.powi(power), 6), superscript(power))
}

/// A whole number in superscript characters.
pub(crate) fn superscript(value: i32) -> String {
    value
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            digit => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][digit as usize - '0' as usize],
        })
        .collect()
}

/// A unit in plain characters, as a reader expects it: `mm^-3` as `mm⁻³`, `um` as `µm`, `deg` as `°`.
pub(crate) fn unit(plain: &str) -> String {
    match plain {
        "um" => return "µm".into(),
        "deg" => return "°".into(),
        _ => {}
    }
    match plain.split_once('^').map(|(base, power)| (base, power.parse::<i32>())) {
        Some((base, Ok(power))) => format!("{base}{}", superscript(power)),
        _ => plain.into(),
    }
}

/// Tick positions for an axis from `low` to `high`: about `count` multiples of 1, 2 or 5 times a power
/// of ten.
pub(crate) fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let rough = (high - low) / count.max(1) as f64;
    if !(rough > 0.0 && rough.is_finite()) {
        return Vec::new();
    }
    let step = round_length(rough);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

/// The length nearest to `rough` (in ratio) among 1, 2 and 5 times a power of ten.
pub(crate) fn round_length(rough: f64) -> f64 {
    let decade = 10_f64.powf(rough.log10().floor());
    let share = rough / decade;
    let digit = match share {
        s if s < 1.5 => 1.0,
        s if s < 3.5 => 2.0,
        s if s < 7.5 => 5.0,
        _ => 10.0,
    };
    digit * decade
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_zeros_are_typographic() {
        assert_eq!(fixed(-1.25, 1), "\u{2212}1.2");
        assert_eq!(fixed(-0.0004, 3), "0.000");
        assert_eq!(fixed(f64::NAN, 3), "–");
        assert_eq!(signed(0.0125, 3), "+0.013");
        assert_eq!(signed(-0.0125, 2), "\u{2212}0.01");
        assert_eq!(signed(-0.0001, 3), "±0.000");
    }

    #[test]
    fn a_value_ends_where_its_error_begins() {
        for (value, error, wanted) in [
            (1.2963, 0.2312, "1.3 ± 0.2"),
            (1.2963, 0.1212, "1.30 ± 0.12"),
            (1.2963, 0.0996, "1.30 ± 0.10"),
            (1.2963, 0.0312, "1.30 ± 0.03"),
            (31.2, 4.4, "31 ± 4"),
            (1234.5, 36.0, "1230 ± 40"),
            (1234.6, 12.3, "1235 ± 12"),
            (107.7, 135.0, "110 ± 140"),
            (-0.0004, 0.03, "0.00 ± 0.03"),
            (0.5, 0.0, "0.500"),
            (0.5, 1e-17, "0.500"),
            (0.5, 0.00071, "0.500 ± 0.001"),
            (0.5, f64::NAN, "0.500"),
        ] {
            assert_eq!(with_error(value, error, 3), wanted);
        }
        assert_eq!(signed_with_error(1.2963, 0.23, 3), "+1.3 ± 0.2");
        assert_eq!(signed_with_error(-0.0129, 0.0031, 4), "\u{2212}0.013 ± 0.003");
        assert_eq!(signed_with_error(-0.04, 0.5, 3), "±0.0 ± 0.5");
        assert_eq!(decimals_of(f64::INFINITY), None);
    }

    #[test]
    fn significant_digits_follow_the_size() {
        assert_eq!(significant(11.34), "11.340");
        assert_eq!(significant(-4.06e-5), "\u{2212}4.0600·10⁻⁵");
        assert_eq!(significant(0.848), "0.84800");
        assert_eq!(significant(f64::INFINITY), "∞");
        assert_eq!(significant(0.0), "0");
    }

    #[test]
    fn powers_of_units_are_raised() {
        assert_eq!(
            ["mm^-3", "mm^-11", "um", "deg", "mm", "", "a^b"].map(unit),
            ["mm⁻³", "mm⁻¹¹", "µm", "°", "mm", "", "a^b"]
        );
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 15.3, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0]);
        assert_eq!(ticks(0.0, 100.0, 5), [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]);
        assert!(ticks(1.0, 1.0, 5).is_empty());
        assert_eq!(round_length(8.1), 10.0);
        assert_eq!(round_length(13.0), 10.0);
    }
}
