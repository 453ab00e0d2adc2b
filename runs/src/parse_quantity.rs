//! Quantities on the command line: `2um`, `27.5kHz`, `20mm/s`, `500mN`, or the bare number in SI.

use instruments::profile::power_of_ten;
use instruments::units::moved;

/// The text with a point, where it has one decimal comma.
pub(crate) fn with_point(text: &str) -> Option<String> {
    (text.matches(',').count() == 1 && !text.contains('.')).then(|| text.trim().replace(',', "."))
}

/// The value in SI of a text with or without a unit. `unit` is the SI unit.
///
/// # Errors
/// What the text is not, and how the quantity is written.
pub fn parse(text: &str, unit: &str) -> Result<f64, String> {
    let text = text.trim();
    if let Ok(value) = text.parse() {
        return Ok(value);
    }
    let split = |at: usize| {
        let (number, written) = text.split_at(at);
        // In decimal digits, so that 2um is the very number that 2e-6 is.
        moved(number, power_of_ten(written.trim(), unit)?)
    };
    text.char_indices().skip(1).find_map(|(at, _)| split(at)).ok_or_else(|| {
        if let Some(pointed) = with_point(text).filter(|pointed| parse(pointed, unit).is_ok()) {
            return format!("a number has a decimal point: {pointed}");
        }
        let examples = match unit {
            "m" => "2um, 0.5mm or 2e-6",
            "Hz" => "27.5kHz or 27500",
            "m/s" => "20mm/s or 0.02",
            "N" => "250mN or 0.25",
            "N/m" => "3.9N/um or 3.9e6",
            "Pa" => "101.325kPa, 28.3MPa or 28.3e6",
            "" => return "a number is needed".into(),
            "s" => "500ms or 0.5",
            _ => "a number",
        };
        format!("not a quantity in {unit}; write {examples} (without a unit: {unit})")
    })
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn units_lead_to_the_same_numbers_as_si() {
        for (text, unit, value) in [
            ("2um", "m", 2e-6),
            ("2 \u{b5}m", "m", 2e-6),
            ("1.2e1nm", "m", 1.2e-8),
            ("3mm", "m", 3e-3),
            ("1m", "m", 1.0),
            ("27.5kHz", "Hz", 27_500.0),
            ("20mm/s", "m/s", 0.02),
            ("500mN", "N", 0.5),
            ("3.9N/um", "N/m", 3.9e6),
            ("28.3MPa", "Pa", 28.3e6),
            ("-5ms", "s", -5e-3),
            ("0.25", "N", 0.25),
            ("inf", "m/s", f64::INFINITY),
        ] {
            assert_eq!(parse(text, unit), Ok(value), "{text}");
        }
        for (text, unit) in
            [("2um", "N"), ("um", "m"), ("2 furlong", "m"), ("20mm", "m/s"), ("", "m"), ("\u{b5}", "m")]
        {
            let why = parse(text, unit).unwrap_err();
            assert!(why.contains("write "), "{text}: {why}");
        }
        assert_eq!(parse("0,9 N", "N"), Err("a number has a decimal point: 0.9 N".into()));
        assert!(parse("1,000,5 N", "N").unwrap_err().contains("write "));
    }
}
