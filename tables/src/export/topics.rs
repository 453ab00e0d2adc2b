//! The topics of a run for viewers, in a file and live: one for each quantity, its unit at the end of the
//! name, with a schema that says what it is. A message is `{"value": NUMBER}`; without a value there is no
//! message.

mod signals;

use super::columns::{self, Cells, Column};
use super::unit;
use realtime::Row;
use realtime::recorder::EVENTS;
use runs::MeasuredPass;
use serde_json::{Value, json};
pub use signals::{SIGNALS, Signal};
use std::io::Write as _;

/// A topic: its name and what its messages are.
pub struct Topic {
    /// Name, `/force/lateral_force_n`.
    pub name: String,
    /// What it is, in words.
    pub words: &'static str,
    schema: Value,
}

impl Topic {
    /// Name of its schema.
    pub fn schema_name(&self) -> String {
        format!("muprime{}", self.name.replace('/', "."))
    }

    /// The JSON Schema of its messages.
    pub fn schema(&self) -> String {
        self.schema.to_string()
    }

    /// A topic of `{"value": NUMBER}`.
    fn curve(name: String, words: &'static str) -> Self {
        let unit = unit::of(&name);
        let schema = json!({
            "title": name, "type": "object", "required": ["value"], "additionalProperties": false,
            "description": format!("{words}, in {}", if unit == "1" { "numbers without a unit" } else { unit }),
            "properties": { "value": { "type": "number", "description": words, "unit": unit } },
        });
        Topic { name, words, schema }
    }
}

/// The topics that follow the cycles, in the order of [`SIGNALS`].
pub fn of_cycles() -> Vec<Topic> {
    SIGNALS.iter().map(|signal| Topic::curve(signal.topic.into(), signal.words)).collect()
}

/// The values of a cycle in the order of [`of_cycles`].
pub fn of_row(row: &Row) -> Vec<Option<f64>> {
    SIGNALS.iter().map(|signal| (signal.of)(row).filter(|value| value.is_finite())).collect()
}

/// The topics that have a message per pass: `/pass/COLUMN`, for every column that holds numbers.
pub fn of_passes() -> Vec<Topic> {
    let numbers = |column: &Column| column.unit().is_some();
    let topic = |column: Column| Topic::curve(format!("/pass/{}", column.name), column.words);
    columns::of(&[]).into_iter().filter(numbers).map(topic).collect()
}

/// The values of a pass in the order of [`of_passes`].
pub fn of_pass(pass: &MeasuredPass) -> Vec<Option<f64>> {
    let value = |column: &Column| match &column.cells {
        Cells::Numbers(v) => Some(v[0]),
        Cells::Counts(v) => Some(v[0].map(|count| count as f64)),
        Cells::Texts(_) => None,
    };
    columns::of(std::slice::from_ref(pass)).iter().filter_map(value).collect()
}

/// The topic of the events.
pub fn of_events() -> Topic {
    let words = "trips, arming, zeros, pauses and what else is worth a line";
    let schema = json!({
        "title": EVENTS, "type": "object", "required": ["event"], "description": words,
        "properties": { "event": { "type": "string", "description": "what happened" } },
    });
    Topic { name: EVENTS.into(), words, schema }
}

/// Writes a value as a message; none where JSON has no word for it.
pub fn message(value: Option<f64>, to: &mut Vec<u8>) -> Option<()> {
    let value = value.filter(|value| value.is_finite())?;
    write!(to, "{{\"value\":{value:?}}}").ok()
}
