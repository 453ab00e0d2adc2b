//! Units of foreign tables. A number keeps its digits: a unit that is a power of ten of the SI's moves the decimal point
//! and rounds once, as if the SI value had been written; any other takes one multiplication or division more.

use std::f64::consts::PI;

/// What a column measures, and so which units it can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Metres.
    Length,
    /// Seconds.
    Time,
    /// Hertz.
    Frequency,
    /// Metres per second.
    Speed,
    /// Newtons.
    Force,
    /// Pascals.
    Pressure,
    /// Degrees Celsius.
    Temperature,
    /// Per cent.
    Percentage,
    /// Degrees.
    Angle,
    /// A ratio.
    Ratio,
}

impl Dimension {
    /// The unit of the point table.
    pub fn si(self) -> &'static str {
        self.known().split(',').next().unwrap_or_default()
    }

    /// Some units that are understood, for refusals; first that of the point table.
    pub const fn known(self) -> &'static str {
        match self {
            Dimension::Length => "m, mm, um, nm, cm, in, rev@20mm (turns on a radius)",
            Dimension::Time => "s, ms, us, min, h, hh:mm, mm:ss",
            Dimension::Frequency => "Hz, kHz, MHz, rpm, rad/s",
            Dimension::Speed => "m/s, mm/s, um/s, nm/s, mm/min, rpm@20mm and rad/s@20mm (turns on a radius)",
            Dimension::Force => {
                "N, mN, uN, kN, gf, kgf, lbf, 12.5N/V (a sensitivity), Nm@20mm (a torque on an arm)"
            }
            Dimension::Pressure => "Pa, hPa, kPa, MPa, bar, mbar, atm, psi, Torr",
            Dimension::Temperature => "degC, K, degF",
            Dimension::Percentage => "%, 1",
            Dimension::Angle => "deg, rad",
            Dimension::Ratio => "1, %",
        }
    }
}

/// A unit: `SI = number * 10^ten * times / over + plus`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    ten: i32,
    times: f64,
    over: f64,
    plus: f64,
}

impl Unit {
    /// The unit of the SI itself.
    pub const SI: Unit = Unit { ten: 0, times: 1.0, over: 1.0, plus: 0.0 };

    /// Hundredths.
    pub const PER_CENT: Unit = Unit::ten(-2);

    const fn ten(ten: i32) -> Self {
        Unit { ten, ..Unit::SI }
    }

    const fn times(times: f64, ten: i32) -> Self {
        Unit { ten, times, ..Unit::SI }
    }

    const fn over(over: f64) -> Self {
        Unit { over, ..Unit::SI }
    }

