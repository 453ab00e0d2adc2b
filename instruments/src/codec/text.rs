//! Answers that are lines of text.

use super::pattern::Pattern;
use crate::units::{moved, power_of};

/// Decimals of a number whose pattern states none, where a line is written.
const DECIMALS: u8 = 9;

/// What a line of text looks like.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Form {
    /// A bare number, or a truth.
    Number,
    /// A number, an SI prefix or none, and this unit.
    Quantity(String),
    /// Text with numbers in it.
    Pattern(Pattern),
}

impl Form {
    /// How many numbers a line holds.
    pub fn numbers(&self) -> usize {
        match self {
            Self::Pattern(pattern) => pattern.fields().count(),
            Self::Number | Self::Quantity(_) => 1,
        }
    }

    /// The numbers of a line; `None` where it is no such line.
    pub fn read(&self, line: &str) -> Option<Vec<f64>> {
        match self {
            Self::Number => number(line).map(|number| vec![number]),
            Self::Quantity(unit) => quantity(line, unit).map(|number| vec![number]),
            Self::Pattern(pattern) => pattern.read(line),
        }
    }

    /// The line that holds these numbers.
    pub fn write(&self, values: &[f64]) -> String {
        let first = values.first().copied().unwrap_or(f64::NAN);
        match self {
            Self::Number => format!("{first:+.15E}"),
            Self::Quantity(unit) => with_prefix(first, unit),
            Self::Pattern(pattern) => pattern.write(values, DECIMALS),
        }
    }
}

/// The number that a line stands for: a decimal number, or a truth (`TRUE`, `ON`, `1` / `FALSE`, `OFF`, `0`).
/// `None` for anything else, and for numbers that are not finite.
pub fn number(line: &str) -> Option<f64> {
    match line.trim() {
        "TRUE" | "ON" => Some(1.0),
        "FALSE" | "OFF" => Some(0.0),
        text => text.parse().ok().filter(|number: &f64| number.is_finite()),
    }
}

/// SI prefixes as instruments of text write them, the largest first, none among them.
const PREFIXES: [(&str, f64); 7] =
    [("G", 1e9), ("M", 1e6), ("k", 1e3), ("", 1.0), ("m", 1e-3), ("u", 1e-6), ("n", 1e-9)];

/// The value in `unit` that a line such as `5mm/s/V` (0.005 m/s/V) or `8.16 us` stands for: a number, perhaps
/// a space, an SI prefix or none, the unit. `None` for anything else, and for numbers that are not finite.
pub fn quantity(line: &str, unit: &str) -> Option<f64> {
    let rest = line.trim().strip_suffix(unit)?;
    let (number, prefix) = rest.split_at(rest.trim_end_matches(char::is_alphabetic).len());
    // A decimal number is all that may be left: no `inf`, and no `1e3`.
    let number = Some(number.trim_end()).filter(|number| !number.contains(['e', 'E']))?;
    moved(number, power_of(prefix)?)
}

/// The line that stands for a value in `unit`, with the prefix that leaves one to three digits before the point.
pub fn with_prefix(value: f64, unit: &str) -> String {
    let fits = |(_, factor): &&(&str, f64)| value.abs() >= factor * (1.0 - 1e-9);
    let (prefix, factor) = PREFIXES.iter().find(fits).unwrap_or(&("", 1.0));
    // What decimal prefixes leave of binary fractions is rounded away.
    let shown = format!("{:.9}", value / factor);
    let shown = shown.trim_end_matches('0').trim_end_matches('.');
    format!("{shown}{prefix}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines() {
        for (line, expected) in [
            ("+2.750000000000000E+04", Some(27500.0)),
            (" TRUE\r", Some(1.0)),
            ("OFF", Some(0.0)),
            ("-1", Some(-1.0)),
            ("", None),
            ("TXERR", None),
            ("nan", None),
            ("9.9E999", None),
            ("12 34", None),
        ] {
            assert_eq!(number(line), expected, "{line:?}");
        }
    }

    #[test]
    fn quantities_with_prefixes_and_units() {
        let close = |found: Option<f64>, expected: f64| {
            found.is_some_and(|found| (found - expected).abs() <= 1e-12 * expected.abs())
        };
        for (line, unit, expected) in [
            ("5mm/s/V", "m/s/V", 5e-3),
            (" 125 mm/s/V\r", "m/s/V", 0.125),
            ("1m/s/V", "m/s/V", 1.0),
            ("8.16 us", "s", 8.16e-6),
            ("8.16 \u{b5}s", "s", 8.16e-6),
            ("250kHz", "Hz", 250e3),
            ("1.5MHz", "Hz", 1.5e6),
        ] {
            assert!(close(quantity(line, unit), expected), "{line}: {:?}", quantity(line, unit));
            assert!(
                close(quantity(&with_prefix(expected, unit), unit), expected),
                "{}",
                with_prefix(expected, unit)
            );
        }
        for (line, unit) in [
            ("5mm/V", "m/s/V"),
            ("fast", "s"),
            ("", "s"),
            ("us", "s"),
            ("1e3 s", "s"),
            ("inf s", "s"),
            ("8.16", "s"),
        ] {
            assert_eq!(quantity(line, unit), None, "{line}");
        }
        assert_eq!(with_prefix(5e-3, "m/s/V"), "5mm/s/V");
        assert_eq!(with_prefix(8.16e-6, "s"), "8.16us");
        assert_eq!(with_prefix(0.0, "s"), "0s");
    }
}
