//! Symbols of units: those that are read, and those that a row of units may have.

use super::{Dimension, Unit};
use std::f64::consts::PI;

/// Units without a prefix, by what they measure and their names.
pub const UNITS: &[(Dimension, &[&str], Unit)] = &[
    (Dimension::Length, &["in", "inch"], Unit::times(254.0, -4)),
    (Dimension::Length, &["mil"], Unit::times(254.0, -7)),
    (Dimension::Time, &["hh:mm:ss", "h:mm:ss", "hh:mm", "mm:ss", "mdy", "dmy"], Unit::SI),
    (Dimension::Time, &["min", "minute", "minutes", "minuten"], Unit::times(60.0, 0)),
    (Dimension::Time, &["h", "hr", "hour", "hours", "stunden"], Unit::times(3600.0, 0)),
    (Dimension::Time, &["d", "days"], Unit::times(86_400.0, 0)),
    (Dimension::Frequency, &["rpm", "1/min"], Unit::over(60.0)),
    (Dimension::Frequency, &["rad/s"], Unit::over(2.0 * PI)),
    (Dimension::Frequency, &["1/s", "s-1"], Unit::SI),
    // Loads are often stated as the mass that hangs there.
    (Dimension::Force, &["gf", "g", "gram", "grams", "gram-force", "grf", "p", "pond"], GRAM_FORCE),
    (Dimension::Force, &["mgf", "mg"], Unit { ten: GRAM_FORCE.ten - 3, ..GRAM_FORCE }),
    (Dimension::Force, &["ugf", "ug"], Unit { ten: GRAM_FORCE.ten - 6, ..GRAM_FORCE }),
    (Dimension::Force, &["kgf", "kg", "kp"], Unit { ten: GRAM_FORCE.ten + 3, ..GRAM_FORCE }),
    (Dimension::Force, &["lbf", "lb", "lbs"], Unit::times(4.448_221_615_260_5, 0)),
    (Dimension::Pressure, &["atm"], Unit::times(101_325.0, 0)),
    (Dimension::Pressure, &["psi"], Unit::times(6_894.757_293_168, 0)),
    (Dimension::Pressure, &["Torr", "torr", "mmHg"], Unit { times: 101_325.0, ..Unit::over(760.0) }),
    (Dimension::Temperature, &["C", "celsius", "Celsius"], Unit::SI),
    (Dimension::Temperature, &["K", "kelvin"], Unit { plus: -273.15, ..Unit::SI }),
    (Dimension::Temperature, &["F"], Unit { plus: -32.0 / 1.8, ..Unit::over(1.8) }),
    (Dimension::Percentage, &["%", "pct", "percent", "%RH", "%rh"], Unit::SI),
    (Dimension::Percentage, &["1"], Unit::ten(2)),
    (Dimension::Angle, &["deg", "°", "degrees"], Unit::SI),
    (Dimension::Angle, &["rad"], Unit { times: 180.0, ..Unit::over(PI) }),
    (Dimension::Ratio, &["", "1", "-", "–", "—", "N/N"], Unit::SI),
    (Dimension::Ratio, &["%"], Unit::PER_CENT),
];
/// Words of units, longer ones before those that they contain, each with its symbol.
pub const WORDS: &str = "microns um micron um kilogram kg milli m micro u nano n centi c kilo k mega M newtons N newton N meters m \
                         metres m meter m metre m hertz Hz pascal Pa seconds s second s sec s";
const GRAM_FORCE: Unit = Unit::times(980_665.0, -8);

/// Symbols of units, of quantities that no target has among them, and words that replace them.
const SYMBOLS: &[&str] = &[
    "m", "s", "g", "N", "Pa", "V", "A", "J", "W", "K", "C", "ohm", "\u{3a9}", "\u{2126}", "Hz", "rad", "deg",
    "°", "°C", "°F", "degC", "degF", "%", "min", "h", "hr", "sec", "rpm", "rev", "revs", "cycle", "cycles",
    "count", "counts", "cts", "digit", "digits", "bit", "bits", "LSB", "lb", "lbs", "lbf", "in", "inch",
    "ft", "mil", "psi", "bar", "atm", "Torr", "mmHg", "ppm", "ppb", "a.u.", "au", "arb.", "n/a", "-", "1",
    "none", "Nm", "Nmm", "Ncm", "Ns", "Wh", "Ah", "VA", "gf", "kgf", "kp", "dyn", "eV", "l", "L", "St", "P",
    "dB", "pct", "percent", "micron", "microns", "px", "step", "steps", "hh:mm:ss", "hh:mm", "mm:ss",
    "h:mm:ss", "x",
];

/// Whether a text can be in a row of units: symbols of any quantity, with prefixes, exponents, products and quotients.
pub fn is_unit(text: &str) -> bool {
    let text = text.trim().trim_matches(['[', ']', '(', ')']).trim();
    let symbol =
        |t: &str| SYMBOLS.iter().any(|s| *s == t || t.len() > 1 && s.len() > 1 && s.eq_ignore_ascii_case(t));
    if text.is_empty() || symbol(text) {
        return true;
    }
    let with_prefix = |t: &str| {
        let rest = t.strip_prefix(['n', 'u', '\u{b5}', '\u{3bc}', 'm', 'c', 'd', 'h', 'k', 'M', 'G']);
        symbol(t) || rest.is_some_and(|rest| SYMBOLS.contains(&rest) && rest.chars().all(char::is_alphabetic))
    };
    let exponent = |c: char| c.is_ascii_digit() || "^-+²³¹⁻".contains(c);
    text.chars().count() <= 12
        && text.split(['/', '*', '·', ' ', '.']).all(|t| {
            let bare = t.trim_end_matches(exponent);
            with_prefix(if bare.is_empty() { t } else { bare })
        })
}
