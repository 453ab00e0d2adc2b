//! Answers that are lines of text.

/// The number that a line stands for: a decimal number, or a truth (`TRUE`, `ON`, `1` / `FALSE`, `OFF`, `0`).
/// `None` for anything else, and for numbers that are not finite.
#[must_use]
pub fn number(line: &str) -> Option<f64> {
    match line.trim() {
        "TRUE" | "ON" => Some(1.0),
        "FALSE" | "OFF" => Some(0.0),
        text => text.parse().ok().filter(|number: &f64| number.is_finite()),
    }
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
}
