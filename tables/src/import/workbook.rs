//! Workbooks: Excel and OpenDocument. Their cells are taken one by one, so that a sheet costs what is in it, not what it spans.

use super::grid::{Cell, Grid, Row};
use super::head::Source;
use miette::IntoDiagnostic;

/// Days, as workbooks count time, in s.
const DAY_S: f64 = 86_400.0;

/// A sheet of a workbook: Excel or OpenDocument.
///
/// # Errors
/// A file that is none, a sheet that is not there, several sheets and none named.
pub fn read(bytes: &[u8], sheet: Option<&str>) -> miette::Result<Grid> {
    use calamine::Reader;
    refuse_bombs(bytes)?;
    let mut book = calamine::open_workbook_auto_from_rs(std::io::Cursor::new(bytes)).into_diagnostic()?;
    let names = book.sheet_names();
    let named = match sheet {
        Some(name) => names.iter().find(|n| *n == name),
        None if names.len() == 1 => names.first(),
        None => {
            let mut filled = Vec::new();
            for name in &names {
                if sheet_rows(&mut book, name, bytes.len()).is_ok_and(|(rows, _)| !rows.is_empty()) {
                    filled.push(name);
                }
            }
            if filled.len() == 1 { filled.pop() } else { None }
        }
    };
    let Some(name) = named.cloned() else {
        let listed = names.iter().map(|n| format!("'{n}'")).collect::<Vec<_>>().join(", ");
        match sheet {
            Some(sheet) => {
                miette::bail!(help = format!("its sheets: {listed}"), "the workbook has no sheet '{sheet}'")
            }
            None => miette::bail!(
                help = format!("name one with --sheet: {listed}"),
                "the workbook has several sheets"
            ),
        }
    };
    let (rows, formulas) = sheet_rows(&mut book, &name, bytes.len())?;
    // Numbers that were typed as text follow the mark of the country.
    let text_with_comma = |c: &Cell| matches!(c, Cell::Text(t) if t.contains(',') && !t.contains('.'));
    let comma = rows.iter().any(|r| {
        r.cells.iter().any(|c| {
            text_with_comma(c) && c.digits(true).is_some_and(|d| super::units::Unit::SI.apply(&d).is_some())
        })
    });
    let source =
        Source { format: format!("workbook, sheet '{name}'"), comma, places: true, ..Source::default() };
    let mut grid = source.find(rows);
    if formulas > 0 {
        grid.notes.push(format!(
            "{formulas} cells are formulas without a stored result: open the workbook in a spreadsheet program and save it there"
        ));
    }
    Ok(grid)
}

/// The rows of a sheet, from its first column that holds something, and how many cells are formulas without a result.
fn sheet_rows(
    book: &mut calamine::Sheets<std::io::Cursor<&[u8]>>,
    name: &str,
    size: usize,
) -> miette::Result<(Vec<Row>, usize)> {
    use calamine::{Data, DataRef, Reader, Sheets};
    let cell = |data: Data| match data {
        Data::Int(v) => Cell::Number(v as f64),
        Data::Float(v) => Cell::Number(v),
        Data::Bool(v) => Cell::Number(f64::from(u8::from(v))),
        Data::DateTime(v) => Cell::Clock(v.as_f64() * DAY_S),
        Data::String(text) | Data::DateTimeIso(text) | Data::DurationIso(text) => Cell::of(&text),
        Data::Error(error) => Cell::Text(format!("{error}")),
        Data::Empty => Cell::Empty,
    };
    let mut sheet = Sheet { rows: Vec::new(), cells: 0, size };
    let mut formulas = 0;
    match book {
        Sheets::Xlsx(book) => {
            let mut reader = book.worksheet_cells_reader(name).into_diagnostic()?;
            let percent: Vec<bool> = (reader.styles().iter())
                .map(|s| s.number_format.as_ref().is_some_and(|f| f.format_code.contains('%')))
                .collect();
            while let Some((one, style)) = reader.next_cell_with_style_id().into_diagnostic()? {
                let value = match cell(Data::from(one.get_value().clone())) {
                    Cell::Number(v) if percent.get(style) == Some(&true) => Cell::Percent(v),
                    value => value,
                };
                sheet.put(one.get_position(), value)?;
            }
            drop(reader);
            let mut reader = book.worksheet_cells_reader(name).into_diagnostic()?;
            while let Some(one) = reader.next_cell_with_formula().into_diagnostic()? {
                if let (DataRef::Empty, Some(formula)) = (&one.value, &one.formula) {
                    formulas += 1;
                    sheet.put(one.pos, Cell::Text(format!("={formula}")))?;
                }
            }
        }
        Sheets::Xlsb(book) => {
            let mut reader = book.worksheet_cells_reader(name).into_diagnostic()?;
            while let Some(one) = reader.next_cell().into_diagnostic()? {
                sheet.put(one.get_position(), cell(Data::from(one.get_value().clone())))?;
            }
        }
        Sheets::Xls(_) | Sheets::Ods(_) => {
            let range = book.worksheet_range(name).into_diagnostic()?;
            let (top, left) = range.start().unwrap_or_default();
            for (row, column, value) in range.used_cells() {
                sheet.put((top + row as u32, left + column as u32), cell(value.clone()))?;
            }
        }
    }
    sheet.rows.sort_by_key(|row| row.place);
    let blank = |row: &Row| row.cells.iter().position(|c| *c != Cell::Empty);
    let left = sheet.rows.iter().filter_map(blank).min().unwrap_or(0);
    sheet.rows.iter_mut().for_each(|row| drop(row.cells.drain(..left.min(row.cells.len()))));
    Ok((sheet.rows, formulas))
}

