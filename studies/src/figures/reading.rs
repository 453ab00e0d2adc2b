//! Files and columns of the figures under a reading of the paper's w: docs/ridge.md tells why there are two.

use clap::builder::{PossibleValuesParser, TypedValueParser};
pub use models::reading::Reading;

/// Reads a reading's name on the command line.
pub fn parser() -> impl TypedValueParser<Value = Reading> {
    let of = |name: String| Reading::ALL.into_iter().find(|reading| reading.name() == name);
    PossibleValuesParser::new(Reading::ALL.map(Reading::name))
        .try_map(move |name| of(name).ok_or("no such reading"))
}

/// A file's name under a reading.
pub fn file(reading: Reading, name: &str) -> String {
    if reading == Reading::PeakToPeak { name.into() } else { format!("{name}_sine_amplitude") }
}

/// The column that holds w, in um.
pub const fn column(reading: Reading) -> &'static str {
    match reading {
        Reading::PeakToPeak => "amplitude_pp_um",
        Reading::SineAmplitude => "sine_amplitude_um",
    }
}
