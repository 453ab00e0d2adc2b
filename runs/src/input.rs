//! Reading files that people wrote: every refusal shows the place in the file and what would do.

use crate::format::rounded;
use crate::run_dir::{IDENTITY, RUN_AGAIN};
use miette::{Diagnostic, NamedSource, SourceSpan};
use models::rig_file::{RigFile, RigFileError};
use serde::de::DeserializeOwned;
use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A file that cannot be used, with the place.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{problem}")]
pub struct BadInput {
    problem: String,
    #[help]
    remedy: Option<String>,
    #[source_code]
    text: NamedSource<Arc<String>>,
    #[label("here")]
    place: Option<SourceSpan>,
}

impl BadInput {
    /// A problem with `text` of the file called `name`, at `place`.
    pub fn new(
        name: &str,
        text: &str,
        place: Option<Range<usize>>,
        problem: impl Into<String>,
        remedy: impl Into<Option<String>>,
    ) -> Self {
        let text = NamedSource::new(name, Arc::new(text.to_string()));
        BadInput { problem: problem.into(), remedy: remedy.into(), text, place: place.map(SourceSpan::from) }
    }

    /// Line, problem and remedy as they follow the file's name in a refusal of a file that names it.
    pub fn after_its_name(&self) -> String {
        let place = self.place.map_or(String::new(), |place| {
            let (line, _) = line_at(self.text.inner(), Some(place.offset()..place.offset()));
            format!(", line {}", line + 1)
        });
        let remedy = self.remedy.as_ref().map_or(String::new(), |remedy| format!(" ({remedy})"));
        format!("{place}: {}{remedy}", self.problem)
    }
}

/// Everything that is wrong with one file.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{} problems: {}", .all.len(), first_of(.all))]
pub struct Several {
    #[related]
    all: Vec<BadInput>,
}

/// The first problems, and how many there are besides.
fn first_of(all: &[BadInput]) -> String {
    let mut list: Vec<String> = all.iter().take(8).map(ToString::to_string).collect();
    if all.len() > list.len() {
        list.push(format!("and {} more", all.len() - list.len()));
    }
    list.join("; ")
}

/// Problems of one file as they are found: all are reported at once.
pub struct Problems<'a> {
    name: &'a str,
    text: &'a str,
    all: Vec<BadInput>,
}

impl<'a> Problems<'a> {
    /// None yet, in the `text` of the file called `name`.
    pub fn of(name: &'a str, text: &'a str) -> Self {
        Problems { name, text, all: Vec::new() }
    }

    /// One more, at the value of a key.
    pub fn add(&mut self, path: &[&str], problem: impl Into<String>, remedy: impl Into<Option<String>>) {
        self.add_at(place_of(self.text, path), problem, remedy);
    }

    /// One more, at a place; a problem that is there already, at the same place, is no second one.
    pub fn add_at(
        &mut self,
        place: Option<Range<usize>>,
        problem: impl Into<String>,
        remedy: impl Into<Option<String>>,
    ) {
        let (place, problem) = (place.map(SourceSpan::from), problem.into());
        if self.all.iter().any(|had| had.place == place && had.problem == problem) {
            return;
        }
        // All of them share one copy of the text.
        let text = match self.all.first() {
            Some(had) => had.text.clone(),
            None => NamedSource::new(self.name, Arc::new(self.text.to_string())),
        };
        self.all.push(BadInput { problem, remedy: remedy.into(), text, place });
    }

    /// Whether there is none so far.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Nothing where there was none.
    ///
    /// # Errors
    /// The problem, or all of them.
    pub fn end(self) -> miette::Result<()> {
        let Problems { mut all, .. } = self;
        match all.len() {
            0 => Ok(()),
            1 => Err(all.remove(0).into()),
            _ => Err(Several { all }.into()),
        }
    }
}

/// Endings of names with their units, as symbols and as OpenMetrics spells them; the longer ones first.
pub const UNITS: [(&str, &str, &str); 14] = [
    ("_n_per_m", "N/m", "newtons_per_meter"),
    ("_m_per_s", "m/s", "meters_per_second"),
    ("_per_s", "1/s", "per_second"),
    ("_n_s", "N/s", "newtons_per_second"),
    ("_m_s", "m/s", "meters_per_second"),
    ("_deg", "deg", "degrees"),
    ("_hz", "Hz", "hertz"),
    ("_pa", "Pa", "pascals"),
    ("_m", "m", "meters"),
    ("_n", "N", "newtons"),
    ("_s", "s", "seconds"),
    ("_c", "deg C", "celsius"),
    ("_pct", "%", "percent"),
    ("_au", "a.u.", "arbitrary_units"),
];