/// A sheet while its cells come.
struct Sheet {
    rows: Vec<Row>,
    cells: usize,
    /// Bytes of the file.
    size: usize,
}

impl Sheet {
    /// Takes a cell where it belongs; refuses cells so far apart that almost all between them are empty.
    fn put(&mut self, (row, column): (u32, u32), cell: Cell) -> miette::Result<()> {
        if cell == Cell::Empty {
            return Ok(());
        }
        let (place, column) = (u64::from(row) + 1, column as usize);
        let at = match self.rows.last() {
            Some(last) if last.place == place => self.rows.len() - 1,
            Some(last) if last.place > place => match self.rows.binary_search_by_key(&place, |r| r.place) {
                Ok(at) => at,
                Err(at) => {
                    self.rows.insert(at, Row::new(place, Vec::new()));
                    at
                }
            },
            _ => {
                self.rows.push(Row::new(place, Vec::new()));
                self.rows.len() - 1
            }
        };
        let cells = &mut self.rows[at].cells;
        self.cells += (column + 1).saturating_sub(cells.len());
        if self.cells > super::most_cells(self.size) / 4 {
            return Err(super::too_many("the sheet", self.cells, self.size));
        }
        if cells.len() <= column {
            cells.resize(column + 1, Cell::Empty);
        }
        cells[column] = cell;
        Ok(())
    }
}

/// Refuses a packed workbook that unfolds to far more than it is, before its reader takes memory for that.
fn refuse_bombs(bytes: &[u8]) -> miette::Result<()> {
    use std::io::Read;
    let number = |at: usize, n: usize| -> Option<usize> {
        Some(bytes.get(at..at + n)?.iter().rev().fold(0, |all, b| all << 8 | usize::from(*b)))
    };
    let mut left = 48 * bytes.len() + (16 << 20);
    // The directory stands at the end (PKWARE, APPNOTE 4.3.12): each entry names where its data begin.
    let from = bytes.len().saturating_sub(65_557);
    let Some(end) = bytes[from..].windows(4).rposition(|w| w == b"PK\x05\x06").map(|at| from + at) else {
        return Ok(());
    };
    let mut at = number(end + 16, 4).unwrap_or(0);
    let mut buffer = vec![0; 1 << 16];
    while bytes.get(at..).is_some_and(|rest| rest.starts_with(b"PK\x01\x02")) {
        let (Some(method), Some(packed), Some(local)) =
            (number(at + 10, 2), number(at + 20, 4), number(at + 42, 4))
        else {
            break;
        };
        let start = local + 30 + number(local + 26, 2).unwrap_or(0) + number(local + 28, 2).unwrap_or(0);
        if method == 8 {
            let data = bytes.get(start..).unwrap_or_default();
            let mut unfolded = flate2::read::DeflateDecoder::new(&data[..packed.min(data.len())]);
            let mut repeated = Repeats::default();
            while let Ok(n) = unfolded.read(&mut buffer) {
                if n == 0 {
                    break;
                }
                repeated.look(&buffer[..n]);
                left = left.saturating_sub(n);
                if left == 0 || repeated.cells > super::most_cells(bytes.len()) {
                    miette::bail!(
                        help = "save the sheet as CSV",
                        "the workbook unfolds to far more than its {} bytes: it is damaged, or almost all of it is empty",
                        bytes.len()
                    );
                }
            }
        }
        let lengths = [28, 30, 32].map(|k| number(at + k, 2).unwrap_or(0));
        at += 46 + lengths.iter().sum::<usize>();
    }
    Ok(())
}

/// Cells that an OpenDocument sheet stands for by repeating few.
#[derive(Default)]
struct Repeats {
    /// What was read and does not end with a whole tag.
    rest: Vec<u8>,
    /// How often the row that is open is repeated, its cells up to the last that holds something, and those behind.
    row: (usize, usize, usize),
    cells: usize,
}

impl Repeats {
    fn look(&mut self, bytes: &[u8]) {
        self.rest.extend_from_slice(bytes);
        let whole = self.rest.iter().rposition(|b| *b == b'>').map_or(0, |at| at + 1);
        let text: Vec<u8> = self.rest.drain(..whole).collect();
        // What is one tag of more than this is not a tag.
        if self.rest.len() > 1 << 16 {
            self.rest.clear();
        }
        let text = String::from_utf8_lossy(&text);
        for tag in text.split('<').filter(|t| t.starts_with("table:table-")) {
            let times = |name: &str| {
                let value = tag.split_once(name)?.1.split_once('"')?.1;
                value.split('"').next()?.parse::<usize>().ok()
            };
            if tag.starts_with("table:table-row") {
                self.row = (times("number-rows-repeated").unwrap_or(1), 0, 0);
            } else if tag.starts_with("table:table-cell") {
                let count = times("number-columns-repeated").unwrap_or(1);
                let (rows, filled, empty) = self.row;
                if tag.contains("office:") {
                    let more = empty.saturating_add(count);
                    self.row = (rows, filled.saturating_add(more), 0);
                    self.cells = self.cells.saturating_add(rows.saturating_mul(more));
                } else {
                    self.row.2 = empty.saturating_add(count);
                }
            }
        }
    }
}
