//! A figure of a table: what was measured, and how it is written. A figure ends where its error begins.

use serde::{Deserialize, Serialize};

use super::data::Column;

/// A cell of a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(super) enum Figure {
    Text(String),
    /// Without a known error.
    Number(f64),
    /// One value a seed, in the order of the seeds of the table.
    Seeds {
        seeds: Vec<f64>,
    },
    /// Mean and standard deviation over the seeds.
    Spread {
        mean: f64,
        deviation: f64,
    },
    /// A value with its 95 % interval.
    Interval {
        value: f64,
        low: f64,
        high: f64,
    },
    /// The lowest and the highest of several values.
    Range {
        low: f64,
        high: f64,
    },
}

/// A standard deviation is a quarter of a 95 % interval.
const DEVIATIONS_OF_INTERVAL: f64 = 4.0;

impl Figure {
    /// The figure as its column writes it.
    pub(super) fn text(&self, column: &Column) -> String {
        self.parts(column).concat()
    }

    /// The ways to write the figure in a sentence, the longest first: with and without its error, its sign and its unit. A sentence may say
    /// the sign in words.
    pub(super) fn forms(&self, column: &Column) -> Vec<String> {
        let [value, error] = self.parts(column);
        let bare = value.trim_start_matches(['+', '-']);
        let mut forms = Vec::new();
        let with_unit = (!column.unit.is_empty()).then(|| format!(" {}", column.unit));
        for unit in with_unit.into_iter().chain([String::new()]) {
            for error in [&error, ""] {
                forms.extend([value.as_str(), bare].map(|value| format!("{value}{error}{unit}")));
            }
        }
        forms
    }

    /// The value, and what stands behind it: its error, or its interval.
    fn parts(&self, column: &Column) -> [String; 2] {
        let fixed = |value: f64, decimals: usize| fixed(value, decimals, column.signed);
        match self {
            Self::Text(text) => [text.clone(), String::new()],
            Self::Number(value) => [fixed(*value, column.decimals), String::new()],
            Self::Seeds { seeds } => match mean_and_deviation(seeds) {
                (mean, Some(deviation)) => Self::Spread { mean, deviation }.parts(column),
                (value, None) => Self::Number(value).parts(column),
            },
            Self::Spread { mean, deviation } => match decimals_of(*deviation, column.decimals) {
                Some(known) => [fixed(*mean, known), format!(" +- {deviation:.known$}")],
                None => [fixed(*mean, column.decimals), String::new()],
            },
            Self::Interval { value, low, high } => {
                let known = decimals_of((high - low) / DEVIATIONS_OF_INTERVAL, column.decimals);
                let known = known.unwrap_or(column.decimals);
                let end = |value: &f64| self::fixed(*value, known, false);
                [fixed(*value, known), format!(", {} to {}", end(low), end(high))]
            }
            Self::Range { low, high } => {
                let end = |value: &f64| self::fixed(*value, column.decimals, false);
                [format!("{} to {}", end(low), end(high)), String::new()]
            }
        }
    }

    /// The values of a figure that has one a seed.
    pub(super) fn seeds(&self) -> Option<&[f64]> {
        match self {
            Self::Seeds { seeds } => Some(seeds),
            _ => None,
        }
    }

    /// The value that a sentence rounds: a number, a mean, or the number with which a text begins. `None` of a range.
    pub(super) fn value(&self) -> Option<f64> {
        match self {
            Self::Text(text) => text.split_whitespace().next()?.parse().ok(),
            Self::Number(value) | Self::Interval { value, .. } | Self::Spread { mean: value, .. } => {
                Some(*value)
            }
            Self::Seeds { seeds } => Some(mean_and_deviation(seeds).0),
            Self::Range { .. } => None,
        }
    }

    /// Mean and standard deviation over the seeds, of figures that have both.
    pub(super) fn spread(&self) -> Option<(f64, f64)> {
        match self {
            Self::Spread { mean, deviation } => Some((*mean, *deviation)),
            Self::Seeds { seeds } => {
                let (mean, deviation) = mean_and_deviation(seeds);
                Some((mean, deviation?))
            }
            _ => None,
        }
    }
}

/// Mean and sample standard deviation; no deviation of a single value.
fn mean_and_deviation(values: &[f64]) -> (f64, Option<f64>) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    if values.len() < 2 {
        return (mean, None);
    }
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, Some((squares / (values.len() - 1) as f64).sqrt()))
}