/// The unit that a key's name ends with.
pub fn unit_of(key: &str) -> &'static str {
    UNITS.iter().find(|(ending, ..)| key.ends_with(ending)).map_or("", |(_, unit, _)| unit)
}

/// The unit that was meant, where a value is a thousand or a million times off what is allowed: '27.5 Hz: kHz meant? ...'.
pub fn unit_meant(key: &str, value: f64, [low, high]: [f64; 2]) -> Option<String> {
    let unit = unit_of(key);
    let within = |v: f64| v.is_finite() && v.abs() >= low && v.abs() <= high;
    let other = match unit {
        "deg C" => (value - 273.15, "K"),
        "%" => (100.0 * value, "a share"),
        _ => (f64::NAN, ""),
    };
    if value > 0.0 && !within(value) && within(other.0) {
        return Some(format!("{} meant? Then write {}", other.1, rounded(other.0, 6)));
    }
    // Nobody writes thousandths of a per cent, of a degree or of arbitrary units.
    if matches!(unit, "" | "%" | "a.u." | "deg C")
        || value == 0.0
        || within(value)
        || value < 0.0 && low >= 0.0
    {
        return None;
    }
    // Nobody means a millihertz or a kilometre: the prefixes that people use are those of the quantity.
    const SMALL: [(f64, &str); 2] = [(1e-3, "m"), (1e-6, "u")];
    const LARGE: [(f64, &str); 2] = [(1e3, "k"), (1e6, "M")];
    let prefixes = if matches!(unit, "Hz" | "Pa" | "N/m") { LARGE } else { SMALL };
    // A value a few times too large is a slip of another kind; from 1 on that is so of forces alone.
    if value.abs() > high && value.abs() < 50.0 * high && (value.abs() < 1.0 || unit == "N") {
        return None;
    }
    let (factor, prefix) = prefixes.into_iter().find(|(factor, _)| within(value * factor))?;
    // The prefix stands for the whole unit: N/um reads better than MN/m.
    let meant = match (unit, prefix) {
        ("N/m", "k") => "N/mm".to_string(),
        ("N/m", "M") => "N/um".to_string(),
        _ => format!("{prefix}{unit}"),
    };
    let shown = meant.replace('u', "\u{b5}");
    let si = rounded(value * factor, 11);
    Some(format!("{value} {unit}: {shown} meant? Then write {si:e}, or \"{value}{meant}\""))
}

/// What TOML's reader says, in words for people: no types of the program.
fn in_words(message: &str) -> String {
    const TYPES: [(&[&str], &str); 6] = [
        (&["u8", "u16", "u32", "u64", "usize"], "a whole number, 0 or more"),
        (&["i8", "i16", "i32", "i64", "isize"], "a whole number"),
        (&["f32", "f64"], "a number"),
        (&["a boolean", "bool"], "true or false"),
        (&["a sequence"], "a list in [brackets]"),
        (&["a map"], "a table"),
    ];
    let invalid = message.strip_prefix("invalid ").and_then(|rest| rest.split_once(", expected "));
    let Some((found, expected)) = invalid.filter(|(found, _)| !found.contains("length")) else {
        return message
            .replace("key with no value, expected `=`", "this is not a 'key = value' (is it a TOML file?)");
    };
    let words = TYPES.iter().find(|(names, _)| names.contains(&expected)).map(|(_, words)| *words);
    let words = words.unwrap_or(if expected.starts_with("struct ") { "a table" } else { expected });
    let found = found.trim_start_matches("type: ").trim_start_matches("value: ");
    let found = found.replace("floating point", "number").replace("string", "text");
    format!("{found} was found, {words} is expected")
}

/// The largest file that is read as configuration.
pub const MAX_BYTES: u64 = 1 << 20;

/// The largest table of measurements that is read into memory.
pub const MAX_TABLE_BYTES: u64 = 1 << 30;

/// Text of a configuration file.
///
/// # Errors
/// A file that is not there, no ordinary file, not UTF-8, or larger than [`MAX_BYTES`].
pub fn text_of(path: &Path) -> miette::Result<String> {
    let bytes = bytes_of(path, MAX_BYTES)?;
    String::from_utf8(bytes).map_err(|e| miette::miette!("{}: not UTF-8: {e}", path.display()))
}

