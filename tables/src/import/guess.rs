//! What headers usually mean, and the units that they state.

use super::grid::{Cell, Grid};
use super::map::{Map, Taken, stated, unit_row};
use super::targets::{ColumnKind, Id, TARGETS, plain};
use super::units::{Dimension, Unit};

/// The numbers of a column as they are written.
fn column_of(grid: &Grid, index: usize) -> Vec<f64> {
    let number = |r| Unit::SI.apply(&grid.cell(r, index)?.digits(grid.comma)?);
    grid.rows.iter().filter_map(number).collect()
}

/// Whether a column has another value in every row: it counts the rows, and groups none of them.
fn all_differ(grid: &Grid, index: usize) -> bool {
    let mut values: Vec<_> = grid.rows.iter().filter_map(|r| Some(grid.cell(r, index)?.shown())).collect();
    values.sort();
    values.len() > 3 && values.windows(2).all(|pair| pair[0] != pair[1])
}

/// The columns that `stated` leaves open, from the headers: names that usually mean one thing, with the units
/// that the headers state. A header that two columns answer to is left to the reader.
pub fn guess(grid: &Grid, stated: &Map) -> Vec<Taken> {
    let is_open = |target: usize| {
        let column = TARGETS[target].column;
        let otherwise = stated.time_by_rows && column == Id::Time.target().column
            || stated.has(Id::Velocity) && target == Id::Direction as usize;
        !otherwise && !stated.gives(column)
    };
    let mut taken: Vec<Taken> = Vec::new();
    for (index, header) in grid.header.iter().enumerate() {
        if stated.columns.iter().any(|c| c.index == index) {
            continue;
        }
        let row_of_units = unit_row(&grid.units, index);
        let Some((target, unit)) = found(header, row_of_units) else { continue };
        if target == Id::Run as usize && all_differ(grid, index) {
            continue;
        }
        // Beside units of others a friction without one may be a force or a coefficient.
        let unstated = !grid.units.is_empty() && unit.is_none();
        if unstated && target == Id::FrictionForce as usize && plain(header) == "friction" {
            continue;
        }
        let signed = |c: &Cell| c.digits(grid.comma).is_some_and(|d| d.starts_with('-'));
        let negative = grid.rows.iter().any(|r| grid.cell(r, index).is_some_and(signed));
        let target = match target {
            t if t == Id::Speed as usize && negative => Id::Velocity as usize,
            t if t == Id::FrictionForce as usize && negative => Id::LateralForce as usize,
            t => t,
        };
        if !is_open(target) {
            continue;
        }
        let dimension = match TARGETS[target].kind {
            ColumnKind::Number(dimension) => Some(dimension),
            _ => None,
        };
        let stated = unit.is_some();
        let (unit_text, unit) = match (dimension, unit) {
            (Some(d), None) => (d.si().to_string(), Unit::SI),
            (_, Some((text, unit))) => (text, unit),
            (None, None) => (String::new(), Unit::SI),
        };
        let assumed = dimension.is_some_and(|d| d != Dimension::Ratio) && !stated;
        // A letter without a unit is not enough for a value that no rig has.
        if assumed
            && plain(header).len() <= 2
            && !super::remarks::usual(TARGETS[target].column, &column_of(grid, index))
        {
            continue;
        }
        taken.push(Taken { index, header: grid.name(index), target, unit_text, unit, assumed });
    }
    // A force that is read goes before a coefficient that was made of it.
    let forces = |t: &Taken| TARGETS[t.target].column == "lateral_force_n";
    if taken.iter().any(|t| forces(t) && t.target != Id::FrictionCoefficient as usize) {
        taken.retain(|t| t.target != Id::FrictionCoefficient as usize);
    }
    let twice = |t: &Taken, all: &[Taken]| {
        all.iter().filter(|o| TARGETS[o.target].column == TARGETS[t.target].column).count() > 1
    };
    let all = taken.clone();
    taken.retain(|t| !twice(t, &all));
    taken
}

/// Words of a name that is a mean.
const MEANS: [&str; 6] = ["mean", "avg", "average", "mittel", "mittlere", "mittelwert"];
/// Words of a name that is a deviation or an extreme, not the quantity.
const STATISTICS: [&str; 15] = [
    "std",
    "sd",
    "stdev",
    "stddev",
    "stdabw",
    "dev",
    "deviation",
    "abw",
    "standardabweichung",
    "max",
    "min",
    "maximum",
    "minimum",
    "median",
    "sem",
];

/// Words of a row that is a sum, and names of statistics in two words.
const SUMS: [&str; 6] = ["sum", "summe", "total", "meanvalue", "standarddeviation", "standarddev"];

