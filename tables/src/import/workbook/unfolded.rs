//! A packed workbook before its reader takes it: how much it unfolds to, which cells of OpenDocument are in
//! per cent, and which rows are hidden.

/// What the reader of a workbook does not say of it.
#[derive(Default)]
pub(super) struct Looked {
    /// Cells of OpenDocument that are in per cent.
    pub(super) percents: Vec<Part>,
    /// Rows that a filter or a person hid, sheet by sheet from the first.
    hidden: Vec<Part>,
    /// Names and files of Excel's sheets, each behind the sheet's id.
    sheets: Vec<(String, String)>,
}

impl Looked {
    /// Whether a row of the sheet, counted from 0, is hidden.
    pub(super) fn hides(&self, sheet: &str) -> impl Fn(usize) -> bool {
        let id = self.sheets.iter().find(|(_, name)| name == sheet).map(|(id, _)| id);
        let file = self.sheets.iter().find(|(of, file)| Some(of) == id && file != sheet);
        let file = file.map_or(sheet, |(_, file)| file);
        let rows: Vec<(usize, usize)> =
            self.hidden.iter().filter(|part| part.sheet == file).map(|part| part.rows).collect();
        move |row| rows.get(rows.partition_point(|r| r.1 <= row)).is_some_and(|r| r.0 <= row)
    }
}

/// Looks through a packed workbook: refuses one that unfolds to far more than it is, before its reader takes
/// memory for that.
pub(super) fn looked_through(bytes: &[u8]) -> miette::Result<Looked> {
    use std::io::Read;
    let mut left = 48 * bytes.len() + (16 << 20);
    let mut found = Looked::default();
    // What is not packed does not unfold.
    let Ok(mut archive) = zip::ZipArchive::new(std::io::Cursor::new(bytes)) else { return Ok(found) };
    let mut buffer = vec![0; 1 << 16];
    for index in 0..archive.len() {
        let Ok(mut unfolded) = archive.by_index(index) else { continue };
        let sheet = unfolded.name().unwrap_or_default().into_owned();
        let mut repeated = Repeats { found, sheet, ..Repeats::default() };
        while let Ok(n) = unfolded.read(&mut buffer) {
            if n == 0 {
                break;
            }
            repeated.look(&buffer[..n]);
            left = left.saturating_sub(n);
            if left == 0 || repeated.cells > crate::import::most_cells(bytes.len()) {
                miette::bail!(
                    help = "save the sheet as CSV",
                    "the workbook unfolds to far more than its {} bytes: it is damaged, or almost all of it is empty",
                    bytes.len()
                );
            }
        }
        found = repeated.found;
    }
    Ok(found)
}

/// Cells of a sheet: from and to, of rows and of columns. A sheet of Excel has the name of its file.
pub(super) struct Part {
    sheet: String,
    rows: (usize, usize),
    columns: (usize, usize),
}

impl Part {
    pub(super) fn holds(&self, sheet: &str, (row, column): (usize, usize)) -> bool {
        let within = |(from, to): (usize, usize), at| from <= at && at < to;
        self.sheet == sheet && within(self.rows, row) && within(self.columns, column)
    }
}

/// Cells that an OpenDocument sheet stands for by repeating few.
#[derive(Default)]
struct Repeats {
    /// What was read and does not end with a whole tag.
    rest: Vec<u8>,
    /// How often the row that is open is repeated, its cells up to the last that holds something, and those
    /// behind.
    row: (usize, usize, usize),
    cells: usize,
    /// The file or the sheet that is open, and its rows so far with those that are open.
    sheet: String,
    rows: usize,
    found: Looked,
}

impl Repeats {
    /// Cells of the open row, which begins at row `from`: the same columns in row after row are one.
    fn put_percents(&mut self, from: usize, columns: (usize, usize)) {
        let goes_on = |p: &&mut Part| p.rows.1 == from && p.columns == columns && p.sheet == self.sheet;
        match self.found.percents.iter_mut().rev().take(64).find(goes_on) {
            Some(above) => above.rows.1 = self.rows,
            None => {
                let (sheet, rows) = (self.sheet.clone(), (from, self.rows));
                self.found.percents.push(Part { sheet, rows, columns });
            }
        }
    }

    fn look(&mut self, bytes: &[u8]) {
        self.rest.extend_from_slice(bytes);
        let whole = self.rest.iter().rposition(|b| *b == b'>').map_or(0, |at| at + 1);
        let text: Vec<u8> = self.rest.drain(..whole).collect();
        // What is one tag of more than this is not a tag.
        if self.rest.len() > 1 << 16 {
            self.rest.clear();
        }
        let text = String::from_utf8_lossy(&text);
        let marks = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&amp;", "&")];
        let plain = |text: &str| marks.iter().fold(text.to_string(), |n, (from, to)| n.replace(from, to));
        let ours =
            |tag: &&str| ["table:", "row ", "sheet ", "Relationship "].iter().any(|t| tag.starts_with(t));
        for tag in text.split('<').filter(ours) {
            let value = |name: &str| {
                let value = tag.split_once(name)?.1.split_once('"')?.1;
                value.split('"').next()
            };
            let times = |name: &str| value(name)?.parse::<usize>().ok();
            if tag.starts_with("table:table ") {
                self.sheet = plain(value("table:name").unwrap_or_default());
                self.rows = 0;
            } else if let Some(row) = tag.strip_prefix("row ").and_then(|_| times(" r=")) {
                if value(" hidden=").is_some_and(|hidden| hidden == "1" || hidden == "true") {
                    let sheet = self.sheet.rsplit('/').next().unwrap_or_default().to_string();
                    let (rows, columns) = ((row.saturating_sub(1), row), (0, usize::MAX));
                    self.found.hidden.push(Part { sheet, rows, columns });
                }
            } else if self.sheet == "xl/workbook.xml" {
                let id = value(":id=").map(plain).zip(value(" name=").map(plain));
                self.found.sheets.extend(id);
            } else if self.sheet == "xl/_rels/workbook.xml.rels" {
                let file = value(" Target=").and_then(|target| target.rsplit('/').next());
                self.found.sheets.extend(value(" Id=").map(plain).zip(file.map(plain)));
            } else if tag.starts_with("table:table-row") {
                let count = times("number-rows-repeated").unwrap_or(1);
                let from = self.rows;
                (self.row, self.rows) = ((count, 0, 0), self.rows.saturating_add(count));
                if value("table:visibility").is_some_and(|v| v == "filter" || v == "collapse") {
                    let (sheet, rows, columns) = (self.sheet.clone(), (from, self.rows), (0, usize::MAX));
                    self.found.hidden.push(Part { sheet, rows, columns });
                }
            } else if tag.starts_with("table:covered-table-cell") || tag.starts_with("table:table-cell") {
                let count = times("number-columns-repeated").unwrap_or(1);
                let (rows, filled, empty) = self.row;
                if value("office:value-type") == Some("percentage") {
                    let from = filled.saturating_add(empty);
                    self.put_percents(self.rows.saturating_sub(rows), (from, from.saturating_add(count)));
                }
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