    /// The unit of that name. A minus before it turns the sign: `-N` is of a sensor that looks the other way.
    pub fn parse(dimension: Dimension, text: &str) -> Option<Unit> {
        let text = plain(text);
        if let Some(turned) = text.strip_prefix('-').filter(|rest| !rest.is_empty()) {
            let unit = Self::parse(dimension, turned)?;
            return Some(Unit { times: -unit.times, plus: -unit.plus, ..unit });
        }
        let text = text.as_str();
        if let Some((turning, arm)) = text.split_once('@') {
            return Self::on_an_arm(dimension, turning, arm);
        }
        if let Some((factor, rest)) = factored(text) {
            let unit =
                Self::parse(dimension, rest).or_else(|| Self::parse(dimension, rest.rsplit_once('/')?.0))?;
            return (unit.plus == 0.0).then_some(Unit { times: unit.times * factor, ..unit });
        }
        match dimension {
            Dimension::Length => match text {
                "micron" | "microns" => Some(Unit::ten(-6)),
                "in" | "inch" => Some(Unit::times(254.0, -4)),
                "mil" => Some(Unit::times(254.0, -7)),
                _ => prefixed(text, &[("m", 0)]),
            },
            Dimension::Time => match text {
                "sec" | "seconds" => Some(Unit::SI),
                "min" | "minutes" => Some(Unit::times(60.0, 0)),
                "hh:mm:ss" | "h:mm:ss" | "hh:mm" | "mm:ss" => Some(Unit::SI),
                "h" | "hr" | "hours" => Some(Unit::times(3600.0, 0)),
                _ => prefixed(text, &[("s", 0)]),
            },
            Dimension::Frequency => match text {
                "rpm" | "1/min" => Some(Unit::over(60.0)),
                "rad/s" => Some(Unit::over(2.0 * PI)),
                "1/s" => Some(Unit::SI),
                _ => prefixed(text, &[("Hz", 0)]),
            },
            Dimension::Speed => {
                let (way, time) = text.split_once('/')?;
                let (way, time) = (Self::parse(Dimension::Length, way)?, Self::parse(Dimension::Time, time)?);
                let (times, over) = (way.times * time.over, way.over * time.times);
                Some(Unit { ten: way.ten - time.ten, times, over, plus: 0.0 })
            }
            Dimension::Force => match text {
                // Loads are often stated as the mass that hangs there.
                "gf" | "g" | "gram" | "grams" | "gram-force" | "grf" | "p" | "pond" => {
                    Some(Unit::times(980_665.0, -8))
                }
                "mgf" | "mg" => Some(Unit::times(980_665.0, -11)),
                "kgf" | "kg" | "kp" => Some(Unit::times(980_665.0, -5)),
                "lbf" | "lb" | "lbs" => Some(Unit::times(4.448_221_615_260_5, 0)),
                _ => prefixed(text, &[("N", 0), ("dyn", -5)]),
            },
            Dimension::Pressure => match text {
                "atm" => Some(Unit::times(101_325.0, 0)),
                "psi" => Some(Unit::times(6_894.757_293_168, 0)),
                "Torr" | "torr" | "mmHg" => Some(Unit { times: 101_325.0, ..Unit::over(760.0) }),
                _ => prefixed(text, &[("Pa", 0), ("bar", 5)]),
            },
            Dimension::Temperature => match text.trim_start_matches("deg").trim_start_matches('°') {
                "C" | "celsius" | "Celsius" => Some(Unit::SI),
                "K" | "kelvin" => Some(Unit { plus: -273.15, ..Unit::SI }),
                "F" => Some(Unit { plus: -32.0 / 1.8, ..Unit::over(1.8) }),
                _ => None,
            },
            Dimension::Percentage => match text {
                "%" | "pct" | "percent" | "%RH" | "%rh" => Some(Unit::SI),
                "1" => Some(Unit::ten(2)),
                _ => None,
            },
            Dimension::Angle => match text {
                "deg" | "°" | "degrees" => Some(Unit::SI),
                "rad" => Some(Unit { times: 180.0, ..Unit::over(PI) }),
                _ => None,
            },
            Dimension::Ratio => match text {
                "" | "1" | "-" | "–" | "—" | "N/N" => Some(Unit::SI),
                "%" => Some(Unit::ten(-2)),
                _ => None,
            },
        }
    }

    /// A turn, a rate of turns or a torque on an arm that is a length with its unit.
    fn on_an_arm(dimension: Dimension, turning: &str, arm: &str) -> Option<Unit> {
        let (length, unit) = factored(arm)?;
        let unit = Self::parse(Dimension::Length, unit)?;
        let arm_m = unit.factor() * length;
        if !(arm_m.is_finite() && arm_m > 0.0) {
            return None;
        }
        let turns = |name: &str| match name {
            "rev" | "revs" | "turn" | "turns" | "cycles" | "r" => Some(2.0 * PI),
            "rad" => Some(1.0),
            "deg" | "°" => Some(PI / 180.0),
            _ => None,
        };
        Some(match dimension {
            Dimension::Length => Unit::times(turns(turning)? * arm_m, 0),
            Dimension::Speed => match turning {
                "rpm" | "1/min" | "U/min" => Unit { times: 2.0 * PI * arm_m, ..Unit::over(60.0) },
                "Hz" | "rps" | "1/s" => Unit::times(2.0 * PI * arm_m, 0),
                _ => {
                    let (way, time) = turning.split_once('/')?;
                    let time = Self::parse(Dimension::Time, time)?;
                    Unit { times: turns(way)? * arm_m, ..Unit::over(time.factor()) }
                }
            },
            Dimension::Force => {
                Unit { over: arm_m, ..prefixed(turning, &[("Nmm", -3), ("Ncm", -2), ("Nm", 0)])? }
            }
            _ => return None,
        })
    }

    /// The unit that a header seems to state, whatever its case, and its spelling: `MN` is millinewton and
    /// `mhz` megahertz, the readings that a tribometer can have.
    pub fn guess(dimension: Dimension, text: &str) -> Option<(String, Unit)> {
        let text = plain(text);
        // A number in a header is a range or a setting, as in `Fz (5 N)`: only a map can state a factor.
        if factored(&text).is_some() {
            return None;
        }
        let small = text.to_lowercase();
        let usual = match dimension {
            Dimension::Force => small.replace('n', "N"),
            Dimension::Frequency => small.replace("hz", "Hz").replace("mHz", "MHz"),
            Dimension::Pressure => small.replace("pa", "Pa").replace("mPa", "MPa"),
            Dimension::Temperature => small.replace('c', "C").replace('f', "F").replace('k', "K"),
            _ => small,
        };
        let mega_force = dimension == Dimension::Force && text == "MN";
        [text, usual].into_iter().skip(usize::from(mega_force)).find_map(|t| {
            let unit = Self::parse(dimension, &t)?;
            Some((t, unit))
        })
    }