/// A value to a number of decimals. What rounds to zero has no sign.
fn fixed(value: f64, decimals: usize, signed: bool) -> String {
    let digits = format!("{:.decimals$}", value.abs());
    let is_zero = digits.bytes().all(|byte| matches!(byte, b'0' | b'.'));
    let sign = match (is_zero, value < 0.0, signed) {
        (false, true, _) => "-",
        (false, false, true) => "+",
        _ => "",
    };
    format!("{sign}{digits}")
}

/// Decimals at which a value with an error ends, at most `most`: those of the first digit of the error, or of its second where the first is 1.
///
/// `None` for an error that rounds to zero at `most` decimals. An error above 20 gives 0.
fn decimals_of(error: f64, most: usize) -> Option<usize> {
    if !error.is_finite() || (error * 10_f64.powi(most as i32)).round() < 1.0 {
        return None;
    }
    let digits = format!("{error:.1e}");
    let (first, exponent) = digits.split_once('e')?;
    let exponent: i32 = exponent.parse().ok()?;
    let known = if first.starts_with('1') { 1 - exponent } else { -exponent };
    Some((known.max(0) as usize).min(most))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(decimals: usize, unit: &str, signed: bool) -> Column {
        Column { name: "score".into(), unit: unit.into(), decimals, signed, ..Column::default() }
    }

    #[test]
    fn a_figure_ends_where_its_error_begins() {
        let spread = |mean, deviation| Figure::Spread { mean, deviation };
        let interval = |value, low, high| Figure::Interval { value, low, high };
        for (figure, expected) in [
            (spread(0.9555, 0.0018), "0.9555 +- 0.0018"),
            (spread(0.9562, 0.0007), "0.9562 +- 0.0007"),
            (spread(0.4383, 0.0282), "0.44 +- 0.03"),
            (spread(28.73, 0.0099), "28.730 +- 0.010"),
            (spread(0.996, 0.0), "0.9960"),
            (spread(-0.0004, 0.03), "0.00 +- 0.03"),
            (spread(113.2, 51.0), "113 +- 51"),
            (Figure::Seeds { seeds: vec![1.0, 2.0, 4.5] }, "2.5 +- 1.8"),
            (Figure::Seeds { seeds: vec![1.0] }, "1.0000"),
            (interval(0.6891, 0.6583, 0.7284), "0.689, 0.658 to 0.728"),
            (interval(0.0691, 0.0083, 0.1452), "0.07, 0.01 to 0.15"),
            (Figure::Range { low: 8.17, high: 8.5 }, "8.1700 to 8.5000"),
            (Figure::Number(1.25937), "1.2594"),
            (Figure::Text("as ever".into()), "as ever"),
        ] {
            assert_eq!(figure.text(&column(4, "", false)), expected);
        }
        // What the data hold no digits of is not written.
        assert_eq!(spread(28.73, 0.0099).text(&column(2, "dB", false)), "28.73 +- 0.01");
    }

    #[test]
    fn differences_have_a_sign() {
        let text = |figure: Figure| figure.text(&column(3, "", true));
        assert_eq!(text(Figure::Spread { mean: 0.86, deviation: 0.06 }), "+0.86 +- 0.06");
        assert_eq!(text(Figure::Spread { mean: -0.0001, deviation: 0.012 }), "0.000 +- 0.012");
        assert_eq!(
            text(Figure::Interval { value: 0.016, low: -0.012, high: 0.043 }),
            "+0.016, -0.012 to 0.043"
        );
    }

    #[test]
    fn a_sentence_may_leave_out_error_sign_and_unit() {
        let forms = Figure::Spread { mean: 0.861, deviation: 0.06 }.forms(&column(3, "dB", true));
        for form in ["+0.86 +- 0.06 dB", "0.86 +- 0.06 dB", "0.86 dB", "0.86 +- 0.06", "0.86"] {
            assert!(forms.iter().any(|known| known == form), "{form}: {forms:?}");
        }
        assert_eq!(forms[0], "+0.86 +- 0.06 dB");
        let forms = Figure::Number(-1.8).forms(&column(1, "dB", true));
        assert_eq!(forms[..2], ["-1.8 dB", "1.8 dB"]);
        assert_eq!(Figure::Number(17.0).forms(&column(0, "", false))[0], "17");
    }
}
