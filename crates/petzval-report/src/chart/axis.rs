//! Axes: linear or logarithmic, with round ticks.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::prelude::Ranged;

use crate::number;

/// How values go to an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scale {
    /// As they are.
    Linear,
    /// By their decimal logarithm.
    Logarithmic,
}

impl Scale {
    /// Where a value lies on the axis.
    pub fn to_axis(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Logarithmic => value.log10(),
        }
    }

    fn value_at(self, place: f64) -> f64 {
        match self {
            Self::Linear => place,
            Self::Logarithmic => 10_f64.powf(place),
        }
    }
}

/// An axis in places, which are values or their logarithms.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
    ticks: Vec<f64>,
    /// Decimals that tell neighbouring ticks of a linear axis apart.
    decimals: Option<usize>,
}

impl Axis {
    /// From the lower to the upper place, with about so many ticks: multiples of 1, 2, 5 or, on a
    /// logarithmic axis, decades, with their 2 and 5 where there are few decades.
    pub fn new(scale: Scale, (low, high): (f64, f64), count: usize) -> Self {
        let ticks = match scale {
            Scale::Linear => number::ticks(low, high, count),
            Scale::Logarithmic => {
                let digits: &[f64] = if high - low < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
                (low.floor() as i32..=high.ceil() as i32)
                    .flat_map(|decade| digits.iter().map(move |d| f64::from(decade) + d.log10()))
                    .filter(|t| (low..=high).contains(t))
                    .collect()
            }
        };
        let step = ticks.get(1).zip(ticks.first()).map(|(b, a)| b - a);
        let decimals = match scale {
            Scale::Linear => step.map(|s| (-(s.log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize),
            Scale::Logarithmic => None,
        };
        Self { scale, low, high, ticks, decimals }
    }

    /// Characters of the widest label.
    pub fn widest_label(&self) -> usize {
        self.ticks.iter().map(|t| self.label(t).chars().count()).max().unwrap_or(1)
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (place - self.low) / (self.high - self.low);
        (f64::from(from) + share * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl Axis {
    /// The value at a place, without needless digits.
    fn label(&self, place: &f64) -> String {
        let value = self.scale.value_at(*place);
        let size = value.abs();
        if size < 1e-12 {
            "0".into()
        } else if let (Some(decimals), true) = (self.decimals, (1e-4..1e7).contains(&size)) {
            number::fixed(value, decimals)
        } else if !(1e-3..1e6).contains(&size) {
            format!("{value:.0e}").replace('-', "\u{2212}")
        } else {
            let digits = format!("{value:.4}");
            digits.trim_end_matches('0').trim_end_matches('.').replace('-', "\u{2212}")
        }
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, place: &f64) -> String {
        self.label(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks.iter().map(|t| axis.label(t)).collect()
    }

    #[test]
    fn ticks_are_round_in_both_scales() {
        let log = Axis::new(Scale::Logarithmic, (-1.1, 1.1), 5);
        assert_eq!(labels(&log), ["0.1", "0.2", "0.5", "1", "2", "5", "10"]);
        assert_eq!(labels(&Axis::new(Scale::Logarithmic, (-6.0, -2.0), 5)).len(), 5);
        assert_eq!(labels(&Axis::new(Scale::Linear, (-0.5, 1.0), 3)), ["\u{2212}0.5", "0", "0.5", "1.0"]);
        assert_eq!(log.widest_label(), 3);
    }

    #[test]
    fn places_map_to_pixels_in_either_direction() {
        let axis = Axis::new(Scale::Linear, (0.0, 10.0), 5);
        assert_eq!(axis.map(&2.5, (100, 500)), 200);
        assert_eq!(axis.map(&2.5, (500, 100)), 400);
    }
}
