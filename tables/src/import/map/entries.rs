//! Entries of `--map` and `--set`.

use super::{Constant, Map, Taken, stated, unit_row};
use crate::import::apart;
use crate::import::grid::Grid;
use crate::import::targets::{ColumnKind, ColumnTarget, Id, TARGETS};
use instruments::{Dimension, Unit};

/// What is wrong with an entry of `--map` or `--set`, or with the map under a second header (in row `row`).
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what it is")]
pub enum MapError {
    #[error("'{0}': HEADER=TARGET:UNIT is needed")]
    MapEntry(String),
    #[error("'{0}' is not a target; there are {known}", known = names())]
    ColumnTarget(String),
    #[error("'{name}' has no unit ('{unit}')")]
    Unitless { name: String, unit: String },
    #[error("'{unit}' is not a unit of {name}; there are {}", .dimension.known())]
    Unit { name: String, unit: String, dimension: Dimension },
    #[error("'{name}' needs a unit, as in {name}:{}; there are {}", .dimension.si(), .dimension.known())]
    NeedsUnit { name: String, dimension: Dimension },
    #[error("the table has no column '{header}'; it has {there}")]
    NoColumn { header: String, there: String },
    #[error("several columns are called '{0}'; name them by number, as in #3")]
    SeveralColumns(String),
    #[error("--set {0}: NAME=VALUE is needed")]
    SetEntry(String),
    #[error("--set {0}: no such target; there are {known}", known = names())]
    SetTarget(String),
    #[error("--set {name}: '{value}' cannot be read")]
    SetValue { name: String, value: String },
    #[error("--set {0}: a count differs from row to row")]
    SetCount(String),
    #[error("--set {name}: '{unit}' is not a unit; there are {}", .dimension.known())]
    SetUnit { name: String, unit: String, dimension: Dimension },
    #[error("row {row} is a second header, without a column '{header}'")]
    NotUnder { row: u64, header: String },
    #[error("row {row} is a second header, with another unit of '{header}' ('{other}')")]
    OtherUnit { row: u64, header: String, other: String },
}

impl Map {
    /// The headers that entries of `--map` name.
    pub fn headers(entries: &[String]) -> Vec<String> {
        let header = |e: String| Some(e.rsplit_once('=')?.0.trim().to_string());
        parted(entries).filter_map(header).collect()
    }

    /// Reads the entries of `--map`: `HEADER=TARGET[:UNIT]`, parted by commas; a header with a comma in
    /// double quotes; `#3` is the third column.
    ///
    /// # Errors
    /// Everything that is wrong with them at once.
    pub fn stated(grid: &Grid, entries: &[String]) -> Result<Vec<Taken>, Vec<MapError>> {
        all(entries, |entry| column(grid, entry))
    }

    /// Reads `--set NAME=VALUE[:UNIT]`, into the map.
    ///
    /// # Errors
    /// Everything that is wrong at once.
    pub fn set(&mut self, entries: &[String]) -> Result<(), Vec<MapError>> {
        let read = all(entries, constant)?;
        self.time_by_rows |= read.iter().any(Option::is_none);
        self.constants.extend(read.into_iter().flatten());
        Ok(())
    }
}

/// Entries at commas outside of double quotes.
fn parted(texts: &[String]) -> impl Iterator<Item = String> {
    let bare = |entry: &str| entry.replace('"', "").trim().to_string();
    texts.iter().flat_map(|text| apart(text, |c| c == ',')).map(bare).filter(|entry| !entry.is_empty())
}

/// All entries, or everything that is wrong with them.
fn all<T>(entries: &[String], read: impl Fn(&str) -> Result<T, MapError>) -> Result<Vec<T>, Vec<MapError>> {
    let (read, wrong): (Vec<_>, Vec<_>) = parted(entries).map(|entry| read(&entry)).partition(Result::is_ok);
    if wrong.is_empty() {
        Ok(read.into_iter().flatten().collect())
    } else {
        Err(wrong.into_iter().filter_map(Result::err).collect())
    }
}

fn names() -> String {
    TARGETS.iter().map(|t| t.name).collect::<Vec<_>>().join(", ")
}

