//! The decimal mark of a text, and marks that may separate thousands.

use super::delimiter::is_number;
use crate::import::grid::{Cell, Row};
use instruments::Unit;

/// Takes marks between thousands out of numbers: those that are no decimal mark anywhere, and the other one
/// of point and comma where the decimal mark is stated.
pub fn ungroup(rows: &mut [Row], decimal: Option<char>) {
    let other = decimal.map(|mark| if mark == ',' { '.' } else { ',' });
    let marks =
        ['\'', '’', '\u{a0}', '\u{202f}'].into_iter().chain(other).filter(|mark| decimal != Some(*mark));
    let marks: Vec<char> = marks.collect();
    let bare = |text: &str| {
        let mark = *marks.iter().find(|mark| text.contains(**mark))?;
        let (whole, behind) =
            text.split_at(text.find(|c| ",.".contains(c) && c != mark).unwrap_or(text.len()));
        let grouped = grouped(whole, mark) && !behind.contains(mark);
        Some(text.replace(mark, "")).filter(|bare| grouped && is_number(bare))
    };
    for cell in rows.iter_mut().flat_map(|row| &mut row.cells) {
        if let Cell::Text(text) = cell
            && let Some(bare) = bare(text)
        {
            *text = bare;
        }
    }
}

/// Whether the mark may separate thousands: three digits behind each, and one to three before them without a
/// zero at the beginning.
fn grouped(number: &str, mark: char) -> bool {
    let mut groups = number.trim_start_matches(['-', '+']).split(mark);
    let head = groups.next().is_some_and(|head| (1..=3).contains(&head.len()) && !head.starts_with('0'));
    head && groups.all(|group| group.len() == 3 && group.bytes().all(|b| b.is_ascii_digit()))
}

/// Whether the decimal mark is a comma: one stands where a point would, and no number has a point.
pub fn decimal_comma(rows: &[Row], stated: Option<char>) -> miette::Result<bool> {
    if let Some(mark) = stated {
        return Ok(mark == ',');
    }
    let number_with = |mark: char| {
        rows.iter().find(|row| {
            row.cells.iter().any(|cell| {
                let Cell::Text(text) = cell else { return false };
                text.contains(mark) && Unit::SI.apply(&text.replacen(mark, ".", 1)).is_some()
            })
        })
    };
    let (with_comma, with_point) = (number_with(','), number_with('.'));
    if let (Some(with_comma), Some(with_point)) = (with_comma, with_point) {
        miette::bail!(
            help = "say which it is: --decimal , or --decimal .",
            "line {} has a number with a comma, line {} one with a point",
            with_comma.place,
            with_point.place
        );
    }
    refuse_thousands(rows, if with_comma.is_some() { ',' } else { '.' })?;
    Ok(with_comma.is_some())
}

/// Refuses a mark that separates thousands as well as decimals: in one column every number with it has three
/// digits behind it, the others are whole, and nearer to the thousands.
fn refuse_thousands(rows: &[Row], mark: char) -> miette::Result<()> {
    let wide = rows.iter().map(|r| r.cells.len()).max().unwrap_or(0);
    for column in 0..wide {
        // What stands above the table is not of its columns.
        let broad = rows.iter().filter(|r| 2 * r.filled() >= wide);
        let texts = broad.filter_map(|r| match r.cells.get(column)? {
            Cell::Text(text) if is_number(text) => Some((r.place, text.as_str())),
            _ => None,
        });
        let (marked, whole): (Vec<_>, Vec<_>) = texts.partition(|(_, text)| text.contains(mark));
        let size = |text: &str| Unit::SI.apply(&text.replace(mark, ".")).map_or(0.0, f64::abs);
        let largest = whole.iter().map(|(_, t)| size(t)).fold(0.0, f64::max);
        let smallest = marked.iter().map(|(_, t)| size(t)).fold(f64::INFINITY, f64::min);
        let Some((line, first)) = marked.first() else { continue };
        let all = marked.iter().all(|(_, t)| grouped(t, mark));
        // As decimals they are further from the whole numbers than as thousands.
        if all && largest < 1000.0 && largest * largest > 1000.0 * smallest * smallest {
            miette::bail!(
                help = format!(
                    "say that it is a decimal mark (--decimal {mark}), or export the table without thousands separators"
                ),
                "line {line}: '{first}' is in one column with whole numbers up to {largest}: decimals, or a separator of thousands"
            );
        }
    }
    Ok(())
}
