//! Workbooks: Excel and OpenDocument. Their cells are taken one by one, so that a sheet costs what is in it, not what it spans.

use super::clock::DAY_S;
use super::grid::{Cell, Grid, Row};
use super::head::Source;
use instruments::Unit;
use miette::IntoDiagnostic;
use std::collections::BTreeMap;

mod unfolded;

use unfolded::{Part, looked_through};

/// A sheet of a workbook: Excel or OpenDocument.
///
/// # Errors
/// A file that is none, a sheet that is not there, several sheets and none named.
pub fn read(bytes: &[u8], sheet: Option<&str>) -> miette::Result<Grid> {
    use calamine::Reader;
    let looked = looked_through(bytes)?;
    let mut book = calamine::open_workbook_auto_from_rs(std::io::Cursor::new(bytes)).into_diagnostic()?;
    let names = book.sheet_names();
    let named = match sheet {
        Some(name) => names.iter().find(|n| *n == name),
        None if names.len() == 1 => names.first(),
        None => {
            let mut rows_of = |name: &str| sheet_rows(&mut book, name, bytes.len(), &looked.percents);
            let mut filled =
                names.iter().filter(|name| rows_of(name).is_ok_and(|(rows, _)| !rows.is_empty()));
            filled.next().filter(|_| filled.next().is_none())
        }
    };
    let Some(name) = named.cloned() else {
        let listed = names.iter().map(|n| format!("'{n}'")).collect::<Vec<_>>().join(", ");
        let (help, why) = match sheet {
            Some(sheet) => ("its sheets", format!("the workbook has no sheet '{sheet}'")),
            None => ("name one with --sheet", "the workbook has several sheets".to_string()),
        };
        miette::bail!(help = format!("{help}: {listed}"), "{why}");
    };
    let (rows, formulas) = sheet_rows(&mut book, &name, bytes.len(), &looked.percents)?;
    // Numbers that were typed as text follow the mark of the country.
    let with_comma = |c: &Cell| {
        matches!(c, Cell::Text(t) if t.contains(',') && !t.contains('.'))
            && c.digits(true).is_some_and(|d| Unit::SI.apply(&d).is_some())
    };
    let comma = rows.iter().any(|r| r.cells.iter().any(with_comma));
    let source =
        Source { format: format!("workbook, sheet '{name}'"), comma, places: true, ..Source::default() };
    let mut grid = source.find(rows);
    let hides = looked.hides(&name);
    let rows = std::mem::take(&mut grid.rows).into_iter();
    let (gone, rows): (Vec<Row>, Vec<Row>) = rows.partition(|row| hides(row.place as usize - 1));
    grid.rows = rows;
    gone.iter().for_each(|row| grid.leave_out(row, "the workbook hides this row".into()));
    if formulas > 0 {
        grid.notes.push(format!(
            "{formulas} cells are formulas without a stored result: open the workbook in a spreadsheet program and save it there"
        ));
    }
    let ratios = matches!(book, calamine::Sheets::Xls(_) | calamine::Sheets::Xlsb(_));
    if ratios && grid.header.iter().chain(&grid.units).any(|text| text.contains('%')) {
        grid.notes.push(
            "which cells are shown in per cent is not read of .xls and .xlsb: 0.4 that is shown as 40 % is 0.4; if a column in % has such \
             cells, save the workbook as .xlsx"
                .into(),
        );
    }
    Ok(grid)
}

/// The seconds of a duration as OpenDocument has it, `PT00H01M02.5S`.
fn duration(text: &str) -> Option<f64> {
    let (hours, rest) = text.strip_prefix("PT")?.split_once('H')?;
    let (minutes, rest) = rest.split_once('M')?;
    let [h, m, s] = [hours, minutes, rest.strip_suffix('S')?].map(|part| part.parse::<f64>().ok());
    Some(h? * 3600.0 + m? * 60.0 + s?)
}

