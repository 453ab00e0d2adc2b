//! `docs/reference.md`: every key of every kind of file, from the schemas.

use serde_json::Value;
use sim::defects::Draw;
use std::fmt::Write;
use tables::import::targets::{ColumnKind as Cell, TARGETS};
use tables::schemas::schema::Kind;

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
                if object["description"].is_string() {
                    let _ = write!(page, "\n{}\n", about(&object));
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
    for (name, definition) in schema["$defs"].as_object().into_iter().flatten() {
        push(&mut all, name.clone(), definition);
    }
    all
}

fn push(all: &mut Vec<(String, Value)>, name: String, schema: &Value) {
    if schema["properties"].is_object() {
        all.push((name.clone(), schema.clone()));
    }
    for list in ["oneOf", "anyOf", "allOf"] {
        let variants = schema[list].as_array().into_iter().flatten().enumerate();
        for (k, variant) in variants.filter(|(_, variant)| variant["properties"].is_object()) {
            push(all, format!("{name}.{}", tag(variant).unwrap_or_else(|| (k + 1).to_string())), variant);
        }
    }
}

/// The definitions that are no table of keys: words to choose from, and values that may be written in more
/// than one way. The tables' types link to them.
fn choices(page: &mut String, kind: Kind, schema: &Value) {
    let tables: Vec<String> = objects(schema).into_iter().map(|(name, _)| name).collect();
    let definitions = schema["$defs"].as_object().into_iter().flatten();
    for (name, definition) in definitions.filter(|(name, _)| !tables.contains(name)) {
        let _ = write!(page, "\n### {} `{name}`\n\n{}\n\n", kind.name(), about(definition));
        let Some(variants) = definition["oneOf"].as_array().or(definition["anyOf"].as_array()) else {
            let _ = writeln!(page, "{}", type_of(kind, definition));
            continue;
        };
        page.push_str("| one of | meaning |\n|---|---|\n");
        for variant in variants {
            let title = tag(variant).map_or_else(|| type_of(kind, variant), |tag| format!("`{tag}`"));
            let _ = writeln!(page, "| {title} | {} |", about(variant));
        }
    }
}

/// What tells a variant from the others: a property of one value, or its only key.
fn tag(variant: &Value) -> Option<String> {
    let properties = variant["properties"].as_object()?;
    let constant = properties.values().find_map(|p| Some(p["const"].as_str()?.to_string()));
    constant.or_else(|| properties.keys().next().cloned())
}

fn rows(page: &mut String, kind: Kind, object: &Value) {
    let needed = |key: &str| object["required"].as_array().is_some_and(|all| all.iter().any(|k| k == key));
    for (key, property) in object["properties"].as_object().into_iter().flatten() {
        let default = match &property["default"] {
            _ if needed(key) => "needed".to_string(),
            Value::Null => String::new(),
            Value::Object(_) => "its own".into(),
            default => format!("`{}`", default.to_string().replace('|', "\\|")),
        };
        let _ = writeln!(page, "| `{key}` | {} | {default} | {} |", type_of(kind, property), about(property));
    }
}

/// The description of a key or a definition.
fn about(of: &Value) -> String {
    of["description"].as_str().map(one_line).unwrap_or_default()
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

/// A type in words; a definition as a link to its table.
fn type_of(kind: Kind, schema: &Value) -> String {
    if let Some(name) = schema["$ref"].as_str().and_then(|r| r.rsplit('/').next()) {
        return format!("[{name}](#{}-{})", kind.name(), name.to_lowercase());
    }
    if let Some(value) = schema.get("const") {
        return format!("`{value}`");
    }
    if let Some(values) = schema["enum"].as_array() {
        let values = values.iter().filter(|v| !v.is_null()).map(|v| format!("`{v}`"));
        return values.collect::<Vec<_>>().join(", ");
    }
    if let Some(variants) = ["anyOf", "oneOf", "allOf"].iter().find_map(|list| schema[*list].as_array()) {
        let variants = variants.iter().filter(|v| v["type"] != "null");
        let mut words: Vec<String> = variants.map(|v| type_of(kind, v)).collect();
        words.dedup();
        return words.join(" or ");
    }
    match &schema["type"] {
        Value::String(name) => named(kind, name, schema),
        Value::Array(names) => {
            let names = names.iter().filter_map(Value::as_str).filter(|n| *n != "null");
            names.map(|n| named(kind, n, schema)).collect::<Vec<_>>().join(" or ")
        }
        _ => "anything".into(),
    }
}

fn named(kind: Kind, name: &str, schema: &Value) -> String {
    match name {
        "array" => match (schema.get("items"), schema.get("maxItems"), schema["prefixItems"].as_array()) {
            (Some(items), Some(count), _) => format!("list of {count}: {}", type_of(kind, items)),
            (Some(items), None, _) => format!("list of {}", type_of(kind, items)),
            (None, _, Some(items)) => {
                format!("list of {}", items.iter().map(|i| type_of(kind, i)).collect::<Vec<_>>().join(", "))
            }
            _ => "list".into(),
        },
        "object" => match &schema["additionalProperties"] {
            of @ Value::Object(_) => format!("table of {}", type_of(kind, of)),
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
        let parameter = |p: &sim::defects::Parameter| {
            let (low, high) = (p.low, p.high);
            let range = match p.draw {
                Draw::Signed => format!("{low} to {high}, or the negative"),
                Draw::Factor => format!("{} to {}, or its inverse", 1.0 + low, 1.0 + high),
                Draw::Linear | Draw::Log => format!("{low} to {high}"),
            };
            format!("`{}` {range}", p.name)
        };
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
            t.headers.join(", ")
        );
    }
    page
}
