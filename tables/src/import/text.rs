//! Tables as text: any delimiter, either decimal mark, comments, the usual encodings.

use super::clock::is_time;
use super::grid::{Cell, Grid, Row};
use super::head::{NO_ROWS_HELP, Source};
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
    // The typographic minus.
    let text = text.replace('\u{2212}', "-");
    let comment = |line: &str| {
        let line = line.trim_start();
        line.starts_with(['#', '%', '!']) || line.starts_with("//")
    };
    let lines: Vec<(u64, &str)> = (1..).zip(text.lines()).filter(|(_, l)| !l.trim().is_empty()).collect();
    let (heads, data): (Vec<_>, Vec<_>) = lines.into_iter().partition(|(_, line)| comment(line));
    // A decimal mark that is stated does not separate cells.
    let serves = |c: char| marks.delimiter.map_or(marks.decimal != Some(c), |d| d == c);
    let tried: Vec<_> = DELIMITERS.iter().filter(|(c, _)| serves(*c)).map(|(c, _)| *c).collect();
    let tried = if tried.is_empty() { marks.delimiter.into_iter().collect() } else { tried };
    let bare = |line: &str| line.trim_start().trim_start_matches(['#', '%', '!', '/']).trim().to_string();
    let remarks: Vec<(u64, String)> = heads.iter().map(|(place, line)| (*place, bare(line))).collect();
    // The largest share of numbers in rows of one width; of equals the first.
    let scored = |d: &char| (*d, score(&data, &remarks, *d));
    let best = tried.iter().map(scored).reduce(|a, b| if b.1 > a.1 { b } else { a });
    let best = best.filter(|(_, score)| *score > 0.0).map(|(delimiter, _)| delimiter);
    let (delimiter, named) =
        match best.filter(|d| *d != ',' || marks.delimiter.is_some() || !one_column(&data)) {
            Some(',') if marks.delimiter.is_none() && commas_are_decimal(&data) => miette::bail!(
                help = "say which it is: --decimal , (one column) or --delimiter , (two)",
                "every line is two whole numbers with a comma between: decimal commas, or two columns"
            ),
            Some(delimiter) => {
                let known = DELIMITERS.iter().find(|(c, _)| *c == delimiter);
                (Some(delimiter), known.map_or("a delimiter of its own", |(_, name)| name))
            }
            None if one_column(&data) => (None, "lines: one column"),
            None => return Err(no_rows(&data, !heads.is_empty(), &tried)),
        };
    let cells = |line: &str, usual: usize| match delimiter {
        None => Ok(vec![line.to_string()]),
        Some(' ') => Ok(regrouped(line, usual)),
        Some(delimiter) => split(line, delimiter),
    };
    let usual = delimiter.map_or(1, |d| usual_width(&data, d).0);
    let row = |place: u64, line: &str| {
        let cells = cells(line, usual)?.iter().map(|c| Cell::of(c.trim().trim_matches('"'))).collect();
        miette::Result::Ok(Row::new(place, cells))
    };
    let rows = data.iter().map(|(place, line)| row(*place, line)).collect::<miette::Result<Vec<_>>>()?;
    let comments = remarks.iter().filter_map(|(place, line)| row(*place, line).ok()).collect();
    let comma = decimal_comma(&rows, marks.decimal)?;
    let mark = if comma { ", decimal commas" } else { "" };
    let format = format!("text, {encoding}, separated by {named}{mark}");
    let source = Source { format, comma, comments, places: false, blanks: delimiter == Some(' ') };
    let mut grid = source.find(rows);
    if let Some((first, _)) = heads.first() {
        grid.notes.push(format!("{} comment lines were passed over, the first in line {first}", heads.len()));
    }
    Ok(grid)
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
        return Ok(words(line));
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

/// Words at blanks outside of quotes.
fn words(line: &str) -> Vec<String> {
    let (mut all, mut now, mut quoted) = (Vec::new(), String::new(), false);
    for c in line.chars() {
        quoted ^= c == '"';
        if c.is_whitespace() && !quoted {
            all.extend(Some(std::mem::take(&mut now)).filter(|w| !w.is_empty()));
        } else {
            now.push(c);
        }
    }
    all.extend(Some(now).filter(|w| !w.is_empty()));
    all
}

/// The words of a line that is to have `usual` cells: names may hold single blanks, and units in brackets behind one.
fn regrouped(line: &str, usual: usize) -> Vec<String> {
    let plain = words(line);
    if plain.len() <= usual || plain.iter().all(|w| is_number(w)) {
        return plain;
    }
    let apart = line.replace('\t', "  ");
    let apart: Vec<String> =
        apart.split("  ").map(|w| w.trim().to_string()).filter(|w| !w.is_empty()).collect();
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
    let single = |line: &str| is_number(line);
    let numbers = lines.iter().filter(|(_, l)| single(l)).count();
    let before = lines.iter().take_while(|(_, l)| !single(l)).last();
    // Of a comma it is a decimal one only where a header of one name, or a point somewhere, says so.
    let comma = lines.iter().any(|(_, l)| single(l) && l.contains(','));
    numbers > 0
        && 2 * numbers > lines.len()
        && (!comma
            || before.is_some_and(|(_, l)| !l.contains(','))
            || lines.iter().any(|(_, l)| single(l) && !l.contains(',')))
}