/// Contents of a file that somebody named. Devices, pipes and folders are refused unread: a pipe might never
/// say anything, a device never end.
///
/// # Errors
/// A file that is not there, no ordinary file, or larger than `most` bytes.
pub fn bytes_of(path: &Path, most: u64) -> miette::Result<Vec<u8>> {
    let shown = path.display();
    let wrong = |e: std::io::Error| miette::miette!("{shown}: {e}");
    if !path.try_exists().unwrap_or(true) {
        if path.with_file_name(IDENTITY).is_file() {
            miette::bail!(help = RUN_AGAIN, "there is no file {shown}");
        }
        miette::bail!("there is no file {shown}");
    }
    let there = std::fs::metadata(path).map_err(wrong)?;
    if !there.is_file() {
        miette::bail!(help = "give an ordinary file", "{shown} is not an ordinary file");
    }
    let mut bytes = Vec::new();
    // It may grow while it is being read.
    std::fs::File::open(path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes)).map_err(wrong)?;
    if bytes.len() as u64 > most {
        miette::bail!("{shown}: {} bytes; such a file has at most {most}", there.len().max(most + 1));
    }
    Ok(bytes)
}

/// A TOML text with its quantities in SI: `amplitude_pp_m = "2um"` becomes `2e-6`, filled up with blanks, so
/// that places stay. The unit is that of the key; other texts stay as they are.
pub fn in_si(text: &str) -> Cow<'_, str> {
    fn quantities(value: &Spanned<DeValue<'_>>, unit: &str, found: &mut Vec<(Range<usize>, f64)>) {
        match value.get_ref() {
            DeValue::Table(table) => {
                table.iter().for_each(|(k, v)| quantities(v, unit_of(k.get_ref()), found))
            }
            DeValue::Array(list) => list.iter().for_each(|v| quantities(v, unit, found)),
            DeValue::String(text) if !unit.is_empty() && text.parse::<f64>().is_err() => {
                found.extend(crate::parse_quantity::parse(text, unit).map(|si| (value.span(), si)));
            }
            _ => {}
        }
    }
    let Ok(table) = DeTable::parse(text) else { return text.into() };
    let mut found = Vec::new();
    table.get_ref().iter().for_each(|(k, v)| quantities(v, unit_of(k.get_ref()), &mut found));
    let mut si = Cow::from(text);
    found.sort_by_key(|(at, _)| std::cmp::Reverse(at.start));
    for (at, value) in found {
        si.to_mut().replace_range(at.clone(), &format!("{:width$}", format!("{value:e}"), width = at.len()));
    }
    si
}

/// Parses TOML.
///
/// # Errors
/// What TOML or the schema says, with the place. Unknown keys are errors wherever the schema says so.
pub fn parse_toml<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, BadInput> {
    toml::from_str(&in_si(text)).map_err(|e| {
        let remedy = match DeTable::parse(text) {
            Err(_) if e.message() == "duplicate key" => Some(of_repeated(text, e.span())),
            Err(_) => Some(of_syntax(text, e.span())),
            Ok(_) if e.message().ends_with("expected a sequence") => as_list(text, e.span()),
            Ok(_) => None,
        };
        BadInput::new(name, text, e.span(), in_words(e.message()), remedy)
    })
}

/// The line of a place, counted from 0, without its comment.
fn line_at(text: &str, place: Option<Range<usize>>) -> (usize, &str) {
    let at = place.map_or(0, |place| place.start);
    let line = text.get(..at).map_or(0, |before| before.matches('\n').count());
    (line, text.lines().nth(line).unwrap_or_default().split('#').next().unwrap_or_default().trim())
}

/// What helps where a key or a table is there twice.
fn of_repeated(text: &str, place: Option<Range<usize>>) -> String {
    let (_, line) = line_at(text, place);
    let name = line.trim_matches(['[', ']']);
    let both = [format!("[{name}]"), format!("[[{name}]]")];
    let here =
        |header: &String| text.lines().any(|l| l.split('#').next().unwrap_or_default().trim() == header);
    match line.starts_with('[') {
        true if both.iter().all(here) => format!("write [[{name}]] each time"),
        true => format!("put all its keys under one [{name}], or remove one of them"),
        false => "this table has it twice: remove one of them".into(),
    }
}

