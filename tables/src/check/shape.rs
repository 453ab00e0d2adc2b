//! The shape of a file against the JSON Schema of its kind: every key that is unknown or missing and every
//! value of another type, where a reader would stop at the first.

use nearest::{in_its_unit, nearest, nearest_of};
use runs::input::{Problems, in_si, unit_of};
use serde_json::{Map, Value};
use std::ops::Range;
use toml::de::DeTable;
use tree::{Is, Node, TextRange, TreeEntry, entries, types};

mod nearest;
mod tree;

struct Wrong {
    place: TextRange,
    problem: String,
    remedy: Option<String>,
    /// What makes the rest readable: these bytes replaced by that.
    mend: Option<(Range<usize>, String)>,
}

fn all_wrong(schema: &Value, text: &str) -> Option<Vec<Wrong>> {
    let text = in_si(text);
    let table = DeTable::parse(&text).ok()?;
    let mut wrong = Vec::new();
    object(schema, schema, &entries(table.get_ref()), "", Some(0..0), &mut wrong);
    Some(wrong)
}

/// Tells of everything in a TOML text that its schema does not admit. Nothing where the text is not TOML:
/// its reader says that best.
pub fn toml(schema: &Value, text: &str, problems: &mut Problems<'_>) {
    for w in all_wrong(schema, text).unwrap_or_default() {
        let list = w.problem.ends_with("a list in [ ] is needed").then(|| w.place.clone());
        let as_list = list.and_then(|place| runs::input::as_list(text, place));
        problems.add_at(w.place, w.problem, as_list.or(w.remedy));
    }
}

/// The text as it may have been meant, so that its values can be judged as well: misspelt keys by the names
/// that are nearest, numbers in quotation marks without them, and without what else has no place. Lines stay
/// where they are. `None` where that leaves a text that the schema does not admit either.
pub fn as_meant(schema: &Value, text: &str) -> Option<String> {
    let mut meant = text.to_string();
    let mut mends: Vec<(Range<usize>, String)> =
        all_wrong(schema, text)?.into_iter().map(|wrong| wrong.mend).collect::<Option<_>>()?;
    // From the end, so that the places before stay right.
    mends.sort_by_key(|(at, _)| std::cmp::Reverse(at.start));
    for (at, instead) in mends {
        let lines: String = text.get(at.clone())?.chars().filter(|c| *c == '\n').collect();
        meant.replace_range(at, &format!("{instead}{lines}"));
    }
    all_wrong(schema, &meant)?.is_empty().then_some(meant)
}

/// The same for a JSON document: places are paths.
pub fn json(schema: &Value, document: &Value, problems: &mut Problems<'_>) {
    let mut wrong = Vec::new();
    node(schema, schema, &Node::json(document), "", &mut wrong);
    wrong.into_iter().for_each(|w| problems.add_at(None, w.problem, w.remedy));
}

fn resolved<'a>(root: &'a Value, mut schema: &'a Value) -> &'a Value {
    while let Some(name) = schema["$ref"].as_str() {
        match name.strip_prefix('#').and_then(|path| root.pointer(path)) {
            Some(found) => schema = found,
            None => break,
        }
    }
    schema
}

fn here(path: &str) -> &str {
    if path.is_empty() { "the file" } else { path }
}

fn node(root: &Value, schema: &Value, value: &Node, path: &str, wrong: &mut Vec<Wrong>) {
    let schema = resolved(root, schema);
    for of in ["anyOf", "oneOf"] {
        let Some(choices) = schema[of].as_array() else { continue };
        let tried = choices.iter().map(|choice| {
            let mut problems = Vec::new();
            node(root, choice, value, path, &mut problems);
            problems
        });
        // The choice that is nearest is the one that was meant.
        wrong.extend(tried.min_by_key(Vec::len).unwrap_or_default());
    }
    for part in schema["allOf"].as_array().into_iter().flatten() {
        node(root, part, value, path, wrong);
    }
    let Node { is, span } = value;
    if !is.admitted_by(schema) {
        wrong.push(mistyped(schema, value, path));
        return;
    }
    if let (Some(list), Is::Text(text)) = (schema["enum"].as_array(), is)
        && !list.iter().any(|e| e.as_str() == Some(text))
    {
        let known: Vec<&str> = list.iter().filter_map(Value::as_str).collect();
        let problem = format!("{} is '{text}'; one of {} is needed", here(path), known.join(", "));
        let mend = span.clone().zip(nearest_of(text, &known).map(|meant| format!("{meant:?}")));
        wrong.push(Wrong { place: span.clone(), problem, remedy: nearest(text, &known), mend });
    }
    match is {
        Is::Table(entries) => object(root, schema, entries, path, span.clone(), wrong),
        Is::List(items) => {
            for (i, item) in items.iter().enumerate() {
                let of = schema["prefixItems"].get(i).unwrap_or(&schema["items"]);
                node(root, of, item, &format!("{path}[{i}]"), wrong);
            }
        }
        _ => {}
    }
}

