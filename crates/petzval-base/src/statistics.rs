//! Small statistics that several crates need.

/// Standard deviation of normal numbers over the median of their distances from the mean.
pub const SIGMA_OVER_MEDIAN: f64 = 1.4826;

/// Median of the values: for an even number of values the mean of the middle two, for none 0.
///
/// Time is linear in the number of values. NaNs are ordered as by [`f64::total_cmp`].
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    if values.is_empty() {
        return 0.0;
    }
    let upper = values.len() / 2;
    let is_even = values.len().is_multiple_of(2);
    let (below, middle, _) = values.select_nth_unstable_by(upper, f64::total_cmp);
    let middle = *middle;
    match below.iter().copied().max_by(f64::total_cmp) {
        Some(lower) if is_even => 0.5 * (lower + middle),
        _ => middle,
    }
}

/// The greater of two numbers; NaN if either is none, where [`f64::max`] gives the other.
pub fn maximum(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// The lesser of two numbers; NaN if either is none, where [`f64::min`] gives the other.
pub fn minimum(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.min(b) }
}

#[cfg(test)]
mod tests {
    use super::{maximum, median, minimum};

    #[test]
    fn what_is_no_number_is_the_least_and_the_greatest() {
        assert_eq!([maximum(1.0, 2.0), minimum(1.0, 2.0)], [2.0, 1.0]);
        for values in [[1.0, f64::NAN, 3.0], [f64::NAN, 1.0, 2.0], [1.0, 2.0, f64::NAN]] {
            assert!(values.into_iter().fold(0.0, maximum).is_nan());
            assert!(values.into_iter().fold(0.0, minimum).is_nan());
        }
    }

    #[test]
    fn median_of_odd_even_single_and_empty() {
        assert_eq!(median([3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median([4.0, 1.0, 3.0, 2.0]), 2.5);
        assert_eq!(median([7.0]), 7.0);
        assert_eq!(median([]), 0.0);
    }
}
