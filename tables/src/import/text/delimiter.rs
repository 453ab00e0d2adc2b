//! What separates the cells of a text.

use super::Marks;
use crate::import::apart;
use crate::import::clock::is_time;
use crate::import::grid::{Cell, Row, exponent, middle};
use crate::import::head::NO_ROWS_HELP;
use instruments::Unit;
use miette::IntoDiagnostic;

/// Delimiters that are tried, in this order where two serve as well.
const DELIMITERS: [(char, &str); 5] =
    [('\t', "tabs"), (';', "semicolons"), ('|', "bars"), (',', "commas"), (' ', "blanks")];
/// Lines that are looked at to find the delimiter.
const LOOKED_AT: usize = 400;

/// Where the cells of each line end.
pub struct Delimiter {
    /// The character between cells; none where every line is one.
    pub mark: Option<char>,
    /// Its name, for people.
    pub name: &'static str,
    /// The usual number of cells of a line.
    usual: usize,
}

impl Delimiter {
    /// Finds what separates the cells of these lines. `remarks` are comment lines without their marks.
    ///
    /// # Errors
    /// No rows that a delimiter parts; commas that may separate columns or decimals.
    pub fn find(data: &[(u64, &str)], remarks: &[(u64, String)], marks: Marks) -> miette::Result<Self> {
        // A decimal mark that is stated does not separate cells.
        let serves = |c: &char| marks.delimiter.map_or(marks.decimal != Some(*c), |d| d == *c);
        // Blanks that are single tabs separate nothing that tabs do not.
        let by_tabs = |line: &str| {
            let cells = line.split('\t').filter(|c| !c.trim().is_empty());
            line.contains('\t') && !line.contains("\t\t") && cells.count() == words(line).len()
        };
        let tabs = marks.delimiter.is_none()
            && 2 * data.iter().filter(|(_, line)| by_tabs(line)).count() > data.len();
        let serves = |c: &char| serves(c) && !(tabs && *c == ' ');
        let tried: Vec<char> = DELIMITERS.iter().map(|(c, _)| *c).filter(serves).collect();
        let tried = if tried.is_empty() { marks.delimiter.into_iter().collect() } else { tried };
        // The largest share of numbers in rows of one width; of equals the first.
        let scored = tried.iter().map(|d| (*d, score(data, remarks, *d)));
        let best = scored.reduce(|a, b| if b.1 > a.1 { b } else { a });
        let best = best.filter(|(_, score)| *score > 0.0).map(|(delimiter, _)| delimiter);
        let by_comma = best == Some(',') && marks.delimiter.is_none();
        let (mark, name) = match best.filter(|_| !by_comma || !one_column(data)) {
            Some(_) if by_comma && commas_are_decimal(data) => miette::bail!(
                help = "say which it is: --decimal , (one column) or --delimiter , (two)",
                "every line is two whole numbers with a comma between: decimal commas, or two columns"
            ),
            Some(mark) => {
                let known = DELIMITERS.iter().find(|(c, _)| *c == mark);
                (Some(mark), known.map_or("a delimiter of its own", |(_, name)| name))
            }
            None if one_column(data) => (None, "lines: one column"),
            None => return Err(no_rows(data, !remarks.is_empty(), &tried)),
        };
        Ok(Delimiter { mark, name, usual: mark.map_or(1, |d| usual_width(data, d).0) })
    }

    /// A line as a row of the source.
    ///
    /// # Errors
    /// Quotation marks that do not close.
    pub fn row(&self, place: u64, line: &str) -> miette::Result<Row> {
        let cells = cells_of(line, self.mark, self.usual)?;
        Ok(Row::new(place, cells.iter().map(|c| Cell::of(c.trim().trim_matches('"'))).collect()))
    }
}

/// The cells of a line that is to have `usual` of them.
fn cells_of(line: &str, delimiter: Option<char>, usual: usize) -> miette::Result<Vec<String>> {
    match delimiter {
        None => Ok(vec![line.to_string()]),
        Some(' ') => Ok(regrouped(line, usual)),
        Some(delimiter) => split(line, delimiter),
    }
}

/// The refusal of a text without numbers: it is empty, nothing is below its header, or no delimiter serves.
fn no_rows(lines: &[(u64, &str)], comments: bool, tried: &[char]) -> miette::Report {
    // Blanks part any words.
    let parts = |line: &str, d: char| d != ' ' && split(line, d).is_ok_and(|cells| cells.len() > 1);
    let other = "give the delimiter (--delimiter ';'), or export the table as CSV";
    let (help, why) = match lines.last() {
        None if comments => (NO_ROWS_HELP, ": the file holds comment lines alone".to_string()),
        None => (NO_ROWS_HELP, ": the file is empty".to_string()),
        Some((place, last)) if tried.iter().any(|d| parts(last, *d)) => {
            (NO_ROWS_HELP, format!(" below the header (line {place} is the last)"))
        }
        Some(_) => (other, ": no delimiter separates the lines into columns".to_string()),
    };
    miette::miette!(help = help, "no rows of numbers{why}")
}