/// The rows of a sheet, from its first column that holds something, and how many cells are formulas without a result.
fn sheet_rows(
    book: &mut calamine::Sheets<std::io::Cursor<&[u8]>>,
    name: &str,
    size: usize,
    percents: &[Part],
) -> miette::Result<(Vec<Row>, usize)> {
    use calamine::{Data, DataRef, Reader, Sheets};
    let number = |v: f64, percent: bool| if percent { Cell::Percent(v) } else { Cell::Number(v) };
    let cell = |data: Data, percent: bool| match data {
        Data::Int(v) => number(v as f64, percent),
        Data::Float(v) => number(v, percent),
        Data::Bool(v) => number(f64::from(u8::from(v)), percent),
        Data::DateTime(v) => Cell::Clock(v.as_f64() * DAY_S),
        Data::DurationIso(text) => duration(&text).map_or_else(|| Cell::of(&text), Cell::Clock),
        Data::String(text) | Data::DateTimeIso(text) => Cell::of(&text),
        Data::Error(error) => Cell::Text(format!("{error}")),
        Data::Empty => Cell::Empty,
    };
    let mut sheet = Sheet { rows: BTreeMap::new(), cells: 0, size };
    let mut formulas = 0;
    match book {
        Sheets::Xlsx(book) => {
            let mut reader = book.worksheet_cells_reader(name).into_diagnostic()?;
            let percent: Vec<bool> = (reader.styles().iter())
                .map(|s| s.number_format.as_ref().is_some_and(|f| f.format_code.contains('%')))
                .collect();
            while let Some((one, style)) = reader.next_cell_with_style_id().into_diagnostic()? {
                let percent = percent.get(style) == Some(&true);
                sheet.put(one.get_position(), cell(Data::from(one.get_value().clone()), percent))?;
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
                sheet.put(one.get_position(), cell(Data::from(one.get_value().clone()), false))?;
            }
        }
        Sheets::Xls(_) | Sheets::Ods(_) => {
            let range = book.worksheet_range(name).into_diagnostic()?;
            let (top, left) = range.start().unwrap_or_default();
            for (row, column, value) in range.used_cells() {
                let place = (top as usize + row, left as usize + column);
                let percent = percents.iter().any(|p| p.holds(name, place));
                sheet.put((place.0 as u32, place.1 as u32), cell(value.clone(), percent))?;
            }
        }
    }
    let blank = |cells: &Vec<Cell>| cells.iter().position(|c| *c != Cell::Empty);
    let left = sheet.rows.values().filter_map(blank).min().unwrap_or(0);
    let row = |(place, mut cells): (u64, Vec<Cell>)| {
        cells.drain(..left.min(cells.len()));
        Row::new(place, cells)
    };
    Ok((sheet.rows.into_iter().map(row).collect(), formulas))
}

/// A sheet while its cells come.
struct Sheet {
    /// By their places, from 1.
    rows: BTreeMap<u64, Vec<Cell>>,
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
        let cells = self.rows.entry(u64::from(row) + 1).or_default();
        let wide = cells.len().max(column as usize + 1);
        self.cells += wide - cells.len();
        if self.cells > super::most_cells(self.size) / 4 {
            return Err(super::too_many("the sheet", self.cells, self.size));
        }
        cells.resize(wide, Cell::Empty);
        cells[column as usize] = cell;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A packed file of stored entries (PKWARE, APPNOTE 4.3).
    fn packed(entries: &[(&str, &str)]) -> Vec<u8> {
        let (mut file, mut directory) = (Vec::new(), Vec::new());
        for (name, text) in entries {
            let mut crc = flate2::Crc::new();
            crc.update(text.as_bytes());
            let (sum, size, start) =
                (crc.sum().to_le_bytes(), (text.len() as u32).to_le_bytes(), file.len() as u32);
            let length = (name.len() as u16).to_le_bytes();
            let about = [&[20, 0, 0, 0, 0, 0, 0, 0, 0, 0][..], &sum, &size, &size, &length, &[0, 0]].concat();
            file.extend([b"PK\x03\x04", &about[..], name.as_bytes(), text.as_bytes()].concat());
            let place = start.to_le_bytes();
            directory.extend([b"PK\x01\x02\x14\x00", &about[..], &[0; 10], &place, name.as_bytes()].concat());
        }
        let (count, at) = ((entries.len() as u16).to_le_bytes(), (file.len() as u32).to_le_bytes());
        let size = (directory.len() as u32).to_le_bytes();
        file.extend(directory);
        file.extend([b"PK\x05\x06", &[0; 4][..], &count, &count, &size, &at, &[0, 0]].concat());
        file
    }

