//! UTC instants as RFC 3339 text, to the second. The clock is the caller's.

/// `2026-03-01T12:00:00Z` of seconds since 1970-01-01T00:00:00Z.
///
/// ```
/// use muprime_calibration::certificate::date::{format, parse};
/// assert_eq!(format(951_782_400), "2000-02-29T00:00:00Z");
/// assert_eq!(parse("2000-02-29T00:00:00Z"), Some(951_782_400));
/// ```
pub fn format(unix_s: i64) -> String {
    let (days, second) = (unix_s.div_euclid(86_400), unix_s.rem_euclid(86_400));
    // Proleptic Gregorian calendar in eras of 400 years that start on 1 March (146,097 days each).
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = year_of_era + 400 * era + i64::from(month <= 2);
    let (hour, minute, second) = (second / 3_600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// Seconds since 1970 of such a text; a bare date is its midnight. `None` for anything else:
/// offsets other than `Z` are not read, so that two certificates compare as text too.
pub fn parse(text: &str) -> Option<i64> {
    let (date, time) = match text.split_once('T') {
        Some((date, time)) => (date, time.strip_suffix('Z')?),
        None => (text, "00:00:00"),
    };
    let numbers = |part: &str, separator: char, widths: [usize; 3]| -> Option<[i64; 3]> {
        let mut fields = part.split(separator);
        let mut out = [0; 3];
        for (slot, width) in out.iter_mut().zip(widths) {
            let field = fields.next()?;
            if field.len() != width || !field.bytes().all(|b| b.is_ascii_digit()) {
                return None;
            }
            *slot = field.parse().ok()?;
        }
        fields.next().is_none().then_some(out)
    };
    let [year, month, day] = numbers(date, '-', [4, 2, 2])?;
    let [hour, minute, second] = numbers(time, ':', [2, 2, 2])?;
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) || hour > 23 || minute > 59 || second > 59 {
        return None;
    }
    let y = if month <= 2 { year - 1 } else { year };
    let (era, year_of_era) = (y.div_euclid(400), y.rem_euclid(400));
    let month_from_march = (month + 9) % 12;
    let day_of_year = (153 * month_from_march + 2) / 5 + day - 1;
    let days =
        era * 146_097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year - 719_468;
    let unix_s = days * 86_400 + hour * 3_600 + minute * 60 + second;
    // A day that the month does not have comes back as another one.
    (format(unix_s).starts_with(date)).then_some(unix_s)
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