/// How one value, or one table, is written where a list is needed: `["50kPa"]`, `[[series]]`.
pub fn as_list(text: &str, place: Option<Range<usize>>) -> Option<String> {
    let (_, line) = line_at(text, place);
    let number = |c: char| c.is_ascii_digit() || "+-.".contains(c);
    match (line.strip_prefix('['), line.split_once('=')) {
        (Some(name), _) => Some(format!("write [[{}]]", name.trim_end_matches(']'))),
        (None, Some((key, value))) if value.trim().trim_matches('"').starts_with(number) => {
            Some(format!("write {} = [{}]", key.trim(), value.trim()))
        }
        _ => None,
    }
}

/// What helps where a text is no TOML.
fn of_syntax(text: &str, place: Option<Range<usize>>) -> String {
    let value = line_at(text, place).1.split_once('=');
    let number = value.and_then(|(_, value)| crate::parse_quantity::with_point(value));
    number.filter(|number| number.parse::<f64>().is_ok()).map_or_else(
        || "a line of TOML is `key = value`, [table] or [[list]]; texts have quotation marks".into(),
        |number| format!("a number has a decimal point: {number}"),
    )
}

/// Reads a rig.toml.
///
/// # Errors
/// A file that cannot be read, and all that [`RigFile::check`] refuses, with the places.
pub fn rig_file(path: &Path) -> miette::Result<RigFile> {
    rig_text(&path.display().to_string(), &text_of(path)?)
}

/// The same from the text of the file called `name`.
pub fn rig_text(name: &str, text: &str) -> miette::Result<RigFile> {
    let file: RigFile = parse_toml(name, text)?;
    let mut wrong = Problems::of(name, text);
    let mut rest: toml::Table = parse_toml(name, text)?;
    let mut judged = file.check();
    // A reported value is taken for a good one, and the rest is checked again.
    while let Err(error) = judged {
        let RigFileError::Value { section, key, value, .. } = &error else {
            wrong.add(&[], error.to_string(), None);
            break;
        };
        wrong.add(&[section, key], error.to_string(), unit_meant(key, *value, usual(key)));
        let good = toml::Value::Float(usual(key)[0].max(0.1));
        let before = rest
            .get_mut(*section)
            .and_then(toml::Value::as_table_mut)
            .and_then(|table| table.insert((*key).to_string(), good.clone()));
        if before.is_none_or(|before| before == good) {
            break;
        }
        judged = rest.clone().try_into::<RigFile>().map_or(Ok(()), |file| file.check());
    }
    wrong.end()?;
    Ok(file)
}

/// Values of fingertips and rigs beyond which a unit is suspected: a value is compared with them, never refused for them.
pub fn usual(key: &str) -> [f64; 2] {
    match key {
        "normal_stiffness_n_per_m" | "lateral_stiffness_n_per_m" => [1e4, 1e9],
        "young_modulus_pa" => [1e3, 1e12],
        "radius_m" => [1e-5, 0.2],
        "force_sd_n" => [1e-6, 0.2],
        "lateral_recovery_m_per_s" => [1e-5, 1e3],
        _ => [0.0, f64::INFINITY],
    }
}

/// Where the value of a key stands: `path` names tables and the key, for instance `["limits",
/// "speed_max_m_s"]`. `None` where the key is not in the file (a default was used).
pub fn place_of(text: &str, path: &[&str]) -> Option<Range<usize>> {
    let table = DeTable::parse(text).ok()?;
    let mut here: &DeTable<'_> = table.get_ref();
    let (last, tables) = path.split_last()?;
    for name in tables {
        here = here.get(*name)?.get_ref().as_table()?;
    }
    here.get(*last).map(Spanned::span)
}

/// The place of a key's value in an entry of a list of tables, from 0.
pub(crate) fn place_in(text: &str, list: &str, index: usize, name: &str) -> Option<Range<usize>> {
    let table = DeTable::parse(text).ok()?;
    let entries = table.get_ref().get(list)?.get_ref().as_array()?;
    entries.get(index)?.get_ref().as_table()?.get(name).map(Spanned::span)
}

#[cfg(test)]
mod tests {
    use super::{Problems, in_si, parse_toml, unit_meant};

    #[test]
    fn quantities_with_units_are_their_si_numbers_in_the_same_place() {
        let text = "about = \"2um\"\n[base]\nw_m = \"2um\" # 2um\nf_hz = [\"27.5kHz\", 3e4]\nu_m_s = {v_m_s = \"20mm/s\"}\nn_n = \"two\"\n";
        let si = in_si(text);
        assert_eq!(si.len(), text.len());
        for part in
            ["about = \"2um\"", "w_m = 2e-6  # 2um", "[2.75e4   , 3e4]", "v_m_s = 2e-2    }", "n_n = \"two\""]
        {
            assert!(si.contains(part), "{si}");
        }
        assert_eq!(in_si("no = toml = text"), "no = toml = text");
    }

