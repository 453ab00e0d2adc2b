//! The JSON Schemas of a record's messages, by which a reader that knows nothing of this program finds its way: every key with its
//! meaning and unit. A key that is not in them is a fault of theirs: they allow no other.

use std::sync::LazyLock;

/// How the schemas are written, in the format's own word.
pub(super) const ENCODING: &str = "jsonschema";

/// In the order of the topics; without the blanks that a person wants: every chunk holds them.
static SCHEMAS: LazyLock<[Vec<u8>; 3]> = LazyLock::new(|| {
    [
        include_str!("schemas/cycle.json"),
        include_str!("schemas/pass.json"),
        include_str!("schemas/event.json"),
    ]
    .map(|text| {
        let schema: serde_json::Value = serde_json::from_str(text).expect("a bundled schema is JSON");
        schema.to_string().into_bytes()
    })
});

/// Name of a topic's schema.
pub(super) fn name_of(topic: &str) -> String {
    format!("muprime{}", topic.replace('/', "."))
}

/// The schema of the `kind`-th topic.
pub(super) fn of(kind: usize) -> &'static [u8] {
    &SCHEMAS[kind]
}
