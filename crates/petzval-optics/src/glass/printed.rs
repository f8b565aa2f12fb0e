//! A number as a catalogue prints it, with its decimals, for comparison with a formula to the last digit.

use std::fmt;

/// A printed number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// Its value.
    pub value: f64,
    /// Decimals behind the point.
    pub decimals: u8,
}

impl Printed {
    /// The number of a text such as `1.51680` or `6.41700E+01`; `None` if the text is not a number, or is far from any
    /// index, Abbe number or density.
    ///
    /// Scientific notation has columns of fixed width, so its trailing zeros do not count.
    pub fn parse(text: &str) -> Option<Self> {
        const LARGEST: f64 = 1e6;
        const MOST_DECIMALS: usize = 12;
        let value: f64 = text.parse().ok()?;
        if !value.is_finite() || value.abs() > LARGEST {
            return None;
        }
        let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, ""));
        let fraction = mantissa.split_once('.').map_or("", |(_, fraction)| fraction);
        let decimals = match exponent.parse::<i32>() {
            Ok(exponent) => {
                (fraction.trim_end_matches('0').len() as i64 - i64::from(exponent)).max(0) as usize
            }
            Err(_) => fraction.len(),
        };
        let printed = Self { value, decimals: decimals.min(MOST_DECIMALS) as u8 };
        // Round the value to the kept decimals, so that it reads back the same after it is written.
        Some(Self { value: printed.to_string().parse().ok()?, ..printed })
    }

    /// Whether a computed value rounds to this number.
    pub fn agrees(&self, computed: f64) -> bool {
        (computed - self.value).abs() <= self.rounding()
    }

    /// Half a unit of the last decimal, and a little for a tie.
    pub(super) fn rounding(&self) -> f64 {
        const HALF: f64 = 0.5 + 1e-6;
        HALF * 10_f64.powi(-i32::from(self.decimals))
    }
}

impl fmt::Display for Printed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.*}", usize::from(self.decimals), self.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_that_are_printed_count() {
        let bk7 = Printed::parse("1.51680").unwrap();
        assert_eq!((bk7.decimals, bk7.to_string().as_str()), (5, "1.51680"));
        assert!(bk7.agrees(1.516_804_9) && !bk7.agrees(1.516_805_2) && !bk7.agrees(f64::NAN));
        assert_eq!(Printed::parse("6.78300E+01").unwrap().to_string(), "67.83");
        assert_eq!(Printed::parse("65").unwrap().decimals, 0);
        for bad in ["", "1.5x", "inf", "1e300", "NaN", "--"] {
            assert_eq!(Printed::parse(bad), None, "{bad}");
        }
    }
}
