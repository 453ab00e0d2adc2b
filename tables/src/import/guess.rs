//! What headers usually mean, and the units that they state.

use super::grid::{Cell, Grid};
use super::map::{Map, Taken, parts, stated, unit_row};
use super::remarks::usual;
use super::targets::{ColumnTarget, Id, plain};
use super::values::all_differ;
use instruments::{Dimension, Unit};

/// What a header means, and the unit that it states.
type Meaning = (&'static ColumnTarget, Option<(String, Unit)>);

/// The columns that `stated` leaves open, from the headers: names that usually mean one thing, with the units
/// that the headers state. A header that two columns answer to is left to the reader.
pub fn guess(grid: &Grid, stated: &Map) -> Vec<Taken> {
    let is_open = |target: &ColumnTarget| {
        let otherwise = stated.time_by_rows && target.id == Id::Time
            || stated.has(Id::Velocity) && target.id == Id::Direction;
        !otherwise && !stated.gives(target.column)
    };
    let free = stated.free(grid).filter_map(|index| taken(grid, index));
    let mut taken: Vec<Taken> = free.filter(|t| is_open(t.target)).collect();
    // A force that is read goes before a coefficient that was made of it.
    let coefficient = |t: &Taken| t.target.id == Id::FrictionCoefficient;
    if taken.iter().any(|t| t.target.column == "lateral_force_n" && !coefficient(t)) {
        taken.retain(|t| !coefficient(t));
    }
    let given: Vec<&str> = taken.iter().map(|t| t.target.column).collect();
    taken.retain(|t| given.iter().filter(|column| **column == t.target.column).count() == 1);
    taken
}

/// A column as its header and its numbers suggest to take it.
pub fn taken(grid: &Grid, index: usize) -> Option<Taken> {
    let header = &grid.header[index];
    let (target, unit) = found(header, unit_row(&grid.units, index))?;
    let cells = || grid.rows.iter().filter_map(|r| grid.cell(r, index));
    let digits = || cells().filter_map(|c| c.digits(grid.comma));
    let negative = digits().any(|d| d.starts_with('-'));
    let target = match target.id {
        // A column that has another value in every row counts the rows, and groups none of them.
        Id::Run if all_differ(cells().map(Cell::shown).collect()) => return None,
        // Beside units of others a friction without one may be a force or a coefficient.
        Id::FrictionForce if !grid.units.is_empty() && unit.is_none() && plain(header) == "friction" => {
            return None;
        }
        Id::Speed if negative => Id::Velocity.target(),
        Id::FrictionForce if negative => Id::LateralForce.target(),
        _ => target,
    };
    let assumed = unit.is_none() && target.dimension().is_some_and(|d| d != Dimension::Ratio);
    // A letter without a unit is not enough for a value that no rig has.
    let numbers = || digits().filter_map(|d| Unit::SI.apply(&d)).collect::<Vec<_>>();
    if assumed && plain(header).len() <= 2 && !usual(target.column, &numbers()) {
        return None;
    }
    let si = || (target.dimension().map_or("", Dimension::si).to_string(), Unit::SI);
    let (unit_text, unit) = unit.unwrap_or_else(si);
    Some(Taken { index, header: grid.name(index), target, unit_text, unit, assumed })
}

/// Words of a name that is a mean.
const MEANS: [&str; 6] = ["mean", "avg", "average", "mittel", "mittlere", "mittelwert"];
/// Words of a name that is a deviation or an extreme, not the quantity.
const STATISTICS: &str = "std sd stdev stddev stdabw dev deviation abw standardabweichung max min maximum minimum median sem variance \
                          varianz streuung range spannweite cv rsd ci error écart ecart stabw desviación deviazione";
/// Words of a row that is a mean or a sum.
const SUMS: &str = "sum summe total gesamt overall rms mw ø σ x\u{304} mittelwerte durchschnitt moyenne media promedio meanvalue \
                    standarddeviation standarddev";
/// Words beside those; alone they name a row that sums others up only below another one.
const BESIDE: &str = "n of all s p arith value standard type";

fn is_in(list: &str, plain: &str) -> bool {
    list.split(' ').any(|word| word == plain)
}

/// Whether a text names a row that sums others up; `below` that it is below such a row.
pub fn sums_up(text: &str, below: bool) -> bool {
    let small = text.to_lowercase();
    let words = small.split(|c: char| !c.is_alphanumeric() && c != '\u{304}');
    let words: Vec<_> = words.filter(|w| !w.is_empty() && !w.bytes().all(|b| b.is_ascii_digit())).collect();
    let sums = |word: &&str| MEANS.contains(word) || is_in(SUMS, word) || is_in(STATISTICS, word);
    words.iter().all(|w| sums(w) || is_in(BESIDE, w))
        && (below && !words.is_empty() || words.iter().any(sums))
}

/// What a header means, also behind the name of a structure or the word for a mean.
fn found(header: &str, row_of_units: Option<&str>) -> Option<Meaning> {
    let mean = header.split_once([' ', '.', '_']).filter(|(word, _)| MEANS.contains(&plain(word).as_str()));
    // Structures and recorders put their own name before a point; with a blank behind it, it shortens a word.
    let owner = || header.split_once('.').filter(|(_, name)| name.len() > 1 && !name.starts_with(' '));
    let inner = || mean.or_else(owner).map(|(_, name)| name.trim_start());
    let (target, unit) = meant(header, row_of_units).or_else(|| meant(inner()?, row_of_units))?;
    let deviation = matches!(target.id, Id::NormalForceSd | Id::LateralForceSd);
    let minutes = unit.as_ref().is_some_and(|(text, _)| text.ends_with("min"));
    let statistic = |word: &str| is_in(STATISTICS, &plain(word)) && !(minutes && plain(word) == "min");
    let is_word = |c: char| !c.is_alphanumeric();
    (deviation || !outside(header).split(is_word).any(statistic)).then_some((target, unit))
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
pub fn open_unit(grid: &Grid, index: usize) -> Option<(&'static ColumnTarget, &str)> {
    let (header, row) = (&grid.header[index], unit_row(&grid.units, index));
    let name = name_of(header);
    let target = ColumnTarget::headed(&name)?;
    let none = |unit: &&str| target.dimension().is_some_and(|d| Unit::guess(d, unit).is_none());
    let unit = parts(header).map(|(_, unit)| unit).find(none).or_else(|| stated(header)).or(row);
    let unit = unit.map(str::trim).filter(|unit| !unit.is_empty())?;
    // A letter alone has many meanings.
    let number = target.dimension().is_some() && name.len() > 1;
    (number && found(header, row).is_none()).then_some((target, unit))
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

/// Words that say how an amplitude is counted, longer ones before those that they contain.
const STROKES: [(Id, &str); 5] = [
    (
        Id::AmplitudePp,
        "spitze-spitze,peak-to-peak,peak to peak,peak_to_peak,peaktopeak,peak-peak,peak peak,pk to pk,pk pk",
    ),
    (Id::AmplitudePeak, "zero-to-peak,zero to peak"),
    (Id::AmplitudePp, "pk-pk,pk_pk,p-p,pkpk,p2p,ptp,pp"),
    (Id::AmplitudePeak, "zero_to_peak,0-pk,0-p,peak,pk"),
    (Id::AmplitudeRms, "rms"),
];

/// A header without the word for how an amplitude is counted, and which amplitude that is.
fn without_stroke(header: &str) -> Option<(String, Id)> {
    let small = header.to_ascii_lowercase();
    let mut all = STROKES.iter().flat_map(|(id, all)| all.split(',').map(move |words| (id, words)));
    let apart = |c: Option<char>| c.is_none_or(|c| !c.is_alphanumeric());
    all.find_map(|(id, words)| {
        let (before, behind) = small.split_once(words)?;
        let alone = apart(before.chars().next_back()) && apart(behind.chars().next());
        let behind = &header[before.len() + words.len()..];
        alone.then(|| (format!("{} {behind}", &header[..before.len()]), *id))
    })
}

/// The unit that the source states for a column that is taken for `target`: in a row of units or in the
/// header.
pub fn unit_of(grid: &Grid, index: usize, target: &ColumnTarget) -> Option<(String, Unit)> {
    let dimension = target.dimension()?;
    let (header, row) = (&grid.header[index], unit_row(&grid.units, index));
    let plainly = row.or_else(|| stated(header)).and_then(|text| Unit::guess(dimension, text));
    plainly.or_else(|| meant(header, row).filter(|(found, _)| found.kind == target.kind)?.1)
}

/// What a header means, and the unit that it states: in brackets, after a slash or a comma, or as its last words.
fn meant(header: &str, row_of_units: Option<&str>) -> Option<Meaning> {
    let counted = |header: &str, units: Option<&str>, id: Id| {
        let (target, unit) = named(header, units)?;
        (target.column == id.target().column).then(|| (id.target(), unit))
    };
    let unit_without = row_of_units.and_then(without_stroke);
    if let Some((rest, id)) = without_stroke(header) {
        let unit = unit_without.map(|(unit, _)| unit).or(row_of_units.map(String::from));
        if let Some(found) = counted(rest.trim(), unit.as_deref(), id) {
            return Some(found);
        }
    } else if let Some((unit, id)) = unit_without {
        return counted(header, Some(&unit), id);
    }
    named(header, row_of_units)
}

fn named(header: &str, row_of_units: Option<&str>) -> Option<Meaning> {
    let with_unit = |name: &str, text: &str| {
        let target = ColumnTarget::headed(name)?;
        let dimension = target.dimension()?;
        // Friction without a dimension is the coefficient.
        if target.id == Id::FrictionForce
            && plain(name) == "friction"
            && !text.trim().is_empty()
            && let Some(unit) = Unit::guess(Dimension::Ratio, text)
        {
            return Some((Id::FrictionCoefficient.target(), Some(unit)));
        }
        Some((target, Some(Unit::guess(dimension, text)?)))
    };
    let in_row = || with_unit(header, row_of_units?);
    let words: Vec<&str> = header.split(['_', ' ', '.', '-']).filter(|w| !w.is_empty()).collect();
    let last = |count: usize| {
        let cut = words.len().checked_sub(count).filter(|cut| *cut > 0)?;
        with_unit(&words[..cut].join("_"), &words[cut..].join("/"))
    };
    let stated_there = parts(header).find_map(|(name, unit)| with_unit(name, unit));
    if let Some(found) = stated_there.or_else(in_row).or_else(|| last(2)).or_else(|| last(1)) {
        return Some(found);
    }
    // What is in brackets and no unit of this quantity is no part of the name: `F (N)` is not `Fn`.
    if header.split_once(['(', '[', '{']).is_some_and(|(_, rest)| !plain(rest).is_empty()) {
        return None;
    }
    let target = ColumnTarget::headed(header)?;
    // A unit that is none of this quantity says that the column is something else, or needs more than a name;
    // signs are units too.
    let sign = header.contains(['%', '°', '‰']) || stated(header).is_some_and(|u| !u.trim().is_empty());
    if (row_of_units.is_some() || sign) && target.dimension().is_some() {
        return None;
    }
    // Force or frequency, amplitude or amplifier: only a unit tells.
    (!["f", "amp", "ampl"].contains(&plain(header).as_str())).then_some((target, None))
}

#[cfg(test)]
pub(super) mod tests;
