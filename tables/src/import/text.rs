//! Tables as text: any delimiter, either decimal mark, comments, the usual encodings.

use super::grid::{Cell, Grid, Row};
use super::units::Unit;
use miette::IntoDiagnostic;

/// Delimiters that are tried, in this order where two serve as well.
const DELIMITERS: [(char, &str); 5] =
    [('\t', "tabs"), (';', "semicolons"), ('|', "bars"), (',', "commas"), (' ', "blanks")];
/// Lines that are looked at to find the delimiter.
const LOOKED_AT: usize = 400;

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
    let comment = |line: &str| {
        let line = line.trim_start();
        line.starts_with(['#', '%', '!']) || line.starts_with("//")
    };
    let lines: Vec<(u64, &str)> = (1..).zip(text.lines()).filter(|(_, l)| !l.trim().is_empty()).collect();
    let (said, data): (Vec<_>, Vec<_>) = lines.into_iter().partition(|(_, line)| comment(line));
    let tried: Vec<_> =
        DELIMITERS.iter().filter(|(c, _)| marks.delimiter.is_none_or(|d| d == *c)).map(|(c, _)| *c).collect();
    let tried = if tried.is_empty() { marks.delimiter.into_iter().collect() } else { tried };
    // The largest share of numbers in rows of one width; of equals the first.
    let scored = |d: &char| (*d, score(&data, *d));
    let best = tried.iter().map(scored).reduce(|a, b| if b.1 > a.1 { b } else { a });
    let Some((delimiter, _)) = best.filter(|(_, score)| *score > 0.0) else {
        miette::bail!(
            help = "give the delimiter (--delimiter ';'), or export the table as CSV",
            "no rows of numbers: no delimiter parts the lines into columns"
        );
    };
    let mut rows = Vec::with_capacity(data.len());
    for (place, line) in &data {
        rows.push(Row {
            place: *place,
            cells: split(line, delimiter)?.iter().map(|c| Cell::of(c)).collect(),
        });
    }
    let comma = decimal_comma(&rows, delimiter, marks.decimal)?;
    let spoken = said.iter().rev().find_map(|(_, line)| {
        let names =
            split(line.trim_start().trim_start_matches(['#', '%', '!', '/']).trim(), delimiter).ok()?;
        (names.len() > 1).then(|| names.iter().map(|n| n.trim().to_string()).collect())
    });
    let named =
        DELIMITERS.iter().find(|(c, _)| *c == delimiter).map_or("a delimiter of its own", |(_, name)| name);
    let mark = if comma { ", decimal commas" } else { "" };
    let mut grid = Grid::find(format!("text, {encoding}, parted by {named}{mark}"), rows, comma, spoken);
    if let Some((first, _)) = said.first() {
        grid.notes.push(format!("{} comment lines were passed over, the first in line {first}", said.len()));
    }
    Ok(grid)
}

/// The text and its encoding: by byte-order mark, UTF-8 where it is that, else Latin-1, in which any byte is a letter.
fn decoded(bytes: &[u8]) -> miette::Result<(String, &'static str)> {
    let wide = |rest: &[u8], read: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = rest.chunks_exact(2).map(|p| read([p[0], p[1]])).collect();
        String::from_utf16(&units).into_diagnostic().map(|text| (text, "UTF-16"))
    };
    match bytes {
        [0xff, 0xfe, rest @ ..] => wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => wide(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => Ok((String::from_utf8(rest.to_vec()).into_diagnostic()?, "UTF-8")),
        _ if bytes.contains(&0) => miette::bail!(
            help = "known formats: delimited text, Excel and OpenDocument, Parquet, NumPy (.npy)",
            "this is neither text nor a binary format that is known"
        ),
        _ => Ok(match std::str::from_utf8(bytes) {
            Ok(text) => (text.to_string(), "UTF-8"),
            Err(_) => (bytes.iter().map(|b| char::from(*b)).collect(), "Latin-1"),
        }),
    }
}

/// The cells of a line; quotes keep a delimiter in a cell.
fn split(line: &str, delimiter: char) -> miette::Result<Vec<String>> {
    if delimiter == ' ' {
        return Ok(line.split_whitespace().map(String::from).collect());
    }
    if !line.contains('"') {
        return Ok(line.split(delimiter).map(String::from).collect());
    }
    let delimiter = u8::try_from(delimiter).into_diagnostic()?;
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .from_reader(line.as_bytes());
    let mut record = csv::StringRecord::new();
    reader.read_record(&mut record).into_diagnostic()?;
    Ok(record.iter().map(String::from).collect())
}

/// Whether a cell is a number with either mark (a comma only where it does not part cells).
fn is_number(cell: &str, delimiter: char) -> bool {
    let point = if delimiter == ',' { cell.trim().to_string() } else { cell.trim().replacen(',', ".", 1) };
    Unit::SI.apply(&point).is_some()
}

