//! Numbers in the tables that verbs print.

/// A figure with a number of decimals; a dash if it does not exist, such as the Abbe number of air.
pub fn figure(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
}

/// A number with six significant digits, without zeros at the end.
pub fn six_digits(value: f64) -> String {
    // Round by formatting and parsing: the shortest form of the result has no more digits.
    let rounded = format!("{value:.5e}").parse::<f64>().unwrap_or(value);
    let is_plain = rounded == 0.0 || !rounded.is_finite() || (1e-6..1e15).contains(&rounded.abs());
    if is_plain { rounded.to_string() } else { format!("{rounded:e}") }
}

#[cfg(test)]
mod tests {
    use super::six_digits;

    #[test]
    fn numbers_have_six_digits_at_most() {
        let all = [0.1399653591279929, 33723.0, 10_471.285_48, 0.0, -1.15, 4.0, 1_234_567.0].map(six_digits);
        assert_eq!(all, ["0.139965", "33723", "10471.3", "0", "-1.15", "4", "1234570"]);
        assert_eq!([1e-300, -1.23456789e18].map(six_digits), ["1e-300", "-1.23457e18"]);
    }
}