/// Whether a word, plain, names a row that sums others up.
pub fn sums_up(word: &str) -> bool {
    [&MEANS[..], &STATISTICS, &SUMS].iter().any(|words| words.contains(&word))
}

/// What a header means, also behind the name of a structure or the word for a mean.
fn found(header: &str, row_of_units: Option<&str>) -> Option<(usize, Option<(String, Unit)>)> {
    let mean = header.split_once([' ', '.', '_']).filter(|(word, _)| MEANS.contains(&plain(word).as_str()));
    // Structures and recorders put their own name before a point; with a blank behind it, it shortens a word.
    let owner = || header.split_once('.').filter(|(_, name)| name.len() > 1 && !name.starts_with(' '));
    let inner = || mean.or_else(owner).map(|(_, name)| name.trim_start());
    let (target, unit) = meant(header, row_of_units).or_else(|| meant(inner()?, row_of_units))?;
    let deviations = [Id::NormalForceSd as usize, Id::LateralForceSd as usize];
    let minutes = unit.as_ref().is_some_and(|(text, _)| text.ends_with("min"));
    let statistic =
        |word: &str| STATISTICS.contains(&plain(word).as_str()) && !(minutes && plain(word) == "min");
    let is_word = |c: char| !c.is_alphanumeric();
    (deviations.contains(&target) || !outside(header).split(is_word).any(statistic)).then_some((target, unit))
}

/// A header without what is in brackets.
fn outside(header: &str) -> String {
    let mut depth = 0;
    let keeps = |c: &char| {
        depth += i32::from("([{".contains(*c)) - i32::from(")]}".contains(*c));
        depth <= 0
    };
    header.chars().filter(keeps).collect()
}

/// The unit that a column states although none of its quantity's units is meant, with that quantity: why a
/// column with a known name is not guessed.
pub fn open_unit(grid: &Grid, index: usize) -> Option<(usize, String)> {
    let (header, row) = (&grid.header[index], unit_row(&grid.units, index));
    let unit = stated(header).or(row).map(str::trim).filter(|unit| !unit.is_empty())?;
    let name = name_of(header);
    let target = TARGETS.iter().position(|t| t.is_headed(&name))?;
    // A letter alone has many meanings.
    let number = matches!(TARGETS[target].kind, ColumnKind::Number(_)) && name.len() > 1;
    (number && found(header, row).is_none()).then(|| (target, unit.to_string()))
}

/// How a header says that an amplitude is counted, if it does.
pub fn stroke(header: &str) -> Option<Id> {
    without_stroke(header).map(|(_, id)| id)
}

/// A name without the unit behind it, case, blanks and marks.
pub fn name_of(header: &str) -> String {
    let cut =
        ["[", "(", "{", "/", ", ", " in "].iter().filter_map(|mark| header.find(mark)).filter(|at| *at > 0);
    plain(&header[..cut.min().unwrap_or(header.len())])
}

/// Whether a text usually heads a column.
pub fn heads(text: &str) -> bool {
    text.trim_matches(['[', ']', '(', ')', ' ']) != "N" && meant(text, None).is_some()
}

/// Words that say how an amplitude is counted.
const STROKES: [(&str, Id); 24] = [
    ("spitze-spitze", Id::AmplitudePp),
    ("peak-to-peak", Id::AmplitudePp),
    ("peak to peak", Id::AmplitudePp),
    ("peak_to_peak", Id::AmplitudePp),
    ("peaktopeak", Id::AmplitudePp),
    ("peak-peak", Id::AmplitudePp),
    ("peak peak", Id::AmplitudePp),
    ("pk to pk", Id::AmplitudePp),
    ("pk pk", Id::AmplitudePp),
    ("zero-to-peak", Id::AmplitudePeak),
    ("zero to peak", Id::AmplitudePeak),
    ("pk-pk", Id::AmplitudePp),
    ("pk_pk", Id::AmplitudePp),
    ("p-p", Id::AmplitudePp),
    ("pkpk", Id::AmplitudePp),
    ("p2p", Id::AmplitudePp),
    ("ptp", Id::AmplitudePp),
    ("pp", Id::AmplitudePp),
    ("zero_to_peak", Id::AmplitudePeak),
    ("0-pk", Id::AmplitudePeak),
    ("0-p", Id::AmplitudePeak),
    ("peak", Id::AmplitudePeak),
    ("pk", Id::AmplitudePeak),
    ("rms", Id::AmplitudeRms),
];

