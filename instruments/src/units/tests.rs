//! Units as they are written.

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
        "ohm", "kΩ", "mV", "N/mm", "m/s2", "m/s²", "mm^3", "J", "Nmm", "rev", "counts", "GPa", "ppm", "a.u.",
        "[µm]", "mm·s-1",
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
    for (dimension, text) in
        [(Dimension::Length, "N"), (Dimension::Force, "mm"), (Dimension::Speed, "mm"), (Dimension::Time, "")]
    {
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

#[test]
fn units_are_read_as_words_too() {
    for (dimension, word, symbol) in [
        (Dimension::Force, "newton", "N"),
        (Dimension::Force, "Millinewton", "mN"),
        (Dimension::Length, "micrometers", "um"),
        (Dimension::Length, "micrometre", "um"),
        (Dimension::Length, "microns", "um"),
        (Dimension::Frequency, "kilohertz", "kHz"),
        (Dimension::Frequency, "s-1", "1/s"),
        (Dimension::Speed, "millimeter/second", "mm/s"),
        (Dimension::Time, "msec", "ms"),
        (Dimension::Time, "sec.", "s"),
        (Dimension::Time, "Minuten", "min"),
        (Dimension::Pressure, "kilopascal", "kPa"),
    ] {
        let of = |text: &str| Unit::guess(dimension, text).map(|(_, unit)| unit);
        assert_eq!(of(word), of(symbol), "{word}");
        assert!(of(word).is_some(), "{word}");
    }
}
