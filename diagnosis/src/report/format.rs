//! Names and numbers as the sentences of a verdict have them.

/// A name of a cause, a pair or a parameter as a sentence has it.
pub fn plain(name: &str) -> String {
    name.replace(" + ", "+").replace('+', " + ").replace('_', " ")
}

/// A probability as it can be read: neither certainty nor impossibility is claimed.
pub fn probability(p: f64) -> String {
    match p {
        p if p > 0.999 => "> 0.999".into(),
        p if p < 0.001 => "< 0.001".into(),
        p => format!("{p:.3}"),
    }
}

/// A number with three significant digits.
pub(crate) fn three_digits(value: f64) -> String {
    let scale = 10f64.powi(2 - value.abs().max(1e-300).log10().floor() as i32);
    format!("{}", (value * scale).round() / scale)
}