/// Whether every line is two whole numbers with a comma between.
fn commas_are_decimal(lines: &[(u64, &str)]) -> bool {
    lines.iter().all(|(_, l)| l.matches(',').count() == 1 && !l.contains('.') && is_number(l))
}

/// Whether a cell is a number with either mark. A comma in a cell that commas separate was in quotes.
fn is_number(cell: &str) -> bool {
    Unit::SI.apply(&cell.trim().replacen(',', ".", 1)).is_some()
}

/// The usual number of cells of a line, and the lines as cells.
fn usual_width(lines: &[(u64, &str)], delimiter: char) -> (usize, Vec<Vec<String>>) {
    let split: Vec<Vec<String>> = lines
        .iter()
        .take(LOOKED_AT)
        .filter_map(|(_, l)| split(l, delimiter).ok())
        .filter(|c| !c.is_empty())
        .collect();
    let mut widths: Vec<usize> = split.iter().map(Vec::len).collect();
    widths.sort_unstable();
    (widths.get(widths.len() / 2).copied().unwrap_or(0), split)
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
    let first = split.iter().position(mostly).unwrap_or(0);
    let as_wide = |line: &str| match delimiter {
        ' ' => regrouped(line, usual).len() == usual,
        _ => self::split(line, delimiter).is_ok_and(|c| c.len() == usual),
    };
    let fits = match lines.get(first.wrapping_sub(1)) {
        Some((_, line)) => as_wide(line),
        None => remarks.is_empty() || remarks.iter().any(|(_, line)| as_wide(line)),
    };
    let share = alike.len() as f64 / split.len().max(1) as f64 * numbers as f64 / count as f64;
    if fits { share } else { 0.5 * share }
}

/// Whether the decimal mark is a comma: one stands where a point would, and no number has a point.
fn decimal_comma(rows: &[Row], stated: Option<char>) -> miette::Result<bool> {
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
    match (number_with(','), number_with('.')) {
        (Some(with_comma), Some(with_point)) => miette::bail!(
            help = "say which it is: --decimal , or --decimal .",
            "line {} has a number with a comma, line {} one with a point",
            with_comma.place,
            with_point.place
        ),
        (with_comma, with_point) => {
            let mark = if with_comma.is_some() { ',' } else { '.' };
            if with_comma.or(with_point).is_some() {
                refuse_thousands(rows, mark)?;
            }
            Ok(with_comma.is_some())
        }
    }
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
        let grouped = |text: &str| {
            text.split_once(mark).is_some_and(|(head, tail)| {
                let head = head.trim_start_matches(['-', '+']);
                (1..=3).contains(&head.len())
                    && !head.starts_with('0')
                    && tail.len() == 3
                    && tail.bytes().all(|b| b.is_ascii_digit())
            })
        };
        let size = |text: &str| Unit::SI.apply(&text.replace(mark, ".")).map_or(0.0, f64::abs);
        let largest = whole.iter().map(|(_, t)| size(t)).fold(0.0, f64::max);
        let smallest = marked.iter().map(|(_, t)| size(t)).fold(f64::INFINITY, f64::min);
        let Some((first, rest)) = marked.split_first() else { continue };
        let all = grouped(first.1) && rest.iter().all(|(_, t)| grouped(t));
        // As decimals they are further from the whole numbers than as thousands.
        if all && largest < 1000.0 && largest * largest > 1000.0 * smallest * smallest {
            miette::bail!(
                help = format!(
                    "say that it is a decimal mark (--decimal {mark}), or export the table without thousands separators"
                ),
                "line {}: '{}' is in one column with whole numbers up to {largest}: decimals, or a separator of thousands",
                first.0,
                first.1
            );
        }
    }
    Ok(())
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

    #[test]
    fn a_mark_that_may_part_thousands_is_refused() {
        for (text, mark) in [
            ("t;F\n1;500\n2;750\n3;1.000\n4;1.250\n", '.'),
            ("t;F\n1;500\n2;750\n3;1,000\n4;1,250\n", ','),
            ("t,F\n1,500\n2,750\n3,1.000\n4,1.250\n", '.'),
            ("t,F\n1,500\n2,750\n3,\"1,000\"\n4,\"1,250\"\n", ','),
        ] {
            let refused = read(text.as_bytes(), Marks::default()).unwrap_err();
            assert!(refused.to_string().starts_with("line 4: '1"), "{text}: {refused}");
            let stated = Marks { decimal: Some(mark), ..Marks::default() };
            assert!(mark == ',' && text.contains('"') || read(text.as_bytes(), stated).is_ok(), "{text}");
        }
        for text in
            ["t;F\n1;500\n2;0.750\n", "t;F\n1;2\n2;1.125\n", "t;F\n1;500\n2;1.25\n", "t;F\n1;1500\n2;1.250\n"]
        {
            assert!(read(text.as_bytes(), Marks::default()).is_ok(), "{text}");
        }
    }

    #[test]
    fn quoted_decimal_commas_are_read_beside_commas() {
        for text in ["a,b\n\"1,5\",2\n-3,\"0,4\"\n", "\"a\",\"b\"\n\"1,5\",\"2,0\"\n\"-3,0\",\"0,4\"\n"] {
            assert_eq!(numbers(&grid(text)), [[1.5, 2.0], [-3.0, 0.4]], "{text}");
        }
    }
}
