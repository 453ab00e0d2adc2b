//! The shape of a file against the JSON Schema of its kind: every key that is unknown or missing and every
//! value of another type, where a reader would stop at the first.

use runs::input::{Problems, in_si, unit_of};
use serde_json::{Map, Value};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value of a file, of either language.
enum Node<'a> {
    Toml(&'a Spanned<DeValue<'a>>),
    Json(&'a Value),
}

/// What a value is, whatever the language.
enum Is<'a> {
    Table(Vec<(String, Option<Range<usize>>, Node<'a>)>),
    List(Vec<Node<'a>>),
    Text(String),
    Integer,
    Number,
    Flag,
    Nothing,
    Other,
}

impl<'a> Node<'a> {
    fn is(&self) -> Is<'a> {
        match self {
            Node::Toml(value) => match value.get_ref() {
                DeValue::Table(table) => Is::Table(entries(table)),
                DeValue::Array(list) => Is::List(list.iter().map(Node::Toml).collect()),
                DeValue::String(text) => Is::Text(text.to_string()),
                DeValue::Integer(_) => Is::Integer,
                DeValue::Float(_) => Is::Number,
                DeValue::Boolean(_) => Is::Flag,
                DeValue::Datetime(_) => Is::Other,
            },
            Node::Json(value) => match value {
                Value::Object(table) => {
                    Is::Table(table.iter().map(|(k, v)| (k.clone(), None, Node::Json(v))).collect())
                }
                Value::Array(list) => Is::List(list.iter().map(Node::Json).collect()),
                Value::String(text) => Is::Text(text.clone()),
                Value::Number(n) if n.is_f64() => Is::Number,
                Value::Number(_) => Is::Integer,
                Value::Bool(_) => Is::Flag,
                Value::Null => Is::Nothing,
            },
        }
    }

    fn span(&self) -> Option<Range<usize>> {
        match self {
            Node::Toml(value) => Some(value.span()),
            Node::Json(_) => None,
        }
    }
}

fn entries<'a>(table: &'a DeTable<'a>) -> Vec<(String, Option<Range<usize>>, Node<'a>)> {
    table.iter().map(|(k, v)| (k.get_ref().to_string(), Some(k.span()), Node::Toml(v))).collect()
}

