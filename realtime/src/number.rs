//! Numbers in a record that need not be finite: JSON has no word for them, and a record that writes `null`
//! cannot be read again. `NaN` and the infinities are written as text.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serializer};

/// Writes a number; one that is not finite as `"NaN"`, `"inf"` or `"-inf"`.
pub fn serialize<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        to.serialize_f64(*value)
    } else if value.is_nan() {
        to.serialize_str("NaN")
    } else {
        to.serialize_str(if *value > 0.0 { "inf" } else { "-inf" })
    }
}

/// Reads what [`serialize`] writes.
pub fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<f64, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Either<'b> {
        Number(f64),
        Word(std::borrow::Cow<'b, str>),
    }
    match Either::deserialize(from)? {
        Either::Number(value) => Ok(value),
        Either::Word(word) => match &*word {
            "NaN" => Ok(f64::NAN),
            "inf" => Ok(f64::INFINITY),
            "-inf" => Ok(f64::NEG_INFINITY),
            other => Err(D::Error::custom(format!("'{other}' is not a number"))),
        },
    }
}
