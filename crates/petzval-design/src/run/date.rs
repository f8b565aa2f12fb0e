//! The time of day as text.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// The last second of the year 9999, in seconds since 1970.
const LAST_S: u64 = 253_402_300_799;

/// A time of day to the second, by RFC 3339.
///
/// The form has years from 1970 to 9999. A clock that stands before or behind them gives the nearest second that it has: dates are for readers,
/// and no result depends on them.
pub fn date(time: SystemTime) -> String {
    date_since_1970(time.duration_since(UNIX_EPOCH).unwrap_or_default())
}

/// As [`date`], by the time since the beginning of 1970.
pub(super) fn date_since_1970(since: Duration) -> String {
    let time = UNIX_EPOCH + since.min(Duration::from_secs(LAST_S));
    humantime::format_rfc3339_seconds(time).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_outside_the_years_of_the_form_have_a_date_too() {
        let after = |s: u64| date(UNIX_EPOCH + Duration::from_secs(s));
        assert_eq!(after(951_782_399), "2000-02-28T23:59:59Z");
        assert_eq!(after(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(date(UNIX_EPOCH - Duration::from_millis(1)), "1970-01-01T00:00:00Z");
        assert_eq!(date(UNIX_EPOCH - Duration::from_secs(365 * 86_400)), "1970-01-01T00:00:00Z");
        assert_eq!(after(LAST_S), "9999-12-31T23:59:59Z");
        assert_eq!(after(LAST_S + 1), "9999-12-31T23:59:59Z");
        assert_eq!(date_since_1970(Duration::from_secs(u64::MAX)), "9999-12-31T23:59:59Z");
    }
}
