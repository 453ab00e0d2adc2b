//! Quantities as people read them: three digits, and the prefix that keeps the number near one.

use models::{Condition, Covariate};

/// Units of an SI unit in which people read it: factor and name, in the order of preference.
const SHOWN: [(&str, &[(f64, &str)]); 14] = [
    ("m", &[(1e6, "\u{b5}m"), (1e3, "mm"), (1.0, "m"), (1e9, "nm")]),
    ("1/m", &[(1e-6, "1/\u{b5}m"), (1e-3, "1/mm"), (1.0, "1/m")]),
    ("1/m^2", &[(1e-12, "1/\u{b5}m\u{b2}"), (1e-6, "1/mm\u{b2}"), (1.0, "1/m\u{b2}")]),
    ("s", &[(1.0, "s"), (1e3, "ms"), (1e6, "\u{b5}s")]),
    ("N", &[(1.0, "N"), (1e3, "mN"), (1e6, "\u{b5}N")]),
    ("m/s", &[(1e3, "mm/s"), (1e6, "\u{b5}m/s"), (1.0, "m/s")]),
    ("s/m", &[(1.0, "s/m"), (1e-3, "s/mm"), (1e3, "ms/m"), (1e-6, "s/\u{b5}m")]),
    ("kg", &[(1e6, "mg"), (1e3, "g"), (1.0, "kg"), (1e9, "\u{b5}g")]),
    ("rad", &[(1e3, "mrad"), (1.0, "rad"), (1e6, "\u{b5}rad")]),
    ("N/K", &[(1e3, "mN/K"), (1.0, "N/K")]),
    ("Pa", &[(1e-3, "kPa"), (1.0, "Pa"), (1e-6, "MPa")]),
    ("N/m", &[(1e-6, "MN/m"), (1e-3, "kN/m"), (1.0, "N/m")]),
    ("degC", &[(1.0, "\u{b0}C")]),
    ("Hz", &[(1e-3, "kHz"), (1.0, "Hz")]),
];

fn raised(exponent: i32) -> String {
    let digits = exponent.abs().to_string();
    let up = |c: char| {
        c.to_digit(10).and_then(|d| {
            "\u{2070}\u{b9}\u{b2}\u{b3}\u{2074}\u{2075}\u{2076}\u{2077}\u{2078}\u{2079}"
                .chars()
                .nth(d as usize)
        })
    };
    let sign = if exponent < 0 { "\u{207b}" } else { "" };
    format!("{sign}{}", digits.chars().filter_map(up).collect::<String>())
}

/// A number with three significant digits; by powers of ten below a thousandth and from a hundred thousand on.
pub fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".into() } else { value.to_string() };
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-3..5).contains(&exponent) {
        return format!("{:.2}\u{d7}10{}", value / 10f64.powi(exponent), raised(exponent));
    }
    let digits = (2 - exponent).max(0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// A value to the second digit of its standard uncertainty: `119.53` for 119.5273 with 0.36.
pub fn to_its_uncertainty(value: f64, sd: f64) -> String {
    let small = |x: f64| x != 0.0 && !(1e-3..1e6).contains(&x.abs());
    if !sd.is_finite() || sd <= 0.0 || small(value) {
        return number(value);
    }
    let digits = (1 - sd.log10().floor() as i32).max(0) as usize;
    format!("{value:.digits$}")
}

/// A value with its standard uncertainty, unit and 95 % interval: all to the second digit of the
/// uncertainty, and by one power of ten; a pure number has no unit.
pub fn with_uncertainty(value: f64, sd: f64, [low, high]: [f64; 2], unit: &str) -> String {
    let (stated, size) = (sd.is_finite() && sd > 0.0, value.abs().max(sd));
    let far = stated && !(1e-3..1e6).contains(&size) && size.is_finite();
    let exponent = if far { size.log10().floor() as i32 } else { 0 };
    let factor = 10f64.powi(-exponent);
    let digits = if stated { (1 - (sd * factor).log10().floor() as i32).max(0) as usize } else { 0 };
    let [v, s, l, h] =
        [value, sd, low, high].map(|x| if stated { format!("{:.digits$}", x * factor) } else { number(x) });
    let scaled = |text: String| match exponent {
        0 => text,
        tens => format!("({text})\u{d7}10{}", raised(tens)),
    };
    let unit = if unit == "1" || unit.is_empty() { String::new() } else { format!(" {unit}") };
    format!("{}{unit} (95 %: {})", scaled(format!("{v} +- {s}")), scaled(format!("{l} to {h}")))
}

/// A value with its interval and unit, in one scale: `0.0766 [0.05, 0.11] 1/um²`. Units that are not listed
/// stay as they are, and a pure number has none.
pub fn with_interval(value: f64, [low, high]: [f64; 2], unit: &str) -> String {
    let largest = value.abs().max(low.abs()).max(high.abs());
    // Beside its interval a value below a thousandth of it is zero.
    let seen = |x: f64| if x.abs() < 1e-3 * largest { 0.0 } else { x };
    let (factor, shown) = scale(if seen(value) == 0.0 { largest } else { value.abs() }, unit);
    let [v, l, h] = [value, low, high].map(|x| number(seen(x) * factor));
    let unit = if shown.is_empty() { String::new() } else { format!(" {shown}") };
    format!("{v} [{l}, {h}]{unit}")
}

/// A value with its unit, in the scale in which people read it: `100 um`.
pub fn quantity(value: f64, unit: &str) -> String {
    let (factor, shown) = scale(value.abs(), unit);
    format!("{} {shown}", number(rounded(value * factor, 9))).trim_end().to_string()
}

/// A value with so many digits behind the first: without the last ones, which only the arithmetic brings in.
pub(crate) fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$e}").parse().unwrap_or(value)
}