/// A value of a type that its schema does not admit.
fn mistyped(schema: &Value, Node { is, span }: &Node, path: &str) -> Wrong {
    let key = path.rsplit('.').next().and_then(|key| key.split('[').next()).unwrap_or_default();
    let unit = unit_of(key);
    let problem = format!("{} is {}; {} is needed", here(path), is.words(), wanted(schema, unit));
    let text = if let Is::Text(text) = is { Some(text) } else { None };
    // A number in quotation marks is judged as the number.
    let number = text.and_then(|text| match text.trim() {
        text if Is::Number.admitted_by(schema) => {
            text.parse().ok().filter(|n: &f64| n.is_finite()).map(|n| format!("{n:?}"))
        }
        text if Is::Integer.admitted_by(schema) => text.parse().ok().map(|n: i64| n.to_string()),
        _ => None,
    });
    let remedy = match (text, &number) {
        (_, Some(number)) => Some(format!("write it without quotation marks: {number}")),
        (Some(text), _) if Is::Number.admitted_by(schema) && !unit.is_empty() => {
            runs::parse_quantity::parse(text, unit).err()
        }
        _ => None,
    };
    Wrong { place: span.clone(), problem, remedy, mend: span.clone().zip(number) }
}

fn object(
    root: &Value,
    schema: &Value,
    entries: &[TreeEntry],
    path: &str,
    place: TextRange,
    wrong: &mut Vec<Wrong>,
) {
    let none = Map::new();
    let properties = schema["properties"].as_object().unwrap_or(&none);
    let known: Vec<&str> = properties.keys().map(String::as_str).collect();
    let key = |name: &str| if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
    for (name, span, value) in entries {
        match (properties.get(name), &schema["additionalProperties"]) {
            (Some(of), _) => {
                let before = wrong.len();
                node(root, of, value, &key(name), wrong);
                let needed = schema["required"].as_array().is_some_and(|all| all.iter().any(|n| n == name));
                let whole = span.as_ref().zip(value.span.as_ref()).map(|(key, value)| key.start..value.end);
                // What may be left out is left out.
                for wrong in wrong[before..].iter_mut().filter(|w| w.mend.is_none() && !needed) {
                    let own = wrong.place == value.span;
                    wrong.mend = whole.clone().filter(|_| own).map(|whole| (whole, String::new()));
                }
            }
            (None, Value::Bool(false)) => {
                let problem = format!("the key {} is not known", key(name));
                let remedy =
                    nearest(name, &known).unwrap_or_else(|| format!("keys here: {}", known.join(", ")));
                // Of a key in another unit nobody wrote a value in this one.
                let free =
                    |meant: &&str| in_its_unit(name, meant) && !entries.iter().any(|(key, ..)| key == meant);
                let mend = match (nearest_of(name, &known).filter(free), span, &value.span) {
                    (Some(meant), Some(key), _) => Some((key.clone(), meant.to_string())),
                    (None, Some(key), Some(value)) => Some((key.start..value.end, String::new())),
                    _ => None,
                };
                wrong.push(Wrong { place: span.clone(), problem, remedy: Some(remedy), mend });
            }
            (None, of @ Value::Object(_)) => node(root, of, value, &key(name), wrong),
            (None, _) => {}
        }
    }
    for name in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        if !entries.iter().any(|(k, ..)| k == name) {
            let problem = format!("the key {} is missing", key(name));
            let of = properties.get(name).unwrap_or(&Value::Null);
            let about = of["description"].as_str().or_else(|| resolved(root, of)["description"].as_str());
            let remedy = about.map(|words| format!("add `{name}`: {}", words.trim_end_matches('.')));
            // A key that was meant by a misspelt one is no longer missing.
            let meant = |key: &str| !properties.contains_key(key) && nearest_of(key, &known) == Some(name);
            let misspelt = entries.iter().any(|(key, ..)| meant(key));
            let mend = misspelt.then(|| (0..0, String::new()));
            wrong.push(Wrong { place: place.clone(), problem, remedy, mend });
        }
    }
}

fn wanted(schema: &Value, unit: &str) -> String {
    let names = types(schema).into_iter().flatten().filter(|name| *name != "null");
    let words = names.map(|name| match name {
        "object" => "a table",
        "array" => "a list in [ ]",
        "string" => "text in quotes",
        "integer" => "a whole number",
        "number" if !unit.is_empty() => "a number, or a text with its unit,",
        "number" => "a number",
        "boolean" => "true or false",
        other => other,
    });
    words.collect::<Vec<_>>().join(" or ")
}

#[cfg(test)]
mod tests;