/// A header without the word for how an amplitude is counted, and which amplitude that is.
fn without_stroke(header: &str) -> Option<(String, Id)> {
    let small = header.to_ascii_lowercase();
    STROKES.iter().find_map(|(words, id)| {
        let at = small.find(words)?;
        let apart = |c: Option<char>| c.is_none_or(|c| !c.is_alphanumeric());
        let end = at + words.len();
        let alone = apart(small[..at].chars().next_back()) && apart(small[end..].chars().next());
        alone.then(|| (format!("{} {}", &header[..at], &header[end..]), *id))
    })
}

/// The unit that the source states for a column that is taken for `target`: in a row of units or in the
/// header.
pub fn unit_of(grid: &Grid, index: usize, target: usize) -> Option<(String, Unit)> {
    let ColumnKind::Number(dimension) = TARGETS[target].kind else { return None };
    let (header, row) = (&grid.header[index], unit_row(&grid.units, index));
    let plainly = row.or_else(|| stated(header)).and_then(|text| Unit::guess(dimension, text));
    plainly.or_else(|| meant(header, row).filter(|(at, _)| TARGETS[*at].kind == TARGETS[target].kind)?.1)
}

/// What a header means, and the unit that it states: in brackets, after a slash or a comma, or as its last words.
fn meant(header: &str, row_of_units: Option<&str>) -> Option<(usize, Option<(String, Unit)>)> {
    let amplitude = |at: usize| TARGETS[at].column == Id::AmplitudePp.target().column;
    if let Some((rest, id)) = without_stroke(header) {
        let unit =
            |units: Option<&str>| Some(without_stroke(units?).map_or(units?.to_string(), |(unit, _)| unit));
        match named(rest.trim(), unit(row_of_units).as_deref()) {
            Some((at, unit)) if amplitude(at) => return Some((id as usize, unit)),
            _ => {}
        }
    } else if let Some((unit, id)) = row_of_units.and_then(without_stroke) {
        return named(header, Some(&unit))
            .filter(|(at, _)| amplitude(*at))
            .map(|(_, unit)| (id as usize, unit));
    }
    named(header, row_of_units)
}

fn named(header: &str, row_of_units: Option<&str>) -> Option<(usize, Option<(String, Unit)>)> {
    let find = |name: &str| {
        let name = plain(name);
        TARGETS.iter().position(|t| t.is_headed(&name))
    };
    let with_unit = |name: &str, text: &str| {
        let at = find(name)?;
        let ColumnKind::Number(dimension) = TARGETS[at].kind else { return None };
        // Friction without a dimension is the coefficient.
        if at == Id::FrictionForce as usize
            && plain(name) == "friction"
            && !text.trim().is_empty()
            && let Some(unit) = Unit::guess(Dimension::Ratio, text)
        {
            return Some((Id::FrictionCoefficient as usize, Some(unit)));
        }
        Some((at, Some(Unit::guess(dimension, text)?)))
    };
    for (open, close) in [('[', ']'), ('(', ')')] {
        let bracketed =
            header.split_once(open).and_then(|(name, rest)| Some((name, rest.split(close).next()?)));
        if let Some(found) = bracketed.and_then(|(name, unit)| with_unit(name, unit)) {
            return Some(found);
        }
    }
    for mark in [" / ", ", ", " in ", "/"] {
        if let Some(found) = header.split_once(mark).and_then(|(name, unit)| with_unit(name, unit)) {
            return Some(found);
        }
    }
    if let Some(found) = row_of_units.and_then(|unit| with_unit(header, unit)) {
        return Some(found);
    }
    let words: Vec<&str> = header.split(['_', ' ', '.', '-']).filter(|w| !w.is_empty()).collect();
    for tail in [2, 1] {
        let Some(cut) = words.len().checked_sub(tail).filter(|cut| *cut > 0) else { continue };
        if let Some(found) = with_unit(&words[..cut].join("_"), &words[cut..].join("/")) {
            return Some(found);
        }
    }
    // What is in brackets and no unit of this quantity is no part of the name: `F (N)` is not `Fn`.
    if header.split_once(['(', '[', '{']).is_some_and(|(_, rest)| !plain(rest).is_empty()) {
        return None;
    }
    let at = find(header)?;
    // A unit that is none of this quantity says that the column is something else, or needs more than a name;
    // signs are units too.
    let sign = header.contains(['%', '°', '‰']) || stated(header).is_some_and(|u| !u.trim().is_empty());
    if (row_of_units.is_some() || sign) && matches!(TARGETS[at].kind, ColumnKind::Number(_)) {
        return None;
    }
    // Force or frequency, amplitude or amplifier: only a unit tells.
    (!["f", "amp", "ampl"].contains(&plain(header).as_str())).then_some((at, None))
}

#[cfg(test)]
pub(super) mod tests;