/// Values of covariates with their units: the settings of a condition, as far as it has them.
pub(crate) fn settings<'a>(of: impl Iterator<Item = &'a Covariate>, at: &Condition) -> String {
    let one = |c: &Covariate| Some(format!("{} {}", number(c.shown.0 * c.of(at)?), c.shown.1));
    of.filter_map(one).collect::<Vec<_>>().join(", ")
}

/// A covariate with its unit, where it has one: the title of an axis or a column.
pub fn titled(c: &Covariate) -> String {
    let comma = if c.shown.1.is_empty() { "" } else { ", " };
    [c.words, comma, c.shown.1].concat()
}

/// The scale in which a size is read: the first listed that puts it between a tenth and a thousand, else the nearest to one.
fn scale(size: f64, unit: &str) -> (f64, &str) {
    if unit == "1" {
        return (1.0, "");
    }
    let Some((_, all)) = SHOWN.iter().find(|(si, _)| *si == unit) else { return (1.0, unit) };
    let fits = all.iter().find(|(factor, _)| (0.1..1000.0).contains(&(size * factor)));
    let away = |factor: f64| if size > 0.0 { (size * factor).log10().abs() } else { 0.0 };
    let nearest = all.iter().min_by(|a, b| away(a.0).total_cmp(&away(b.0)));
    fits.or(nearest).map_or((1.0, unit), |(factor, name)| (*factor, *name))
}

/// A p-value as it is read: values below one in a million are not distinguished.
pub fn p_value(p: f64) -> String {
    if p < 1e-6 { "p < 1e-6".into() } else { format!("p = {}", number(p)) }
}

#[cfg(test)]
mod tests {
    use super::{number, p_value, with_interval};

    #[test]
    fn values_end_with_their_uncertainty() {
        let shown = |value, sd| super::to_its_uncertainty(value, sd);
        assert_eq!([shown(119.5273, 0.36), shown(0.36, 0.36)], ["119.53", "0.36"]);
        assert_eq!([shown(3300.077, 24.0), shown(1.5e-7, 1e-9)], ["3300", "1.50\u{d7}10\u{207b}\u{2077}"]);
        assert_eq!([shown(2.0, 0.0), shown(54.98706, 9.9e-4)], ["2", "54.98706"]);
    }

    #[test]
    fn a_value_and_its_uncertainty_have_the_same_digits() {
        for (value, sd, ci, unit, shown) in [
            (
                3.7e6,
                113_292.0,
                [3.48e6, 3.92e6],
                "N/m",
                "(3.70 +- 0.11)\u{d7}10\u{2076} N/m (95 %: (3.48 to 3.92)\u{d7}10\u{2076})",
            ),
            (0.4155, 0.0033, [0.409, 0.422], "1", "0.4155 +- 0.0033 (95 %: 0.4090 to 0.4220)"),
            (
                0.03009,
                4.28e-4,
                [0.02917, 0.03101],
                "rad",
                "0.03009 +- 0.00043 rad (95 %: 0.02917 to 0.03101)",
            ),
            (2.0, 0.0, [2.0, 2.0], "s", "2 +- 0 s (95 %: 2 to 2)"),
        ] {
            assert_eq!(super::with_uncertainty(value, sd, ci, unit), shown);
        }
    }

    #[test]
    fn quantities_are_read_near_one() {
        for (value, ci, unit, shown) in [
            (7.657e10, [5e10, 1.1e11], "1/m^2", "0.0766 [0.05, 0.11] 1/\u{b5}m\u{b2}"),
            (1.762e-15, [0.0, 294.0], "s/m", "0 [0, 294] s/m"),
            (2.5e-6, [1e-6, 3.25e-6], "m", "2.5 [1, 3.25] \u{b5}m"),
            (0.0, [0.0, 0.004], "N", "0 [0, 4] mN"),
            (1.1252, [0.92549, 1.5148], "1", "1.13 [0.925, 1.51]"),
            (-0.02, [-0.03, 0.01], "1/K", "-0.02 [-0.03, 0.01] 1/K"),
        ] {
            assert_eq!(with_interval(value, ci, unit), shown);
        }
        assert_eq!(
            [number(123_456.0), number(99_999.0), number(0.012345)],
            ["1.23\u{d7}10\u{2075}", "99999", "0.0123"]
        );
        assert_eq!([p_value(0.0), p_value(0.0213)], ["p < 1e-6", "p = 0.0213"]);
    }
}
