//! UTC instants as RFC 3339 text, to the second. The clock is the caller's.

use chrono::{DateTime, NaiveDate, NaiveDateTime};

/// `2026-03-01T12:00:00Z` of seconds since 1970-01-01T00:00:00Z.
///
/// ```
/// use muprime_calibration::certificate::date::{format, parse};
/// assert_eq!(format(951_782_400), "2000-02-29T00:00:00Z");
/// assert_eq!(parse("2000-02-29T00:00:00Z"), Some(951_782_400));
/// ```
pub fn format(unix_s: i64) -> String {
    let instant = DateTime::from_timestamp(unix_s, 0).map(|at| at.format("%Y-%m-%dT%H:%M:%SZ").to_string());
    instant.unwrap_or_else(|| format!("{unix_s} s after 1970"))
}

/// Seconds since 1970 of such a text; a bare date is its midnight. `None` for anything else:
/// offsets other than `Z` are not read, so that two certificates compare as text too.
pub fn parse(text: &str) -> Option<i64> {
    let instant = match NaiveDate::parse_from_str(text, "%Y-%m-%d") {
        Ok(date) => date.and_hms_opt(0, 0, 0)?,
        Err(_) => NaiveDateTime::parse_from_str(text, "%Y-%m-%dT%H:%M:%SZ").ok()?,
    };
    let unix_s = instant.and_utc().timestamp();
    // Fields of another width, and leap seconds, are another text.
    format(unix_s).starts_with(text).then_some(unix_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_instants() {
        // The Unix epoch, its billionth second, and a leap day.
        assert_eq!(format(0), "1970-01-01T00:00:00Z");
        assert_eq!(format(1_000_000_000), "2001-09-09T01:46:40Z");
        assert_eq!(parse("2001-09-09T01:46:40Z"), Some(1_000_000_000));
        assert_eq!(format(-1), "1969-12-31T23:59:59Z");
    }

    #[test]
    fn days_that_do_not_exist_are_not_read() {
        for bad in ["2025-02-29", "2025-13-01", "2025-01-01T24:00:00Z", "2025-01-01T10:00:00+01:00", "today"]
        {
            assert_eq!(parse(bad), None, "{bad}");
        }
    }

    proptest::proptest! {
        #[test]
        fn format_and_parse_are_inverse(unix_s in -10_000_000_000i64..100_000_000_000) {
            proptest::prop_assert_eq!(parse(&format(unix_s)), Some(unix_s));
        }
    }
}
