//! Times for people.

/// A time, s, in the two units that fit it: `6.1 s`, `2 min 16 s`, `1 h 02 min`. What is below zero, or no number, is `0.0 s`.
pub fn time_text(seconds: f64) -> String {
    // The sum of no steps is -0.
    let seconds = if seconds > 0.0 { seconds } else { 0.0 };
    let whole = seconds.round() as u64;
    let (hours, minutes) = (whole / 3600, whole / 60 % 60);
    if hours > 0 {
        format!("{hours} h {minutes:02} min")
    } else if minutes > 0 {
        format!("{minutes} min {:02} s", whole % 60)
    } else {
        format!("{seconds:.1} s")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_times_are_seconds_and_none_is_below_zero() {
        for (seconds, text) in [
            (-0.0, "0.0 s"),
            (-3.0, "0.0 s"),
            (6.14, "6.1 s"),
            (59.96, "1 min 00 s"),
            (8.0 * 17.0, "2 min 16 s"),
            (3725.0, "1 h 02 min"),
            (90.0 * 3600.0, "90 h 00 min"),
        ] {
            assert_eq!(time_text(seconds), text);
        }
    }
}