/// The target and the unit of `TARGET[:UNIT]`. The name of a column of the point table states its unit; of
/// any other it may be `written` in the source beyond doubt.
fn target_of(text: &str, written: Option<&str>) -> Result<(&'static ColumnTarget, Unit, String), MapError> {
    let (name, unit_text) =
        text.split_once(':').map_or((text.trim(), None), |(n, u)| (n.trim(), Some(u.trim())));
    let own = || name.to_string();
    let target = ColumnTarget::named(name).ok_or_else(|| MapError::ColumnTarget(own()))?;
    let Some(dimension) = target.dimension() else {
        return match unit_text {
            // The words for forward and backward.
            Some(words) if target.kind == ColumnKind::Way && words.matches('/').count() == 1 => {
                Ok((target, Unit::SI, words.into()))
            }
            Some(unit) => Err(MapError::Unitless { name: own(), unit: unit.into() }),
            None => Ok((target, Unit::SI, String::new())),
        };
    };
    let by_column = name == target.column && name != target.name;
    match unit_text {
        Some(text) => {
            let unknown = || MapError::Unit { name: own(), unit: text.into(), dimension };
            Ok((target, Unit::parse(dimension, text).ok_or_else(unknown)?, text.to_string()))
        }
        None if by_column || dimension == Dimension::Ratio => {
            Ok((target, Unit::SI, dimension.si().to_string()))
        }
        None => written
            .and_then(|w| Unit::guess(dimension, w).filter(|(_, u)| Unit::parse(dimension, w) == Some(*u)))
            .map(|(text, unit)| (target, unit, text))
            .ok_or_else(|| MapError::NeedsUnit { name: own(), dimension }),
    }
}

fn column(grid: &Grid, entry: &str) -> Result<Taken, MapError> {
    let (header, rest) = entry.rsplit_once('=').ok_or_else(|| MapError::MapEntry(entry.into()))?;
    let header = header.trim();
    // Within the one group that is read its columns have short names.
    let last = header.rsplit('/').next().unwrap_or(header);
    let header =
        if !grid.within.is_empty() && *header == format!("{}{last}", grid.within) { last } else { header };
    let numbered = header.strip_prefix('#').and_then(|n| n.parse::<usize>().ok());
    let places = |is: &dyn Fn(&str) -> bool| -> Vec<usize> {
        (0..grid.header.len()).filter(|k| is(&grid.header[*k])).collect()
    };
    let exact = places(&|h| h == header);
    // A map that was copied from a terminal may be broken over lines within a header.
    let squeezed = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let wanted = squeezed(header);
    let alike = places(&|h| squeezed(h).eq_ignore_ascii_case(&wanted));
    let index = match (&exact[..], &alike[..], numbered) {
        ([one], ..) | ([], [one], _) => *one,
        ([], [], Some(n)) if (1..=grid.header.len()).contains(&n) => n - 1,
        ([], [], _) => {
            let there = grid.header.iter().map(|h| format!("'{h}'")).collect::<Vec<_>>().join(", ");
            return Err(MapError::NoColumn { header: header.into(), there });
        }
        _ => return Err(MapError::SeveralColumns(header.into())),
    };
    let written = unit_row(&grid.units, index).or_else(|| stated(&grid.header[index]));
    let (target, unit, unit_text) = target_of(rest, written)?;
    Ok(Taken { index, header: grid.name(index), target, unit_text, unit, assumed: false })
}

fn constant(entry: &str) -> Result<Option<Constant>, MapError> {
    let (name, text) = entry.split_once('=').ok_or_else(|| MapError::SetEntry(entry.into()))?;
    let (name, text) = (name.trim(), text.trim());
    let (number, unit) = text.split_once(':').map_or((text, None), |(n, u)| (n.trim(), Some(u)));
    let target = ColumnTarget::named(name).ok_or_else(|| MapError::SetTarget(name.into()))?;
    if target.id == Id::Time && number == "rows" {
        return Ok(None);
    }
    let bad = || MapError::SetValue { name: name.into(), value: number.into() };
    let value = match target.kind {
        ColumnKind::Text => f64::NAN,
        ColumnKind::Way => way(number, "").ok_or_else(bad)?,
        ColumnKind::Count => return Err(MapError::SetCount(name.into())),
        ColumnKind::Number(dimension) => {
            // A value without a unit is SI, as the columns of the point table are.
            let unit = unit.unwrap_or(dimension.si());
            let unknown = || MapError::SetUnit { name: name.into(), unit: unit.into(), dimension };
            Unit::parse(dimension, unit).ok_or_else(unknown)?.apply(number).ok_or_else(bad)?
        }
    };
    Ok(Some(Constant { target, text: text.to_string(), value }))
}

/// A direction as people write it, or as `words` state it (`hin/zurück`: forward first).
pub fn way(text: &str, words: &str) -> Option<f64> {
    if let Some((forward, backward)) = words.split_once('/') {
        let number = |text: &str| Unit::SI.apply(text);
        let same = |word: &str| {
            word.trim().eq_ignore_ascii_case(text.trim())
                || number(word).is_some_and(|n| number(text) == Some(n))
        };
        return if same(forward) { Some(1.0) } else { same(backward).then_some(-1.0) };
    }
    match text.trim().to_lowercase().as_str() {
        "forward" | "fwd" | "f" | "trace" | "vor" | "vorwärts" => return Some(1.0),
        "backward" | "bwd" | "b" | "retrace" | "reverse" | "rev" | "zurück" | "rückwärts" => {
            return Some(-1.0);
        }
        _ => {}
    }
    let value = Unit::SI.apply(text)?;
    (value.abs() == 1.0).then_some(value)
}
