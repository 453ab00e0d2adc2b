//! `docs/reference.md`: every key of every kind of file, from the schemas.

use super::schema::Kind;
use crate::import::targets::{ColumnKind as Cell, TARGETS};
use serde_json::{Map, Value};
use std::fmt::Write;

/// The page.
pub fn page() -> String {
    let mut page = String::from(
        "# Reference of all keys and columns\n\n\
         Generated from the code: `MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test words`. `muprime schema KIND` prints the \
         same as JSON Schema, for editors and programs; `muprime init KIND` prints a commented beginning, `muprime show` what is bundled.\n",
    );
    for kind in Kind::all() {
        let schema = kind.schema();
        let _ = write!(page, "\n## {}\n\n{}.\n", kind.name(), kind.words());
        for (name, object) in objects(&schema) {
            if !name.is_empty() {
                let _ = write!(page, "\n### {} `{name}`\n", kind.name());
                if let Some(text) = object.get("description").and_then(Value::as_str) {
                    let _ = write!(page, "\n{}\n", one_line(text));
                }
            }
            page.push_str("\n| key | type | default | meaning |\n|---|---|---|---|\n");
            rows(&mut page, kind, &object);
        }
        choices(&mut page, kind, &schema);
    }
    page.push_str(&defects());
    page.push_str(&targets());
    page
}

/// The objects of a schema: the root without a name, then the definitions in the order of their names. An
/// enumeration of objects has one for each variant.
pub fn objects(schema: &Value) -> Vec<(String, Value)> {
    let mut all = Vec::new();
    push(&mut all, String::new(), schema);
    for (name, definition) in schema.get("$defs").and_then(Value::as_object).into_iter().flatten() {
        push(&mut all, name.clone(), definition);
    }
    all
}

fn push(all: &mut Vec<(String, Value)>, name: String, schema: &Value) {
    if schema.get("properties").is_some() {
        all.push((name.clone(), schema.clone()));
    }
    for list in ["oneOf", "anyOf", "allOf"] {
        for (k, variant) in schema.get(list).and_then(Value::as_array).into_iter().flatten().enumerate() {
            if variant.get("properties").is_some() {
                push(all, format!("{name}.{}", tag(variant).unwrap_or_else(|| (k + 1).to_string())), variant);
            }
        }
    }
}

/// The definitions that are no table of keys: words to choose from, and values that may be written in more
/// than one way. The tables' types link to them.
fn choices(page: &mut String, kind: Kind, schema: &Value) {
    let tables: Vec<String> = objects(schema).into_iter().map(|(name, _)| name).collect();
    let definitions = schema.get("$defs").and_then(Value::as_object);
    for (name, definition) in definitions.into_iter().flatten().filter(|(name, _)| !tables.contains(name)) {
        let words =
            |of: &Value| of.get("description").and_then(Value::as_str).map(one_line).unwrap_or_default();
        let _ = write!(page, "\n### {} `{name}`\n\n{}\n\n", kind.name(), words(definition));
        let variants = definition.get("oneOf").or(definition.get("anyOf")).and_then(Value::as_array);
        match variants {
            None => {
                let _ = writeln!(page, "{}", type_of(kind, definition));
            }
            Some(variants) => {
                page.push_str("| one of | meaning |\n|---|---|\n");
                for variant in variants {
                    let title = tag(variant).map_or_else(|| type_of(kind, variant), |tag| format!("`{tag}`"));
                    let _ = writeln!(page, "| {title} | {} |", words(variant));
                }
            }
        }
    }
}

/// What tells a variant from the others: a property of one value, or its only key.
fn tag(variant: &Value) -> Option<String> {
    let properties = variant.get("properties")?.as_object()?;
    let constant = properties.values().find_map(|p| Some(p.get("const")?.as_str()?.to_string()));
    constant.or_else(|| properties.keys().next().cloned())
}

