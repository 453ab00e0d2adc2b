//! Units of profiles and of foreign tables. One that is a power of ten of the SI's moves the decimal point of a
//! number and rounds once, as if the SI value had been written; any other takes one operation more.

use std::f64::consts::PI;
use symbols::{UNITS, WORDS};

mod symbols;

pub use symbols::is_unit;

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
            Dimension::Time => "s, ms, us, min, h, d, hh:mm, mm:ss, mdy and dmy (dates with slashes)",
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

    /// The units that take the prefixes of the SI, each with its power of ten.
    const fn bases(self) -> &'static [(&'static str, i32)] {
        match self {
            Dimension::Length => &[("m", 0)],
            Dimension::Time => &[("s", 0)],
            Dimension::Frequency => &[("Hz", 0)],
            Dimension::Force => &[("N", 0), ("dyn", -5)],
            Dimension::Pressure => &[("Pa", 0), ("bar", 5)],
            _ => &[],
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
        if let (Dimension::Speed, Some((way, time))) = (dimension, text.split_once('/')) {
            let (way, time) = (Self::parse(Dimension::Length, way)?, Self::parse(Dimension::Time, time)?);
            let (times, over) = (way.times * time.over, way.over * time.times);
            return Some(Unit { ten: way.ten - time.ten, times, over, plus: 0.0 });
        }
        let text = if dimension == Dimension::Temperature {
            text.trim_start_matches("deg").trim_start_matches('°')
        } else {
            text
        };
        let named = UNITS.iter().find(|(of, names, _)| *of == dimension && names.contains(&text));
        named.map(|(.., unit)| *unit).or_else(|| prefixed(text, dimension.bases()))
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

    /// The unit that a header seems to state, whatever its case, and its spelling: `MN` is millinewton, `mhz`
    /// and `mHz` are megahertz, the readings that a tribometer can have.
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
        let unusual =
            matches!((dimension, text.as_str()), (Dimension::Force, "MN") | (Dimension::Frequency, "mHz"));
        [text, usual].into_iter().skip(usize::from(unusual)).find_map(|t| {
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

/// Without brackets, with one spelling of micro and of 'per second'.
fn plain(text: &str) -> String {
    let text = text.trim().trim_matches(['[', ']', '(', ')']).trim_matches([',', ';', '.', ' ']);
    let text = text.replace(['µ', 'μ'], "u").replace('⁻', "-").replace('¹', "1");
    let mut text = text.replace(['·', '*'], " ");
    let words: Vec<&str> = WORDS.split_ascii_whitespace().collect();
    let small = text.to_lowercase();
    if words.chunks(2).any(|word| small.contains(word[0])) {
        text = words.chunks(2).fold(small, |all, word| all.replace(word[0], word[1]));
    }
    for per in [" s^-1", " s-1", ".s^-1", ".s-1"] {
        if let Some(head) = text.strip_suffix(per) {
            return format!("{head}/s");
        }
    }
    text.replace(' ', "")
}

/// A base with a prefix of the SI.
fn prefixed(text: &str, bases: &[(&str, i32)]) -> Option<Unit> {
    let power = |(base, ten): &(&str, i32)| Some(Unit::ten(ten + power_of(text.strip_suffix(base)?)?));
    bases.iter().find_map(power)
}

/// The power of ten of a prefix of the SI, 0 of none.
pub fn power_of(prefix: &str) -> Option<i32> {
    Some(match prefix {
        "" => 0,
        "n" => -9,
        "u" | "\u{b5}" | "\u{3bc}" => -6,
        "m" => -3,
        "c" => -2,
        "d" => -1,
        "da" => 1,
        "h" => 2,
        "k" | "K" => 3,
        "M" => 6,
        "G" => 9,
        _ => return None,
    })
}

/// A decimal number with its point moved, rounded once; `None` for what is not a finite number.
pub fn moved(number: &str, ten: i32) -> Option<f64> {
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
mod tests;
