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
    pub const fn si(self) -> &'static str {
        match self {
            Dimension::Length => "m",
            Dimension::Time => "s",
            Dimension::Frequency => "Hz",
            Dimension::Speed => "m/s",
            Dimension::Force => "N",
            Dimension::Pressure => "Pa",
            Dimension::Temperature => "degC",
            Dimension::Percentage => "%",
            Dimension::Angle => "deg",
            Dimension::Ratio => "1",
        }
    }

    /// Some units that are understood, for refusals.
    pub const fn known(self) -> &'static str {
        match self {
            Dimension::Length => "m, mm, um, nm, cm, in",
            Dimension::Time => "s, ms, us, min, h",
            Dimension::Frequency => "Hz, kHz, MHz, rpm, rad/s",
            Dimension::Speed => "m/s, mm/s, um/s, nm/s, mm/min",
            Dimension::Force => "N, mN, uN, kN, gf, kgf, lbf",
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
                "gf" | "g" => Some(Unit::times(980_665.0, -8)),
                "kgf" | "kg" | "kp" => Some(Unit::times(980_665.0, -5)),
                "lbf" => Some(Unit::times(4.448_221_615_260_5, 0)),
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
                "" | "1" | "-" | "N/N" => Some(Unit::SI),
                "%" => Some(Unit::ten(-2)),
                _ => None,
            },
        }
    }

    /// The unit that a header seems to state, whatever its case, and its spelling: `MN` is millinewton and `mhz` megahertz, the
    /// readings that a tribometer can have.
    pub fn guess(dimension: Dimension, text: &str) -> Option<(String, Unit)> {
        let text = plain(text);
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

    /// The value in SI of a number as it is written, a decimal point its only mark; `None` for what is no finite number.
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

/// Without brackets, with one spelling of micro and of 'per second'.
fn plain(text: &str) -> String {
    let text = text.trim().trim_matches(['[', ']', '(', ')']).trim();
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
        near(si(Dimension::Frequency, "rpm", "200"), 200.0 / 60.0);
        near(si(Dimension::Temperature, "K", "300"), 300.0 - 273.15);
        assert!((si(Dimension::Temperature, "°F", "212") - 100.0).abs() < 1e-12);
        near(si(Dimension::Angle, "rad", "1"), 180.0 / PI);
        near(si(Dimension::Percentage, "1", "0.5"), 50.0);
        near(si(Dimension::Pressure, "Torr", "760"), 101_325.0);
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
        for (dimension, said, meant) in [
            (Dimension::Force, "MN", "mN"),
            (Dimension::Force, "mn", "mN"),
            (Dimension::Frequency, "KHZ", "kHz"),
            (Dimension::Speed, "MM/S", "mm/s"),
            (Dimension::Length, "[µm]", "um"),
        ] {
            let unit = Unit::parse(dimension, meant).unwrap();
            assert_eq!(Unit::guess(dimension, said), Some((meant.to_string(), unit)), "{said}");
        }
        assert_eq!(Unit::parse(Dimension::Force, "MN"), Some(Unit::ten(6)));
    }
}
