//! Small CSV tables by column name, with the line of whatever cannot be read.

use calibration::certificate::RawData;
use std::path::Path;

/// Bytes of the data files that one certificate rests on, in order.
#[derive(Default)]
pub struct Sources {
    names: Vec<String>,
    bytes: Vec<u8>,
    rows: u64,
}

/// The largest data file that is read, in bytes.
const MAX_BYTES: u64 = 512 << 20;

impl Sources {
    /// Reads a file and remembers it.
    pub fn read(&mut self, path: &Path) -> miette::Result<Vec<u8>> {
        let shown = path.display();
        let size = std::fs::metadata(path).map_err(|e| miette::miette!("{shown}: {e}"))?.len();
        if size > MAX_BYTES {
            miette::bail!("{shown}: {size} bytes; a data file has at most {MAX_BYTES}");
        }
        let bytes = crate::input::bytes_of(path, crate::input::MAX_TABLE_BYTES)?;
        self.add(&shown.to_string(), &bytes);
        Ok(bytes)
    }

    /// Remembers bytes that came from elsewhere.
    pub fn add(&mut self, name: &str, bytes: &[u8]) {
        self.names.push(name.into());
        self.bytes.extend_from_slice(bytes);
        self.rows += bytes.iter().filter(|b| **b == b'\n').count() as u64;
    }

    /// What the certificate says of them: the hash is over all files one after the other.
    pub fn raw_data(&self) -> RawData {
        RawData::of(&self.names.join(", "), &self.bytes, self.rows)
    }
}

/// Numbers of the named columns, row by row; an optional column that is missing gives NaN.
pub fn columns<const N: usize>(
    sources: &mut Sources,
    path: &Path,
    names: [&str; N],
    optional: &[&str],
) -> miette::Result<Vec<[f64; N]>> {
    let bytes = sources.read(path)?;
    let shown = path.display();
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes.as_slice());
    let headers = reader.headers().map_err(|e| miette::miette!("{shown}: {e}"))?.clone();
    let mut at = [None; N];
    for (slot, name) in at.iter_mut().zip(names) {
        *slot = headers.iter().position(|h| h == name);
        if slot.is_none() && !optional.contains(&name) {
            let has: Vec<&str> = headers.iter().collect();
            miette::bail!("{shown}: column `{name}` is missing; the file has: {}", has.join(", "));
        }
    }
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| miette::miette!("{shown}: {e}"))?;
        let line = record.position().map_or(0, csv::Position::line);
        let mut row = [f64::NAN; N];
        for k in 0..N {
            let Some(column) = at[k] else { continue };
            let cell = record.get(column).unwrap_or("");
            if cell.is_empty() && optional.contains(&names[k]) {
                continue;
            }
            row[k] = cell.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| {
                miette::miette!("{shown}, line {line}: `{cell}` is not a number for {}", names[k])
            })?;
        }
        rows.push(row);
    }
    if rows.is_empty() {
        miette::bail!("{shown}: no rows");
    }
    Ok(rows)
}