struct Wrong {
    place: Option<Range<usize>>,
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
    let wrong = all_wrong(schema, text).unwrap_or_default();
    for w in wrong {
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
    node(schema, schema, &Node::Json(document), "", &mut wrong);
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

fn node(root: &Value, schema: &Value, value: &Node<'_>, path: &str, wrong: &mut Vec<Wrong>) {
    let schema = resolved(root, schema);
    for of in ["anyOf", "oneOf"] {
        let Some(choices) = schema[of].as_array() else { continue };
        let tried = choices.iter().map(|choice| {
            let mut problems = Vec::new();
            node(root, choice, value, path, &mut problems);
            problems
        });
        let mut tried: Vec<Vec<Wrong>> = tried.collect();
        if tried.iter().all(|problems| !problems.is_empty()) {
            // The choice that is nearest is the one that was meant.
            tried.sort_by_key(Vec::len);
            wrong.extend(tried.into_iter().next().unwrap_or_default());
        }
    }
    for part in schema["allOf"].as_array().into_iter().flatten() {
        node(root, part, value, path, wrong);
    }
    let is = value.is();
    if !admits(schema, &is) {
        let key = path.rsplit('.').next().and_then(|key| key.split('[').next()).unwrap_or_default();
        let unit = unit_of(key);
        let problem = format!("{} is {}; {} is needed", here(path), words(&is), wanted(schema, unit));
        // A number in quotation marks is judged as the number.
        let number = match &is {
            Is::Text(text) if admits(schema, &Is::Number) => {
                text.trim().parse().ok().filter(|n: &f64| n.is_finite()).map(|n| format!("{n:?}"))
            }
            Is::Text(text) if admits(schema, &Is::Integer) => {
                text.trim().parse().ok().map(|n: i64| n.to_string())
            }
            _ => None,
        };
        let remedy = match (&is, &number) {
            (_, Some(number)) => Some(format!("write it without quotation marks: {number}")),
            (Is::Text(text), _) if admits(schema, &Is::Number) && !unit.is_empty() => {
                runs::quantity::parse(text, unit).err()
            }
            _ => None,
        };
        let mend = value.span().zip(number);
        wrong.push(Wrong { place: value.span(), problem, remedy, mend });
        return;
    }
    if let (Some(list), Is::Text(text)) = (schema["enum"].as_array(), &is)
        && !list.iter().any(|e| e.as_str() == Some(text))
    {
        let known: Vec<&str> = list.iter().filter_map(Value::as_str).collect();
        let problem = format!("{} is '{text}'; one of {} is needed", here(path), known.join(", "));
        let mend = value.span().zip(nearest_of(text, &known).map(|meant| format!("{meant:?}")));
        wrong.push(Wrong { place: value.span(), problem, remedy: nearest(text, &known), mend });
    }
    match is {
        Is::Table(entries) => object(root, schema, &entries, path, value.span(), wrong),
        Is::List(items) => {
            for (i, item) in items.iter().enumerate() {
                let of = schema["prefixItems"].get(i).unwrap_or(&schema["items"]);
                node(root, of, item, &format!("{path}[{i}]"), wrong);
            }
        }
        _ => {}
    }
}

fn object(
    root: &Value,
    schema: &Value,
    entries: &[(String, Option<Range<usize>>, Node<'_>)],
    path: &str,
    place: Option<Range<usize>>,
    wrong: &mut Vec<Wrong>,
) {
    let none = Map::new();
    let properties = schema["properties"].as_object().unwrap_or(&none);
    let key = |name: &str| if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
    for (name, span, value) in entries {
        match (properties.get(name), &schema["additionalProperties"]) {
            (Some(of), _) => {
                let before = wrong.len();
                node(root, of, value, &key(name), wrong);
                let needed = schema["required"].as_array().is_some_and(|all| all.iter().any(|n| n == name));
                let whole = span.as_ref().zip(value.span()).map(|(key, value)| key.start..value.end);
                // What may be left out is left out.
                for wrong in wrong[before..].iter_mut().filter(|w| w.mend.is_none() && !needed) {
                    let own = wrong.place == value.span();
                    wrong.mend = whole.clone().filter(|_| own).map(|whole| (whole, String::new()));
                }
            }
            (None, Value::Bool(false)) => {
                let known: Vec<&str> = properties.keys().map(String::as_str).collect();
                let problem = format!("the key {} is not known", key(name));
                let remedy =
                    nearest(name, &known).unwrap_or_else(|| format!("keys here: {}", known.join(", ")));
                // Of a key in another unit nobody wrote a value in this one.
                let free =
                    |meant: &&str| in_its_unit(name, meant) && !entries.iter().any(|(key, ..)| key == meant);
                let mend = match (nearest_of(name, &known).filter(free), span, value.span()) {
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
            let about = properties.get(name).map(|of| resolved(root, of));
            let about = properties
                .get(name)
                .and_then(|of| of["description"].as_str())
                .or_else(|| about.and_then(|of| of["description"].as_str()));
            let remedy = about.map(|words| format!("add `{name}`: {}", words.trim_end_matches('.')));
            // A key that was meant by a misspelt one is no longer missing.
            let misspelt = entries.iter().any(|(key, ..)| {
                let known: Vec<&str> = properties.keys().map(String::as_str).collect();
                !properties.contains_key(key) && nearest_of(key, &known) == Some(name)
            });
            let mend = misspelt.then(|| (0..0, String::new()));
            wrong.push(Wrong { place: place.clone(), problem, remedy, mend });
        }
    }
}

fn admits(schema: &Value, is: &Is<'_>) -> bool {
    let of = |name: &str| match is {
        Is::Table(_) => name == "object",
        Is::List(_) => name == "array",
        Is::Text(_) | Is::Other => name == "string",
        Is::Integer => name == "integer" || name == "number",
        Is::Number => name == "number",
        Is::Flag => name == "boolean",
        Is::Nothing => name == "null",
    };
    match &schema["type"] {
        Value::String(name) => of(name),
        Value::Array(names) => names.iter().filter_map(Value::as_str).any(of),
        _ => true,
    }
}

fn words(is: &Is<'_>) -> &'static str {
    match is {
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

fn wanted(schema: &Value, unit: &str) -> String {
    let names: Vec<&str> = match &schema["type"] {
        Value::String(name) => vec![name],
        Value::Array(names) => names.iter().filter_map(Value::as_str).filter(|n| *n != "null").collect(),
        _ => Vec::new(),
    };
    let word = |name: &&str| {
        match *name {
            "object" => "a table",
            "array" => "a list in [ ]",
            "string" => "text in quotes",
            "integer" => "a whole number",
            "number" if !unit.is_empty() => "a number, or a text with its unit,",
            "number" => "a number",
            "boolean" => "true or false",
            other => other,
        }
        .to_string()
    };
    names.iter().map(word).collect::<Vec<_>>().join(" or ")
}

/// The known name that a misspelt one is nearest to.
fn nearest(name: &str, known: &[&str]) -> Option<String> {
    nearest_of(name, known).map(|best| match in_its_unit(name, best) {
        true => format!("did you mean `{best}`?"),
        false => format!("did you mean `{best}`? It is in {}, or a text with its unit", unit_of(best)),
    })
}

/// Whether a misspelt key names the unit of the key that was meant, or none.
fn in_its_unit(name: &str, meant: &str) -> bool {
    let unit = unit_of(meant);
    unit.is_empty() || unit == unit_of(name) || meant.starts_with(&format!("{name}_"))
}

fn nearest_of<'k>(name: &str, known: &[&'k str]) -> Option<&'k str> {
    // A name without its unit is meant as often as a misspelt one.
    let of = |k: &str| if k.starts_with(&format!("{name}_")) { 1 } else { distance(name, k) };
    let (distance, best) = known.iter().map(|k| (of(k), *k)).min()?;
    (distance <= 2.max(name.len() / 3)).then_some(best)
}

/// Letters to change, to add or to take away.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut corner = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let change = corner + usize::from(x != *y);
            corner = row[j + 1];
            row[j + 1] = change.min(row[j] + 1).min(corner + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schemas::schema::Kind;

    fn problems_of(kind: Kind, text: &str) -> String {
        let mut problems = Problems::of("file", text);
        toml(&kind.schema(), text, &mut problems);
        problems.end().err().map(|e| format!("{e}")).unwrap_or_default()
    }

    #[test]
    fn all_that_is_misshapen_is_reported_at_once() {
        let plan = runs::bundled::text(runs::plan::BUNDLED, "first-sweep").unwrap();
        assert_eq!(problems_of(Kind::Plan, plan), "");
        let wrong = plan
            .replacen("seed", "sead", 1)
            .replacen("speed_m_s = 0.02", "speed_m_s = \"fast\"", 1)
            .replacen("normal_force_n", "normal_force", 1);
        let message = problems_of(Kind::Plan, &wrong);
        for part in ["sead is not known", "speed_m_s is text", "normal_force_n is missing"] {
            assert!(message.contains(part), "{part}: {message}");
        }
    }

    #[test]
    fn no_bundled_file_is_misshapen() {
        for bundled in crate::schemas::bundled::all() {
            let kind = Kind::all().find(|k| k.name() == bundled.kind).unwrap();
            assert_eq!(problems_of(kind, bundled.text), "", "{}", bundled.name);
        }
    }

    #[test]
    fn a_value_in_another_unit_is_not_judged_as_if_it_were_in_this_one() {
        let setup = runs::bundled::text(runs::setup::BUNDLED, "virtual-ideal").unwrap();
        let wrong = setup.replacen("[limits]", "[limits]\nspeed_max_mm_s = 250", 1);
        let meant = as_meant(&Kind::Setup.schema(), &wrong).unwrap();
        assert!(!meant.contains("250"), "{meant}");
        assert_eq!(
            nearest("speed_max_mm_s", &["speed_max_m_s"]).unwrap(),
            "did you mean `speed_max_m_s`? It is in m/s, or a text with its unit"
        );
    }

    #[test]
    fn texts_in_place_of_numbers_have_a_remedy() {
        let plan = runs::bundled::text(runs::plan::BUNDLED, "first-sweep").unwrap();
        let helps = |from: &str, to: &str| {
            let text = plan.replacen(from, to, 1);
            assert_ne!(text, plan);
            let mut problems = Problems::of("file", &text);
            toml(&Kind::Plan.schema(), &text, &mut problems);
            let why = problems.end().unwrap_err();
            format!("{why}: {}", why.help().unwrap())
        };
        let help = helps("normal_force_n = 0.25", "normal_force_n = \"0,9 N\"");
        assert!(
            help.ends_with(
                "a number, or a text with its unit, is needed: a number has a decimal point: 0.9 N"
            ),
            "{help}"
        );
        let help = helps("normal_force_n = 0.25", "normal_force_n = \"0.9\"");
        assert!(help.ends_with("write it without quotation marks: 0.9"), "{help}");
    }

    #[test]
    fn misspelt_names_find_theirs() {
        assert_eq!(
            nearest("amplitud_pp_m", &["amplitude_pp_m", "speed_m_s"]).unwrap(),
            "did you mean `amplitude_pp_m`?"
        );
        assert_eq!(nearest("colour", &["amplitude_pp_m"]), None);
        assert_eq!(distance("kitten", "sitting"), 3);
    }
}
