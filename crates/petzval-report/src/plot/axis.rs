//! Axes: a range of values with round ticks.

use crate::number;

/// An axis over fewer decades than this has ticks between powers of ten.
const FEW_DECADES: f64 = 2.5;

/// Ticks at powers of ten on one axis, at most.
const MOST_DECADES: usize = 10;

/// An axis, linear or logarithmic.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Axis {
    /// Value at its beginning, left or below.
    pub low: f64,
    /// Value at its end.
    pub high: f64,
    /// Values with a tick and a number.
    pub ticks: Vec<f64>,
    /// Decimals that distinguish neighbouring ticks.
    decimals: usize,
    /// Whether equal ratios, rather than equal differences, are equally long.
    is_logarithmic: bool,
    /// Words at the ticks in place of numbers; empty where numbers stand.
    names: Vec<String>,
}

impl Axis {
    /// A linear axis exactly from one value to another, with about a number of ticks at multiples of 1, 2 or 5. If the
    /// values are equal, it extends by 1 to both sides.
    pub fn between(low: f64, high: f64, count: usize) -> Self {
        let (low, high) = match (low.is_finite() && high.is_finite(), high > low) {
            (true, true) => (low, high),
            (true, false) => (low - 1.0, low + 1.0),
            _ => (0.0, 1.0),
        };
        let ticks = number::ticks(low, high, count);
        let step = ticks.get(1).zip(ticks.first()).map_or(high - low, |(b, a)| b - a);
        let decimals = (-(step.log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize;
        Self { low, high, ticks, decimals, is_logarithmic: false, names: Vec::new() }
    }

    /// A logarithmic axis from the power of ten at or below one value to that at or above another, both positive; at
    /// least one decade. Every decade has a tick, or every second, third, ... where there are more than about nine.
    pub fn decades(low: f64, high: f64) -> Self {
        let power = |v: f64| if v > 0.0 && v.is_finite() { v.log10().clamp(-30.0, 30.0) } else { 0.0 };
        let first = (power(low) + 1e-9).floor() as i32;
        let last = ((power(high) - 1e-9).ceil() as i32).max(first + 1);
        let step = (last - first).div_euclid(9) + 1;
        let ticks = (first..=last).step_by(step as usize).map(|p| 10_f64.powi(p)).collect();
        let [low, high] = [first, last].map(|power| 10_f64.powi(power));
        Self { low, high, ticks, decimals: 0, is_logarithmic: true, names: Vec::new() }
    }

    /// A logarithmic axis exactly from one value to another, both positive, with a tick at every power of ten, and at
    /// its 2 and 5 where there are few powers.
    pub fn ratios(low: f64, high: f64) -> Self {
        if !(low > 0.0 && high > low && high.is_finite()) {
            return Self::decades(low, high);
        }
        let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
        let digits: &[f64] = if (high / low).log10() < FEW_DECADES { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let each = powers.clone().count().div_ceil(MOST_DECADES);
        let ticks = powers.step_by(each).flat_map(|p| digits.iter().map(move |d| d * 10_f64.powi(p)));
        let ticks = ticks.filter(|t| (low..=high).contains(t)).collect();
        Self { low, high, ticks, decimals: 0, is_logarithmic: true, names: Vec::new() }
    }

    /// A linear axis from the tick at or below one value to that at or above another.
    pub fn around(low: f64, high: f64, count: usize) -> Self {
        let mut axis = Self::between(low, high, count);
        // The wider range may have ticks further apart: widen it once more.
        for _ in 0..3 {
            let step = number::round_length((axis.high - axis.low) / count.max(1) as f64);
            let down = (axis.low / step + 1e-9).floor() * step;
            let up = (axis.high / step - 1e-9).ceil() * step;
            axis = Self::between(down, up, count);
        }
        axis
    }

    /// A linear axis from `-reach` to `reach`, widened to a round number.
    pub fn about_zero(reach: f64) -> Self {
        let reach = round_up(reach);
        let mut axis = Self::between(-reach, reach, 4);
        axis.ticks = vec![-reach, 0.0, reach];
        let text = format!("{reach:.9}");
        axis.decimals = text.trim_end_matches('0').split('.').nth(1).map_or(0, str::len);
        axis
    }

    /// An axis of words: word `i` stands at the value `i`.
    pub fn of_names(names: &[String]) -> Self {
        let count = names.len().max(1) as f64;
        let ticks = (0..names.len()).map(|i| i as f64).collect();
        Self {
            low: -0.5,
            high: count - 0.5,
            ticks,
            decimals: 0,
            is_logarithmic: false,
            names: names.to_vec(),
        }
    }

    /// Whether equal ratios are equally long.
    pub fn is_logarithmic(&self) -> bool {
        self.is_logarithmic
    }

    /// Position of a value on the axis, 0..1 between its ends.
    pub fn share(&self, value: f64) -> f64 {
        if self.is_logarithmic {
            // Values that are not positive lie below every logarithmic axis.
            let value = value.max(self.low * 1e-9);
            return (value / self.low).ln() / (self.high / self.low).ln();
        }
        (value - self.low) / (self.high - self.low)
    }

    /// The number or the word at a tick.
    pub fn label(&self, value: f64) -> String {
        if !self.names.is_empty() {
            return self.names.get(value as usize).cloned().unwrap_or_default();
        }
        let power = |v: f64| (v.abs().log10() + 1e-9).floor() as i32;
        if self.is_logarithmic {
            return match power(value) {
                power @ -3..=4 => number::fixed(value, (-power).max(0) as usize),
                power if number::is_nothing(value / 10_f64.powi(power) - 1.0, 6) => {
                    format!("10{}", number::superscript(power))
                }
                power => number::power_of_ten(value, power),
            };
        }
        let size = self.low.abs().max(self.high.abs());
        if (1e-4..1e6).contains(&size) {
            number::fixed(value, self.decimals)
        } else if value.abs() < 1e-9 * size {
            "0".into()
        } else {
            number::power_of_ten(value, power(value))
        }
    }

    /// Characters of the widest number.
    pub fn widest_label(&self) -> usize {
        self.ticks.iter().map(|t| self.label(*t).chars().count()).max().unwrap_or(1)
    }
}

/// The next of 1, 1.5, 2, 3, 5, 8 times a power of ten that is not less; 1 if there is none.
pub(crate) fn round_up(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return 1.0;
    }
    let decade = 10_f64.powf(value.log10().floor());
    let digit = [1.0, 1.5, 2.0, 3.0, 5.0, 8.0].into_iter().find(|d| d * decade >= value * (1.0 - 1e-9));
    digit.unwrap_or(10.0) * decade
}

/// The least and the greatest of the finite numbers.
pub(crate) fn span(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().filter(|v| v.is_finite()).fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((low, high)) => Some((f64::min(low, v), f64::max(high, v))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks.iter().map(|t| axis.label(*t)).collect()
    }

    #[test]
    fn ticks_are_round_and_labels_no_longer_than_needed() {
        assert_eq!(labels(&Axis::between(0.0, 1.0, 5)), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(&Axis::between(0.0, 85.32, 4)), ["0", "20", "40", "60", "80"]);
        assert_eq!(labels(&Axis::about_zero(13.0)), ["\u{2212}15", "0", "15"]);
        assert_eq!(labels(&Axis::about_zero(0.12)), ["\u{2212}0.15", "0.00", "0.15"]);
    }

    #[test]
    fn an_axis_around_values_ends_at_ticks() {
        let axis = Axis::around(-0.37, 1.42, 4);
        assert_eq!((axis.low, axis.high), (-0.5, 1.5));
        assert_eq!(axis.share(0.5), 0.5);
        // Between -7 and 1 ticks are 2 apart.
        let wide = Axis::around(-6.9, 0.15, 5);
        assert_eq!((wide.low, wide.high, wide.ticks.len()), (-8.0, 2.0, 6));
        let fits = Axis::around(0.0, 10.0, 5);
        assert_eq!((fits.low, fits.high), (0.0, 10.0));
    }

    #[test]
    fn decades_are_equally_long() {
        let axis = Axis::decades(0.02, 50_000.0);
        assert_eq!((axis.low, axis.high, axis.ticks.len()), (0.01, 100_000.0, 8));
        assert!((axis.share(1.0) - 2.0 / 7.0).abs() < 1e-12 && axis.share(0.0) < 0.0);
        assert_eq!(labels(&axis)[..3], ["0.01", "0.1", "1"]);
        assert_eq!(labels(&axis)[7], "10⁵");
        let wide = Axis::decades(1.0, 1e20);
        assert!(wide.ticks.len() <= 10 && Axis::decades(0.0, 0.0).high > 1.0, "{wide:?}");
    }

    #[test]
    fn few_decades_have_ticks_between_their_powers() {
        let axis = Axis::ratios(0.08, 12.0);
        assert_eq!((axis.low, axis.high), (0.08, 12.0));
        assert_eq!(labels(&axis), ["0.1", "0.2", "0.5", "1", "2", "5", "10"]);
        assert_eq!(labels(&Axis::ratios(1e-6, 1e-2)).len(), 5);
        assert_eq!(labels(&Axis::ratios(1.5e-5, 6e-5)), ["2·10⁻⁵", "5·10⁻⁵"]);
        assert!(Axis::ratios(1.0, 1e25).ticks.len() <= 10 && Axis::ratios(0.0, 1.0).high >= 1.0);
    }

    #[test]
    fn words_stand_at_equal_distances() {
        let axis = Axis::of_names(&["precision".to_owned(), "high".to_owned()]);
        assert_eq!(labels(&axis), ["precision", "high"]);
        assert_eq!([axis.share(0.0), axis.share(1.0)], [0.25, 0.75]);
    }

    #[test]
    fn small_and_large_numbers_have_powers_of_ten() {
        let small = Axis::between(0.0, 2.2e-5, 5);
        assert_eq!(labels(&small), ["0", "5·10⁻⁶", "1·10⁻⁵", "1.5·10⁻⁵", "2·10⁻⁵"]);
        assert_eq!(labels(&Axis::between(0.0, 3e7, 3))[1], "1·10⁷");
        assert_eq!(labels(&Axis::between(0.0, 4e5, 2)), ["0", "200000", "400000"]);
    }

    #[test]
    fn an_empty_range_or_one_of_nan_still_gives_an_axis() {
        for (low, high) in [(3.0, 3.0), (f64::NAN, 1.0), (0.0, f64::INFINITY), (5.0, 1.0)] {
            let axis = Axis::around(low, high, 4);
            assert!(axis.high > axis.low && !axis.ticks.is_empty(), "{axis:?}");
        }
        assert_eq!(Axis::about_zero(0.0).high, 1.0);
    }

    #[test]
    fn a_span_leaves_out_what_is_no_number() {
        assert_eq!(span([f64::NAN, 3.0, f64::INFINITY, -1.0]), Some((-1.0, 3.0)));
        assert_eq!(span([f64::NAN]), None);
    }
}