fn rows(page: &mut String, kind: Kind, object: &Value) {
    let needed: Vec<&str> = object
        .get("required")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    for (key, property) in object.get("properties").and_then(Value::as_object).into_iter().flatten() {
        let default = match property.get("default") {
            _ if needed.contains(&key.as_str()) => "needed".to_string(),
            None | Some(Value::Null) => String::new(),
            Some(Value::Object(_)) => "its own".into(),
            Some(default) => format!("`{}`", default.to_string().replace('|', "\\|")),
        };
        let text = property.get("description").and_then(Value::as_str).map(one_line).unwrap_or_default();
        let _ = writeln!(page, "| `{key}` | {} | {default} | {text} |", type_of(kind, property));
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

/// A type in words; a definition as a link to its table.
fn type_of(kind: Kind, schema: &Value) -> String {
    let Some(object) = schema.as_object() else { return "anything".into() };
    if let Some(name) = object.get("$ref").and_then(Value::as_str).and_then(|r| r.rsplit('/').next()) {
        return format!("[{name}](#{}-{})", kind.name(), name.to_lowercase());
    }
    if let Some(value) = object.get("const") {
        return format!("`{value}`");
    }
    if let Some(values) = object.get("enum").and_then(Value::as_array) {
        return values
            .iter()
            .filter(|v| !v.is_null())
            .map(|v| format!("`{v}`"))
            .collect::<Vec<_>>()
            .join(", ");
    }
    for list in ["anyOf", "oneOf", "allOf"] {
        if let Some(variants) = object.get(list).and_then(Value::as_array) {
            let is_null = |v: &&Value| v.get("type").and_then(Value::as_str) != Some("null");
            let mut words: Vec<String> = variants.iter().filter(is_null).map(|v| type_of(kind, v)).collect();
            words.dedup();
            return words.join(" or ");
        }
    }
    match object.get("type") {
        Some(Value::String(name)) => named(kind, name, object),
        Some(Value::Array(names)) => {
            let names = names.iter().filter_map(Value::as_str).filter(|n| *n != "null");
            names.map(|n| named(kind, n, object)).collect::<Vec<_>>().join(" or ")
        }
        _ => "anything".into(),
    }
}

fn named(kind: Kind, name: &str, object: &Map<String, Value>) -> String {
    match name {
        "array" => match (object.get("items"), object.get("maxItems"), object.get("prefixItems")) {
            (Some(items), Some(count), _) => format!("list of {count}: {}", type_of(kind, items)),
            (Some(items), None, _) => format!("list of {}", type_of(kind, items)),
            (None, _, Some(Value::Array(items))) => {
                format!("list of {}", items.iter().map(|i| type_of(kind, i)).collect::<Vec<_>>().join(", "))
            }
            _ => "list".into(),
        },
        "object" => match object.get("additionalProperties") {
            Some(of) if of.is_object() => format!("table of {}", type_of(kind, of)),
            _ => "table".into(),
        },
        other => other.into(),
    }
}

fn defects() -> String {
    let mut page = String::from(
        "\n## defects\n\nWhat a `[[defect]]` of a defects file (`--defects FILE`) can be of the virtual rig: `name`, and `parameters` or a \
         `seed` that draws them within the range.\n\n\
         | name | where | parameters, with the range of a seed | what it is |\n|---|---|---|---|\n",
    );
    for kind in sim::defects::ALL {
        let parameter = |p: &sim::defects::Parameter| format!("`{}` {} to {}", p.name, p.low, p.high);
        let parameters: Vec<String> = kind.parameters.iter().map(parameter).collect();
        let place = format!("{:?}", kind.place).to_lowercase();
        let about = one_line(kind.summary);
        let _ = writeln!(page, "| `{}` | {place} | {} | {about} |", kind.name, parameters.join("<br>"));
    }
    page
}

fn targets() -> String {
    let mut page = String::from(
        "\n## import: targets\n\nWhat a column of a foreign table can stand for in `muprime import --map HEADER=TARGET:UNIT` and `--set \
         TARGET=VALUE:UNIT`. The name of the point table's column serves as well, and then states the unit.\n\n\
         | target | column | units | meaning | headers that are understood |\n|---|---|---|---|---|\n",
    );
    for t in TARGETS {
        let units = match t.kind {
            Cell::Number(dimension) => dimension.known(),
            Cell::Count => "a whole number",
            Cell::Way => "1, -1, forward, backward",
            Cell::Text => "text",
        };
        let _ = writeln!(
            page,
            "| `{}` | `{}` | {units} | {} | {} |",
            t.name,
            t.column,
            t.words,
            t.headers().join(", ")
        );
    }
    page
}
