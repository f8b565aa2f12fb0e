//! Tables of ascending places, between which values are interpolated.

/// Where a value lies in an ascending table: between the entries `lower` and `lower + 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Number of the lower entry.
    pub lower: usize,
    /// Share of the way from the lower entry to the upper one: `(x - x_lower) / (x_upper - x_lower)`. It is below 0 in front of the table
    /// and above 1 behind it.
    pub share: f64,
}

impl Interval {
    /// The interval around `x` among `count` ascending places. An entry belongs to the interval above it, the last entry to the last
    /// interval. None for fewer than two places.
    #[inline]
    pub fn around(x: f64, count: usize, place: impl Fn(usize) -> f64) -> Option<Self> {
        let last_interval = count.checked_sub(2)?;
        // Halve the entries that may be the first one above x.
        let (mut low, mut high) = (0, count);
        while low < high {
            let middle = low + (high - low) / 2;
            if place(middle) <= x { low = middle + 1 } else { high = middle }
        }
        let lower = low.saturating_sub(1).min(last_interval);
        let (from, to) = (place(lower), place(lower + 1));
        Some(Self { lower, share: (x - from) / (to - from) })
    }

    /// [`in_slice`](Self::in_slice), found from the lower entry of a value nearby: for runs of values that change little.
    #[inline]
    pub fn near(x: f64, places: &[f64], lower: usize) -> Option<Self> {
        let last_interval = places.len().checked_sub(2)?;
        let mut lower = lower.min(last_interval);
        while lower < last_interval && places[lower + 1] <= x {
            lower += 1;
        }
        while lower > 0 && places[lower] > x {
            lower -= 1;
        }
        let (from, to) = (places[lower], places[lower + 1]);
        Some(Self { lower, share: (x - from) / (to - from) })
    }

    /// [`around`](Self::around) in a slice.
    #[inline]
    pub fn in_slice(x: f64, places: &[f64]) -> Option<Self> {
        Self::around(x, places.len(), |i| places[i])
    }

    /// The value on the line through both entries, `y_lower + share (y_upper - y_lower)`: outside the table it goes on with the last slope.
    #[inline]
    pub fn on_line(self, value: impl Fn(usize) -> f64) -> f64 {
        let (from, to) = (value(self.lower), value(self.lower + 1));
        from + self.share * (to - from)
    }

    /// The mean of both entries by their weights, `y_lower (1 - share) + y_upper share`: [`on_line`](Self::on_line) with another rounding.
    /// Every entry is exact, even beside an infinite one.
    #[inline]
    pub fn mean(self, value: impl Fn(usize) -> f64) -> f64 {
        if self.share == 0.0 {
            return value(self.lower);
        }
        if self.share == 1.0 {
            return value(self.lower + 1);
        }
        value(self.lower) * (1.0 - self.share) + value(self.lower + 1) * self.share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const X: [f64; 4] = [1.0, 2.0, 4.0, 4.5];
    const Y: [f64; 4] = [10.0, -2.0, 0.3, 0.7];

    fn at(x: f64) -> Interval {
        Interval::in_slice(x, &X).unwrap()
    }

    #[test]
    fn an_interval_is_the_same_from_wherever_it_is_looked_for() {
        for x in [f64::NEG_INFINITY, 0.5, 1.0, 1.5, 2.0, 3.9, 4.0, 4.2, 4.5, 9.0] {
            for start in 0..=X.len() {
                assert_eq!(Interval::near(x, &X, start), Interval::in_slice(x, &X), "{x} from {start}");
            }
            assert_eq!(Interval::near(x, &X[..1], 0), None);
        }
    }

    #[test]
    fn an_entry_begins_its_interval_and_the_last_one_ends_the_table() {
        for (x, lower, share) in [
            (0.5, 0, -0.5),
            (1.0, 0, 0.0),
            (1.5, 0, 0.5),
            (2.0, 1, 0.0),
            (3.5, 1, 0.75),
            (4.5, 2, 1.0),
            (5.0, 2, 2.0),
        ] {
            assert_eq!(at(x), Interval { lower, share }, "{x}");
        }
        assert!(at(f64::NAN).share.is_nan());
        assert_eq!(Interval::in_slice(1.0, &[1.0]), None);
        assert_eq!(Interval::in_slice(1.0, &[]), None);
    }

    #[test]
    fn values_lie_on_lines_and_entries_are_exact() {
        assert_eq!(at(1.25).on_line(|i| Y[i]), 7.0);
        assert_eq!(at(1.25).mean(|i| Y[i]), 7.0);
        assert_eq!(at(0.5).on_line(|i| Y[i]), 16.0, "the first slope goes on");
        for (x, y) in X.iter().zip(Y) {
            assert_eq!(at(*x).mean(|i| Y[i]), y);
        }
        let beside_infinity = [1.0, f64::INFINITY, 2.0, 3.0];
        assert_eq!([1.0, 4.0].map(|x| at(x).mean(|i| beside_infinity[i])), [1.0, 2.0]);
    }

    #[test]
    fn halving_finds_what_counting_finds() {
        let places: Vec<f64> = (0..37).map(|i| f64::from(i * i)).collect();
        for step in -20..14_000 {
            let x = 0.1 * f64::from(step);
            let counted = places.iter().filter(|p| **p <= x).count().clamp(1, places.len() - 1) - 1;
            assert_eq!(Interval::in_slice(x, &places).unwrap().lower, counted, "{x}");
        }
    }
}