    /// The value in SI of a number as it is written, a decimal point its only mark; `None` for what is not a
    /// finite number.
    pub fn apply(&self, number: &str) -> Option<f64> {
        let moved = moved(number, self.ten)?;
        Some(moved * self.times / self.over + self.plus).filter(|v| v.is_finite())
    }

    /// The factor to SI, for the log.
    pub fn factor(&self) -> f64 {
        moved("1", self.ten).unwrap_or(1.0) * self.times / self.over
    }

    /// What is added after the factor.
    pub const fn offset(&self) -> f64 {
        self.plus
    }
}

/// A number before a unit (`12.5N`), which is not a fraction (`1/min`).
fn factored(text: &str) -> Option<(f64, &str)> {
    let digits = text.bytes().take_while(|b| b.is_ascii_digit() || *b == b'.').count();
    let exponent = text[digits..].strip_prefix(['e', 'E']).map_or(0, |rest| {
        let sign = usize::from(rest.starts_with(['+', '-']));
        let count = rest[sign..].bytes().take_while(u8::is_ascii_digit).count();
        if count > 0 { 1 + sign + count } else { 0 }
    });
    let (number, rest) = text.split_at(digits + exponent);
    let number: f64 = number.parse().ok()?;
    (digits > 0 && number.is_finite() && number > 0.0 && !rest.is_empty() && !rest.starts_with('/'))
        .then_some((number, rest))
}

/// Symbols of units, of quantities that no target has among them, and words that stand in their place.
const SYMBOLS: &[&str] = &[
    "m", "s", "g", "N", "Pa", "V", "A", "J", "W", "K", "C", "ohm", "\u{3a9}", "\u{2126}", "Hz", "rad", "deg",
    "°", "°C", "°F", "degC", "degF", "%", "min", "h", "hr", "sec", "rpm", "rev", "revs", "cycle", "cycles",
    "count", "counts", "cts", "digit", "digits", "bit", "bits", "LSB", "lb", "lbs", "lbf", "in", "inch",
    "ft", "mil", "psi", "bar", "atm", "Torr", "mmHg", "ppm", "ppb", "a.u.", "au", "arb.", "n/a", "-", "1",
    "none", "Nm", "Nmm", "Ncm", "Ns", "Wh", "Ah", "VA", "gf", "kgf", "kp", "dyn", "eV", "l", "L", "St", "P",
    "dB", "pct", "percent", "micron", "microns", "px", "step", "steps", "hh:mm:ss", "hh:mm", "mm:ss",
    "h:mm:ss", "x",
];

/// Whether a text can stand in a row of units: symbols of any quantity, with prefixes, exponents, products and quotients.
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

/// Without brackets, with one spelling of micro and of 'per second'.
fn plain(text: &str) -> String {
    let text = text.trim().trim_matches(['[', ']', '(', ')']).trim_matches([',', ';', ' ']);
    let text = text.replace(['µ', 'μ'], "u").replace('⁻', "-").replace('¹', "1");
    let text = text.replace(['·', '*'], " ");
    for per in [" s^-1", " s-1", ".s^-1", ".s-1"] {
        if let Some(head) = text.strip_suffix(per) {
            return format!("{head}/s");
        }
    }
    text.replace(' ', "")
}

/// A base with a prefix of the SI.
fn prefixed(text: &str, bases: &[(&str, i32)]) -> Option<Unit> {
    bases.iter().find_map(|(base, ten)| {
        let prefix = match text.strip_suffix(base)? {
            "" => 0,
            "n" => -9,
            "u" => -6,
            "m" => -3,
            "c" => -2,
            "d" => -1,
            "da" => 1,
            "h" => 2,
            "k" | "K" => 3,
            "M" => 6,
            _ => return None,
        };
        Some(Unit::ten(ten + prefix))
    })
}

