//! A file of either language as one kind of tree.

use serde_json::Value;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A place in a text; a JSON document has none.
pub type TextRange = Option<Range<usize>>;

/// A value of a file, and its place.
pub struct Node {
    pub is: Is,
    pub span: TextRange,
}

/// What a value is, whatever the language.
pub enum Is {
    Table(Vec<TreeEntry>),
    List(Vec<Node>),
    Text(String),
    Integer,
    Number,
    Flag,
    Nothing,
    Other,
}

/// A key of a table, its place, and its value.
pub type TreeEntry = (String, TextRange, Node);

impl Node {
    fn toml(value: &Spanned<DeValue<'_>>) -> Self {
        let is = match value.get_ref() {
            DeValue::Table(table) => Is::Table(entries(table)),
            DeValue::Array(list) => Is::List(list.iter().map(Node::toml).collect()),
            DeValue::String(text) => Is::Text(text.to_string()),
            DeValue::Integer(_) => Is::Integer,
            DeValue::Float(_) => Is::Number,
            DeValue::Boolean(_) => Is::Flag,
            DeValue::Datetime(_) => Is::Other,
        };
        Node { is, span: Some(value.span()) }
    }

    /// A value of a JSON document.
    pub fn json(value: &Value) -> Self {
        let is = match value {
            Value::Object(table) => {
                Is::Table(table.iter().map(|(key, value)| (key.clone(), None, Node::json(value))).collect())
            }
            Value::Array(list) => Is::List(list.iter().map(Node::json).collect()),
            Value::String(text) => Is::Text(text.clone()),
            Value::Number(n) if n.is_f64() => Is::Number,
            Value::Number(_) => Is::Integer,
            Value::Bool(_) => Is::Flag,
            Value::Null => Is::Nothing,
        };
        Node { is, span: None }
    }
}

/// The entries of a table in TOML.
pub fn entries(table: &DeTable<'_>) -> Vec<TreeEntry> {
    table.iter().map(|(k, v)| (k.get_ref().to_string(), Some(k.span()), Node::toml(v))).collect()
}

impl Is {
    /// What it is, in words.
    pub const fn words(&self) -> &'static str {
        match self {
            Is::Table(_) => "a table",
            Is::List(_) => "a list",
            Is::Text(_) => "text",
            Is::Integer => "a whole number",
            Is::Number => "a number",
            Is::Flag => "true or false",
            Is::Nothing => "null",
            Is::Other => "a date",
        }
    }

    /// Whether a schema admits what it is.
    pub fn admitted_by(&self, schema: &Value) -> bool {
        let of = |name: &str| match self {
            Is::Table(_) => name == "object",
            Is::List(_) => name == "array",
            Is::Text(_) | Is::Other => name == "string",
            Is::Integer => name == "integer" || name == "number",
            Is::Number => name == "number",
            Is::Flag => name == "boolean",
            Is::Nothing => name == "null",
        };
        types(schema).is_none_or(|names| names.into_iter().any(of))
    }
}

/// The types that a schema admits; none where it does not name any.
pub fn types(schema: &Value) -> Option<Vec<&str>> {
    match &schema["type"] {
        Value::String(name) => Some(vec![name]),
        Value::Array(names) => Some(names.iter().filter_map(Value::as_str).collect()),
        _ => None,
    }
}