/// How well a delimiter serves: the share of lines with the usual number of cells, at least two, times that of numbers in them.
fn score(lines: &[(u64, &str)], delimiter: char) -> f64 {
    let split: Vec<Vec<String>> = lines
        .iter()
        .take(LOOKED_AT)
        .filter_map(|(_, l)| split(l, delimiter).ok())
        .filter(|c| !c.is_empty())
        .collect();
    let mut widths: Vec<usize> = split.iter().map(Vec::len).collect();
    widths.sort_unstable();
    let usual = widths.get(widths.len() / 2).copied().unwrap_or(0);
    let alike: Vec<&Vec<String>> = split.iter().filter(|c| c.len() == usual && usual > 1).collect();
    let cells = alike.iter().flat_map(|c| c.iter());
    let numbers = cells.clone().filter(|c| is_number(c, delimiter)).count();
    let count = cells.count().max(1);
    alike.len() as f64 / split.len().max(1) as f64 * numbers as f64 / count as f64
}

/// Whether the decimal mark is a comma: one stands where a point would, and no number has a point.
fn decimal_comma(rows: &[Row], delimiter: char, stated: Option<char>) -> miette::Result<bool> {
    if let Some(mark) = stated {
        return Ok(mark == ',');
    }
    if delimiter == ',' {
        return Ok(false);
    }
    let number_with = |mark: char| {
        rows.iter().find(|row| {
            row.cells.iter().any(|cell| {
                let Cell::Text(text) = cell else { return false };
                text.contains(mark) && Unit::SI.apply(&text.replacen(mark, ".", 1)).is_some()
            })
        })
    };
    match (number_with(','), number_with('.')) {
        (Some(with_comma), Some(with_point)) => miette::bail!(
            help = "say which it is: --decimal , or --decimal .",
            "line {} has a number with a comma, line {} one with a point",
            with_comma.place,
            with_point.place
        ),
        (with_comma, _) => Ok(with_comma.is_some()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(text: &str) -> Grid {
        read(text.as_bytes(), Marks::default()).unwrap_or_else(|e| panic!("{text}: {e:?}"))
    }

    fn numbers(grid: &Grid) -> Vec<Vec<f64>> {
        let number = |c: &Cell| c.digits(grid.comma).and_then(|d| Unit::SI.apply(&d)).unwrap_or(f64::NAN);
        grid.rows.iter().map(|r| r.cells.iter().map(number).collect()).collect()
    }

    #[test]
    fn delimiter_and_decimal_mark_are_found() {
        for text in [
            "a,b\n1.5,2\n-3,4e-1\n",
            "a;b\n1,5;2\n-3;4e-1\n",
            "a\tb\r\n1,5\t2\r\n-3\t0,4\r\n",
            "a b\n1.5   2\n  -3 0.4\n",
            "Operator: A. Nonym\nDate;1.5.2024\n\"a\";\"b\"\n1,5;2\n-3;0,4\n",
            "# measured, with care\n# a b\n1.5 2\n-3 0.4\n",
            "a|b\n[um]|[N]\n1.5|2\n-3|0.4\n",
        ] {
            let found = grid(text);
            assert_eq!(found.header, ["a", "b"], "{text}");
            assert_eq!(numbers(&found), [[1.5, 2.0], [-3.0, 0.4]], "{text}");
        }
        assert_eq!(grid("a|b\n[um]|[N]\n1.5|2\n-3|0.4\n").units, ["[um]", "[N]"]);
        assert_eq!(grid("1 2\n3 4\n").header, ["#1", "#2"]);
    }

    #[test]
    fn encodings_are_told_apart() {
        let latin = b"w [\xb5m];F\n1,5;2\n2;3\n";
        assert_eq!(read(latin, Marks::default()).unwrap().header[0], "w [µm]");
        let mut wide = vec![0xff, 0xfe];
        wide.extend("w [µm]\tF\n1.5\t2\n2\t3\n".encode_utf16().flat_map(u16::to_le_bytes));
        let wide = read(&wide, Marks::default()).unwrap();
        assert_eq!((wide.header[0].as_str(), wide.rows.len()), ("w [µm]", 2));
        assert!(read(b"\x00\x01\x02", Marks::default()).is_err());
    }

    #[test]
    fn both_decimal_marks_are_refused_until_one_is_named() {
        let text = b"a;b\n1,5;2.5\n3;4\n";
        assert!(read(text, Marks::default()).unwrap_err().to_string().contains("line 2"));
        let stated = read(text, Marks { decimal: Some(','), ..Marks::default() }).unwrap();
        assert!(stated.comma);
    }
}