/// A decimal number with its point moved, rounded once.
fn moved(number: &str, ten: i32) -> Option<f64> {
    let number = number.trim();
    let (mantissa, exponent) = match number.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
        None => (number, 0),
    };
    let digits = mantissa.trim_start_matches(['+', '-']);
    let plain = digits.chars().all(|c| c.is_ascii_digit() || c == '.') && digits != "." && !digits.is_empty();
    if !plain || mantissa.len() > digits.len() + 1 {
        return None;
    }
    let value: f64 = format!("{mantissa}e{}", exponent.checked_add(ten)?).parse().ok()?;
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn si(dimension: Dimension, unit: &str, number: &str) -> f64 {
        let unit = Unit::parse(dimension, unit).unwrap_or_else(|| panic!("{unit}"));
        unit.apply(number).unwrap_or_else(|| panic!("{number}"))
    }

    /// Moving the point is exact where a multiplication is not: `0.7 * 1e-6` is no `7e-7`.
    #[test]
    fn powers_of_ten_keep_the_last_digit() {
        for k in 1..5000 {
            let text = format!("{}.{:03}", k / 1000, k % 1000);
            let wanted: f64 = format!("{text}e-6").parse().unwrap();
            assert_eq!(si(Dimension::Length, "µm", &text), wanted);
            assert_eq!(si(Dimension::Speed, "um s^-1", &text), wanted);
        }
        assert_eq!(si(Dimension::Force, "mN", "-2.5E2"), -0.25);
        assert_eq!(si(Dimension::Force, "-mN", "-2.5E2"), 0.25);
        assert_eq!(si(Dimension::Frequency, "kHz", "27.5"), 27_500.0);
        assert_eq!(si(Dimension::Pressure, "hPa", "1013.25"), 101_325.0);
        assert_eq!(si(Dimension::Speed, "m/ms", "2"), 2000.0);
    }

    #[test]
    fn other_units_are_right_to_a_rounding() {
        let near = |a: f64, b: f64| assert!((a - b).abs() <= b.abs() * 3e-16, "{a} {b}");
        near(si(Dimension::Speed, "mm/min", "60"), 0.001);
        near(si(Dimension::Force, "gf", "100"), 0.980_665);
        near(si(Dimension::Force, "12.5 N/V", "2"), 25.0);
        near(si(Dimension::Force, "-12.5*N", "2"), -25.0);
        near(si(Dimension::Force, "N·m@20mm", "0.1"), 5.0);
        near(si(Dimension::Speed, "rpm@20 mm", "60"), 0.04 * PI);
        near(si(Dimension::Speed, "rad/s@0.02m", "3"), 0.06);
        near(si(Dimension::Length, "rev@20mm", "0.5"), 0.02 * PI);
        near(si(Dimension::Frequency, "rpm", "200"), 200.0 / 60.0);
        near(si(Dimension::Temperature, "K", "300"), 300.0 - 273.15);
        assert!((si(Dimension::Temperature, "°F", "212") - 100.0).abs() < 1e-12);
        near(si(Dimension::Angle, "rad", "1"), 180.0 / PI);
        near(si(Dimension::Percentage, "1", "0.5"), 50.0);
        near(si(Dimension::Pressure, "Torr", "760"), 101_325.0);
    }

    #[test]
    fn rows_of_units_may_hold_any_quantity() {
        for unit in [
            "ohm", "kΩ", "mV", "N/mm", "m/s2", "m/s²", "mm^3", "J", "Nmm", "rev", "counts", "GPa", "ppm",
            "a.u.", "[µm]", "mm·s-1",
        ] {
            assert!(is_unit(unit), "{unit}");
        }
        for name in ["Time", "Load", "Fx", "speed", "t", "F", "mu", "Step 2"] {
            assert!(!is_unit(name), "{name}");
        }
    }

    #[test]
    fn what_is_no_number_and_no_unit_is_refused() {
        for text in ["", ".", "-", "1,5", "nan", "inf", "1e400", "--1", "1.5 N", "0x10", "1e", "1.2.3"] {
            assert_eq!(Unit::SI.apply(text), None, "{text}");
        }
        for (dimension, text) in [
            (Dimension::Length, "N"),
            (Dimension::Force, "mm"),
            (Dimension::Speed, "mm"),
            (Dimension::Time, ""),
        ] {
            assert_eq!(Unit::parse(dimension, text), None, "{text}");
        }
        for (dimension, written, meant) in [
            (Dimension::Force, "MN", "mN"),
            (Dimension::Force, "mn", "mN"),
            (Dimension::Frequency, "KHZ", "kHz"),
            (Dimension::Speed, "MM/S", "mm/s"),
            (Dimension::Length, "[µm]", "um"),
        ] {
            let unit = Unit::parse(dimension, meant).unwrap();
            assert_eq!(Unit::guess(dimension, written), Some((meant.to_string(), unit)), "{written}");
        }
        assert_eq!(Unit::parse(Dimension::Force, "MN"), Some(Unit::ten(6)));
    }
}