/// The cells of a line; quotes keep a delimiter in a cell.
fn split(line: &str, delimiter: char) -> miette::Result<Vec<String>> {
    if delimiter == ' ' {
        return Ok(words(line));
    }
    if !line.contains('"') {
        return Ok(line.split(delimiter).map(String::from).collect());
    }
    let mut reader = csv::ReaderBuilder::new();
    reader.delimiter(u8::try_from(delimiter).into_diagnostic()?).has_headers(false).flexible(true);
    let mut reader = reader.from_reader(line.as_bytes());
    let mut record = csv::StringRecord::new();
    reader.read_record(&mut record).into_diagnostic()?;
    Ok(record.iter().map(String::from).collect())
}

/// Words at blanks outside of quotes.
fn words(line: &str) -> Vec<String> {
    apart(line, char::is_whitespace).filter(|word| !word.is_empty()).map(String::from).collect()
}

/// The words of a line that is to have `usual` cells: names may hold single blanks, and units in brackets behind one.
fn regrouped(line: &str, usual: usize) -> Vec<String> {
    let plain = words(line);
    if plain.len() <= usual || plain.iter().all(|w| is_number(w)) {
        return plain;
    }
    let apart = line.replace('\t', "  ");
    let apart: Vec<_> = apart.split("  ").map(|w| w.trim().to_string()).filter(|w| !w.is_empty()).collect();
    if apart.len() == usual {
        return apart;
    }
    let mut joined: Vec<String> = Vec::new();
    for word in &plain {
        let open = |w: &String| w.matches(['(', '[']).count() > w.matches([')', ']']).count();
        match joined.last_mut() {
            Some(last) if word.starts_with(['(', '[']) || open(last) => {
                last.push(' ');
                last.push_str(word);
            }
            _ => joined.push(word.clone()),
        }
    }
    if joined.len() == usual { joined } else { plain }
}

/// Whether the lines are one number each, but for a header.
fn one_column(lines: &[(u64, &str)]) -> bool {
    let numbers: Vec<&str> = lines.iter().map(|(_, line)| *line).filter(|line| is_number(line)).collect();
    let before = lines.iter().take_while(|(_, line)| !is_number(line)).last();
    // A comma is a decimal one only where a header of one name, or a point somewhere, says so.
    let bare = |line: &str| !line.contains(',');
    2 * numbers.len() > lines.len()
        && (numbers.iter().any(|line| bare(line)) || before.is_some_and(|(_, line)| bare(line)))
}

/// Whether every line is two whole numbers with a comma between.
fn commas_are_decimal(lines: &[(u64, &str)]) -> bool {
    lines.iter().all(|(_, l)| l.matches(',').count() == 1 && !l.contains('.') && is_number(l))
}

/// Whether a cell is a number with either mark. A comma in a cell that commas separate was in quotes.
pub fn is_number(cell: &str) -> bool {
    Unit::SI.apply(&exponent(&cell.trim().replacen(',', ".", 1))).is_some()
}

/// The usual number of cells of a line, and the lines as cells.
fn usual_width(lines: &[(u64, &str)], delimiter: char) -> (usize, Vec<Vec<String>>) {
    let split = lines.iter().take(LOOKED_AT).filter_map(|(_, line)| split(line, delimiter).ok());
    let split: Vec<Vec<String>> = split.filter(|cells| !cells.is_empty()).collect();
    (middle(split.iter().map(Vec::len)), split)
}

/// How well a delimiter serves: the share of lines with the usual number of cells, at least two, times that of numbers among
/// the cells that hold something. Half of that where the names above the numbers are not as many.
fn score(lines: &[(u64, &str)], remarks: &[(u64, String)], delimiter: char) -> f64 {
    let (usual, split) = usual_width(lines, delimiter);
    let alike: Vec<&Vec<String>> = split.iter().filter(|c| c.len() == usual && usual > 1).collect();
    let cells = alike.iter().flat_map(|c| c.iter()).filter(|c| !c.trim().is_empty());
    let number = |c: &String| is_number(c.trim().trim_end_matches('%')) || is_time(&Cell::of(c));
    let numbers = cells.clone().filter(|c| number(c)).count();
    let count = cells.count().max(1);
    let mostly = |c: &Vec<String>| 2 * c.iter().filter(|c| number(c)).count() >= c.len();
    // A header may name a last column that is empty.
    let wide = |n: usize| n == usual || delimiter == '\t' && n > usual;
    let as_wide = |line: &str| cells_of(line, Some(delimiter), usual).is_ok_and(|c| wide(c.len()));
    let fits = if split.first().is_none_or(mostly) {
        remarks.is_empty() || remarks.iter().any(|(_, line)| as_wide(line))
    } else {
        let begins = |k: &usize| mostly(&split[*k]) && !mostly(&split[*k - 1]);
        let mut headed = (1..split.len()).filter(begins).filter_map(|k| lines.get(k - 1));
        headed.any(|(_, line)| as_wide(line))
    };
    let share = alike.len() as f64 / split.len().max(1) as f64 * numbers as f64 / count as f64;
    if fits { share } else { 0.5 * share }
}