    #[test]
    fn per_cent_cells_of_opendocument_are_the_ratios_that_they_show() {
        let cell = |kind: &str, value: &str| {
            format!(
                "<table:table-cell office:value-type=\"{kind}\" office:value=\"{value}\"><text:p>{value}</text:p></table:table-cell>"
            )
        };
        let name = |text: &str| {
            format!(
                "<table:table-cell office:value-type=\"string\"><text:p>{text}</text:p></table:table-cell>"
            )
        };
        let row = |cells: &[String]| format!("<table:table-row>{}</table:table-row>", cells.concat());
        let time = "<table:table-cell office:value-type=\"time\" office:time-value=\"PT00H01M02.5S\"/>";
        let rows = [
            row(&[name("t (s)"), name("COF (%)")]),
            row(&[cell("float", "1"), cell("percentage", "0.4")]),
            row(&[cell("float", "2"), cell("percentage", "0.5")]),
            row(&[cell("float", "3"), cell("float", "0.6")]),
            row(&[time.into(), cell("float", "0.7")]),
            row(&[cell("float", "4"), cell("float", "9")])
                .replace("row>", "row table:visibility=\"filter\">")
                .replacen("</table:table-row table:visibility=\"filter\">", "</table:table-row>", 1),
        ];
        let content = format!(
            "<?xml version=\"1.0\"?><office:document-content xmlns:office=\"urn:oasis:names:tc:opendocument:xmlns:office:1.0\" \
             xmlns:table=\"urn:oasis:names:tc:opendocument:xmlns:table:1.0\" \
             xmlns:text=\"urn:oasis:names:tc:opendocument:xmlns:text:1.0\"><office:body><office:spreadsheet>\
             <table:table table:name=\"A &amp; B\">{}</table:table></office:spreadsheet></office:body></office:document-content>",
            rows.concat()
        );
        let kind = "application/vnd.oasis.opendocument.spreadsheet";
        let manifest = "<?xml version=\"1.0\"?><manifest:manifest xmlns:manifest=\"urn:oasis:names:tc:opendocument:xmlns:manifest:1.0\"/>";
        let book =
            packed(&[("mimetype", kind), ("content.xml", &content), ("META-INF/manifest.xml", manifest)]);
        let grid = read(&book, None).unwrap();
        let second: Vec<Cell> = grid.rows.iter().map(|r| r.cells[1].clone()).collect();
        assert_eq!(second, [Cell::Percent(0.4), Cell::Percent(0.5), Cell::Number(0.6), Cell::Number(0.7)]);
        assert_eq!(grid.rows[3].cells[0], Cell::Clock(62.5));
        assert_eq!((grid.left_out[0].row, grid.left_out[0].text.as_str()), (6, "4 9"));
    }

    #[test]
    fn rows_that_excel_hides_are_left_out_and_listed() {
        let cells = |k: i32| format!("<c r=\"A{k}\"><v>{k}</v></c><c r=\"B{k}\"><v>0.5</v></c></row>");
        let name = |at: &str, text: &str| format!("<c r=\"{at}\" t=\"inlineStr\"><is><t>{text}</t></is></c>");
        let rows = (2..6).map(|k| match k {
            3 => format!("<row r=\"3\" hidden=\"1\">{}", cells(k)),
            k => format!("<row r=\"{k}\">{}", cells(k)),
        });
        let sheet = |rows: &str| {
            format!(
                "<worksheet xmlns=\"http://schemas.openxmlformats.org/spreadsheetml/2006/main\"><sheetData><row r=\"1\">{}{}</row>{rows}\
                 </sheetData></worksheet>",
                name("A1", "t (s)"),
                name("B1", "COF")
            )
        };
        // The order of the sheets is not that of their files.
        let book = "<workbook xmlns=\"http://schemas.openxmlformats.org/spreadsheetml/2006/main\" \
                    xmlns:r=\"http://schemas.openxmlformats.org/officeDocument/2006/relationships\"><sheets>\
                    <sheet name=\"A &amp; B\" sheetId=\"1\" r:id=\"rId2\"/><sheet name=\"C\" sheetId=\"2\" r:id=\"rId1\"/></sheets></workbook>";
        let kind = "http://schemas.openxmlformats.org/officeDocument/2006/relationships/worksheet";
        let rels = format!(
            "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">\
             <Relationship Id=\"rId1\" Type=\"{kind}\" Target=\"worksheets/sheet1.xml\"/>\
             <Relationship Id=\"rId2\" Type=\"{kind}\" Target=\"/xl/worksheets/sheet2.xml\"/></Relationships>"
        );
        let (hides, shows) = (sheet(&rows.collect::<String>()), sheet(&format!("<row r=\"3\">{}", cells(3))));
        let root = "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\"><Relationship Id=\"rId1\" \
                    Type=\"http://schemas.openxmlformats.org/officeDocument/2006/relationships/officeDocument\" \
                    Target=\"xl/workbook.xml\"/></Relationships>";
        let book = packed(&[
            ("_rels/.rels", root),
            ("xl/workbook.xml", book),
            ("xl/_rels/workbook.xml.rels", &rels),
            ("xl/worksheets/sheet1.xml", &shows),
            ("xl/worksheets/sheet2.xml", &hides),
        ]);
        let read = |sheet: &str| read(&book, Some(sheet)).unwrap();
        let places = |grid: &Grid| grid.rows.iter().map(|r| r.place).collect::<Vec<_>>();
        assert_eq!((places(&read("A & B")), places(&read("C"))), (vec![2, 4, 5], vec![3]));
        assert_eq!(read("A & B").left_out[0].reason, "the workbook hides this row");
    }
}
