//! Small CSV tables by column name, with the line of whatever cannot be read or cannot be.

use calibration::certificate::RawData;
use realtime::safety::HARD;
use runs::input;
use std::collections::HashMap;
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
    /// Reads a file and remembers it; see [`Sources::add`].
    pub fn read(&mut self, path: &Path) -> miette::Result<Vec<u8>> {
        self.add(&path.display().to_string(), input::bytes_of(path, MAX_BYTES)?)
    }

    /// Remembers bytes, and returns them without their byte-order mark.
    ///
    /// # Errors
    /// No comma between the columns, a number that no such rig can have, a reading that is there twice.
    pub fn add(&mut self, name: &str, mut bytes: Vec<u8>) -> miette::Result<Vec<u8>> {
        self.names.push(name.into());
        self.bytes.extend_from_slice(&bytes);
        self.rows += bytes.iter().filter(|b| **b == b'\n').count() as u64;
        if bytes.starts_with(b"\xef\xbb\xbf") {
            bytes.drain(..3);
        }
        refuse_other_separators(name, &bytes)?;
        refuse_impossible(name, &bytes)?;
        Ok(bytes)
    }

    /// What the certificate says of them: the hash is over all files one after the other.
    pub fn raw_data(&self) -> RawData {
        RawData::of(&self.names.join(", "), &self.bytes, self.rows)
    }
}

/// Numbers that a column can have, and its unit where the column's name does not end with a known one.
fn possible(column: &str) -> Option<([f64; 2], &'static str)> {
    let both = |end: f64| [-end, end];
    let w = HARD.amplitude_max.metres();
    // A force is that of a calibrating weight too, and a plate moves up to twice as far as it is set to.
    Some(match column {
        "speed_m_s" => ([0.0, HARD.speed_max_m_s], ""),
        "normal_force_n" | "lateral_force_n" | "force_n" | "load_n" | "in_phase_n" | "quadrature_n" => {
            (both(2.0 * HARD.lateral_force_max_n), "")
        }
        "mass_kg" => (both(2.0), "kilograms"),
        "set_point_pp_m" | "amplitude_m" => ([0.0, w], ""),
        "amplitude_pp_m" => ([0.0, 2.0 * w], ""),
        "frequency_hz" => ([1e3, 1e6], ""),
        "position_m" | "displacement_m" => (both(0.5), ""),
        "delay_s" => (both(1.0), ""),
        "tilt_rad" => (both(1.6), "radians"),
        "temperature_c" => ([-40.0, 100.0], ""),
        _ => return None,
    })
}

fn refuse_other_separators(name: &str, bytes: &[u8]) -> miette::Result<()> {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(1 << 16)]);
    let head = text.lines().find(|line| !line.trim_start().starts_with('#')).unwrap_or_default();
    let found = [('\0', "UTF-16"), (';', "semicolons"), ('\t', "tabs")];
    let among = |mark: char| head.contains(mark) && (mark == '\0' || !head.contains(','));
    match found.into_iter().find(|(mark, _)| among(*mark)) {
        None => Ok(()),
        Some((_, found)) => Err(miette::miette!(
            help = "save it as 'CSV UTF-8' with commas between the columns and decimal points; docs/calibration.md shows a table",
            "{name}: found {found}, where commas between the columns are needed"
        )),
    }
}

fn reader(bytes: &[u8]) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes)
}

/// Refuses a number that is not [`possible`], and rows that are there twice: with the time of the reading, or
/// the whole of a short table (a long one is of samples, which may repeat).
fn refuse_impossible(name: &str, bytes: &[u8]) -> miette::Result<()> {
    let mut reader = reader(bytes);
    // What cannot be read is refused by whoever reads it.
    let Ok(headers) = reader.headers().cloned() else { return Ok(()) };
    let timed = headers.iter().any(|column| column == "time_s" || column == "host_s");
    let once = "each reading counts once: remove the copies, for they would narrow the uncertainty";
    let mut seen = HashMap::new();
    let mut rows: Vec<String> = Vec::new();
    for row in reader.into_records().map_while(Result::ok) {
        let line = row.position().map_or(0, csv::Position::line);
        for (column, cell) in headers.iter().zip(&row) {
            let Some(([low, high], words)) = possible(column) else { continue };
            let Some(value) = cell.parse().ok().filter(|v: &f64| v.is_finite()) else { continue };
            if !(low..=high).contains(&value) {
                let unit = if words.is_empty() { input::unit_of(column) } else { words };
                // 'mm/s meant?', without the form of a TOML file.
                let meant = input::unit_meant(column, value, [low, high]);
                let meant = meant.as_deref().and_then(|words| words.split(" Then").next());
                miette::bail!(
                    help = meant.unwrap_or("convert the column, or correct the cell"),
                    "{name}, line {line}: {column} = {cell} cannot be: it is in {unit}, from {low} to {high}"
                );
            }
        }
        let cells = row.iter().collect::<Vec<_>>().join(",");
        if !timed {
            rows.push(cells);
        } else if let Some(first) = seen.insert(cells, line) {
            miette::bail!(help = once, "{name}: line {line} is line {first} again, time included");
        }
    }
    let n = rows.len();
    let copies = |part: &usize| n.is_multiple_of(*part) && (*part..n).all(|i| rows[i] == rows[i - part]);
    let part = (3..=n / 2).take_while(|_| n <= 1000).find(copies);
    if let Some(part) = part.filter(|_| rows.windows(2).any(|two| two[0] != two[1])) {
        miette::bail!(help = once, "{name}: it is its first {part} rows {} times", n / part);
    }
    Ok(())
}

/// The header of a table, which has these columns.
pub fn with_columns(name: &str, bytes: &[u8], needed: &[&str]) -> miette::Result<csv::StringRecord> {
    let headers = reader(bytes).headers().map_err(|e| miette::miette!("{name}: {e}"))?.clone();
    if let Some(lacks) = needed.iter().find(|column| headers.iter().all(|h| h != **column)) {
        let has = headers.iter().collect::<Vec<_>>().join(", ");
        let help = "docs/calibration.md shows a table";
        miette::bail!(help = help, "{name}: column `{lacks}` is missing; the file has: {has}");
    }
    Ok(headers)
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
    let needed: Vec<&str> = names.into_iter().filter(|name| !optional.contains(name)).collect();
    let headers = with_columns(&shown.to_string(), &bytes, &needed)?;
    let at = names.map(|name| headers.iter().position(|h| h == name));
    let mut rows = Vec::new();
    for record in reader(&bytes).records() {
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