    #[test]
    fn what_is_no_toml_has_a_remedy_and_a_decimal_comma_its_own() {
        for (text, help) in [
            ("[base]\nfrequency_hz = 27,5 # kHz\n", "a number has a decimal point: 27.5"),
            ("[base\nfrequency_hz = 27\n", "`key = value`"),
            ("a = [1, 2\nb = 3\n", "`key = value`"),
            ("[base]\nw = 1\nw = 2\n", "this table has it twice: remove one of them"),
            ("[base]\nw = 1\n[base]\n", "put all its keys under one [base], or remove one of them"),
            ("[[cell]]\nw = 1\n[cell] # two\n", "write [[cell]] each time"),
            ("[cell]\nw = 1\n[[cell]]\n", "write [[cell]] each time"),
        ] {
            let why = parse_toml::<toml::Table>("plan.toml", text).unwrap_err();
            let help_text = miette::Diagnostic::help(&why).map(|help| help.to_string()).unwrap_or_default();
            assert!(help_text.contains(help), "{text}: {help_text}");
        }
    }

    #[test]
    fn one_value_where_a_list_is_needed_is_shown_as_a_list() {
        #[derive(Debug, serde::Deserialize)]
        struct Plan {
            #[allow(dead_code, reason = "read, not used")]
            series: Vec<Series>,
        }
        #[derive(Debug, serde::Deserialize)]
        struct Series {
            #[allow(dead_code, reason = "read, not used")]
            ambient_pressure_pa: Vec<f64>,
        }
        for (text, help) in [
            (
                "[[series]]\nambient_pressure_pa = \"50kPa\" # low\n",
                "write ambient_pressure_pa = [\"50kPa\"]",
            ),
            ("[series] # one\nambient_pressure_pa = [5e4]\n", "write [[series]]"),
        ] {
            let why = parse_toml::<Plan>("plan.toml", text).unwrap_err();
            assert_eq!(miette::Diagnostic::help(&why).map(|help| help.to_string()).as_deref(), Some(help));
        }
    }

    #[test]
    fn one_problem_at_one_place_is_one() {
        let mut wrong = Problems::of("plan.toml", "[base]\nnormal_force_n = -1\n");
        for problem in ["too small", "too small", "no number"] {
            wrong.add(&["base", "normal_force_n"], problem, None);
        }
        assert!(wrong.end().unwrap_err().to_string().starts_with("2 problems: too small; no number"));
    }

    #[test]
    fn a_prefix_is_suggested_for_units_that_take_one() {
        let of = |key, value| unit_meant(key, value, [1.0, 100.0]);
        assert!(of("speed_m_s", 5000.0).is_some_and(|words| words.contains("mm/s meant?")));
        assert!(of("frequency_hz", 0.05).is_some_and(|words| words.contains("kHz meant?")));
        // Nobody writes millihertz or kilometres.
        for (key, value) in [("frequency_hz", 5000.0), ("radius_m", 0.05), ("speed_m_s", 0.05)] {
            assert_eq!(of(key, value), None, "{key}");
        }
        let air = |key, value, range| unit_meant(key, value, range).unwrap();
        assert_eq!(air("temperature_c", 295.15, [-40.0, 100.0]), "K meant? Then write 22");
        assert_eq!(air("relative_humidity_pct", 0.45, [1.0, 100.0]), "a share meant? Then write 45");
        for key in ["relative_humidity_pct", "skin_moisture_au", "temperature_c"] {
            assert_eq!(of(key, 5000.0), None, "{key}");
        }
        assert_eq!(unit_meant("normal_stiffness_n_per_m", -500.0, [1e2, 1e6]), None, "a sign is no prefix");
        // Half a metre of amplitude is half a micrometre; a speed twice too large is a speed.
        let amplitude = |value| unit_meant("amplitude_pp_m", value, [0.0, 6e-6]);
        assert!(amplitude(0.5).is_some_and(|words| words.contains("\u{b5}m meant? Then write 5e-7")));
        assert_eq!(amplitude(1e-5), None);
        assert_eq!(unit_meant("speed_m_s", 0.5, [0.0, 0.25]), None);
    }
}
