//! Tables as text: any delimiter, either decimal mark, comments, the usual encodings.

use super::grid::{Grid, Row};
use super::head::Source;
use delimiter::Delimiter;
use encoding_rs::{Encoding, UTF_8, UTF_16LE};
use std::borrow::Cow;

mod decimal;
mod delimiter;

/// How a text is to be read, where it is not to be found out.
#[derive(Clone, Copy, Debug, Default)]
pub struct Marks {
    /// The delimiter.
    pub delimiter: Option<char>,
    /// The decimal mark.
    pub decimal: Option<char>,
}

/// Reads a text.
///
/// # Errors
/// No text, no rows that a delimiter parts, both decimal marks at once.
pub fn read(bytes: &[u8], marks: Marks) -> miette::Result<Grid> {
    let (text, encoding) = decoded(bytes)?;
    // The typographic minus.
    let text = text.replace('\u{2212}', "-");
    let comment = |line: &str| line.starts_with(['#', '%', '!']) || line.starts_with("//");
    let joined = whole_lines(&text);
    let lines =
        joined.iter().map(|(place, line)| (*place, &**line)).filter(|(_, line)| !line.trim().is_empty());
    let (heads, data): (Vec<_>, Vec<_>) = lines.partition(|(_, line)| comment(line.trim_start()));
    let bare = |line: &str| line.trim_start().trim_start_matches(['#', '%', '!', '/']).trim().to_string();
    let remarks: Vec<(u64, String)> = heads.iter().map(|(place, line)| (*place, bare(line))).collect();
    let delimiter = Delimiter::find(&data, &remarks, marks)?;
    let rows = data.iter().map(|(place, line)| delimiter.row(*place, line));
    let mut rows = rows.collect::<miette::Result<Vec<Row>>>()?;
    decimal::ungroup(&mut rows, marks.decimal);
    let comments = remarks.iter().filter_map(|(place, line)| delimiter.row(*place, line).ok()).collect();
    let comma = decimal::decimal_comma(&rows, marks.decimal)?;
    let mark = if comma { ", decimal commas" } else { "" };
    let format = format!("text, {encoding}, separated by {}{mark}", delimiter.name);
    let source = Source { format, comma, comments, places: false, blanks: delimiter.mark == Some(' ') };
    let mut grid = source.find(rows);
    if let Some((first, _)) = heads.first() {
        grid.notes.push(format!("{} comment lines were passed over, the first in line {first}", heads.len()));
    }
    Ok(grid)
}

/// The lines with their numbers; a line break in quotes, as of a name in a cell, is a blank.
fn whole_lines(text: &str) -> Vec<(u64, Cow<'_, str>)> {
    let odd = |line: &str| line.matches('"').count() % 2 == 1;
    let (mut lines, mut all) = ((1..).zip(text.lines()), Vec::new());
    while let Some((place, line)) = lines.next() {
        let end = if odd(line) { lines.clone().take(4).position(|(_, line)| odd(line)) } else { None };
        let more = lines.by_ref().take(end.map_or(0, |last| last + 1));
        let whole = more.fold(Cow::from(line), |all, (_, line)| format!("{all} {line}").into());
        all.push((place, whole));
    }
    all
}

/// The text and its encoding: by byte-order mark, UTF-8 where it is that, else Latin-1, in which any byte is a letter.
fn decoded(bytes: &[u8]) -> miette::Result<(String, &'static str)> {
    let unmarked = if matches!(bytes, [1..=255, 0, 1..=255, 0, ..]) { UTF_16LE } else { UTF_8 };
    let (encoding, mark) = Encoding::for_bom(bytes).unwrap_or((unmarked, 0));
    match encoding.decode_without_bom_handling_and_without_replacement(&bytes[mark..]) {
        Some(text) if encoding != UTF_8 => Ok((text.into_owned(), "UTF-16")),
        None if mark > 0 || encoding != UTF_8 => miette::bail!("its {} is damaged", encoding.name()),
        _ if bytes.contains(&0) => miette::bail!(
            help = "known formats: delimited text, Excel, OpenDocument, Parquet, Arrow, NumPy (.npy), MAT (5 and 7.3), HDF5; export others as CSV",
            "this is neither text nor a binary format that is known"
        ),
        Some(text) => Ok((text.into_owned(), "UTF-8")),
        None => Ok((bytes.iter().map(|b| char::from(*b)).collect(), "Latin-1")),
    }
}

#[cfg(test)]
mod tests;
