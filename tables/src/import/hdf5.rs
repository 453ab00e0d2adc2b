//! HDF5 files, MAT files of version 7.3 among them: numeric datasets of one or two dimensions, in groups too.

use super::arrays::{Array, Contents, table};
use super::grid::{Cell, Grid};
use hdf5_pure::{AttrValue, DType, Dataset, Error, File, Group, VlenStringReadOptions};
use std::collections::HashMap;

/// Groups within groups that are followed.
const DEPTH: usize = 8;

/// Reads a file.
///
/// # Errors
/// A file that is damaged or of a form that is not read, and what [`table`] says.
pub fn read(bytes: &[u8], sheet: Option<&str>, wanted: &[String]) -> miette::Result<Grid> {
    let matlab = bytes.starts_with(b"MATLAB");
    let wrong = |e: Error| {
        miette::miette!(
            help = "in Python: h5py, then numpy.savetxt; in MATLAB: `save -v7`",
            "the HDF5 file: {e}"
        )
    };
    let file = File::from_bytes(bytes.to_vec()).map_err(wrong)?;
    let mut found = Datasets { matlab, most: super::most_cells(bytes.len()), contents: Contents::default() };
    found.walk(&file.root(), "", 0).map_err(wrong)?;
    table(if matlab { "MAT 7.3" } else { "HDF5" }, sheet, wanted, found.contents)
}

struct Datasets {
    matlab: bool,
    /// Cells that may still be read.
    most: usize,
    contents: Contents,
}

fn texts(value: &AttrValue) -> Vec<String> {
    let one = value.as_str().map(|one| vec![one.to_string()]);
    one.or(value.as_strings().map(<[String]>::to_vec)).unwrap_or_default()
}

/// The number of an attribute, also where it is an array of one.
fn value(value: &AttrValue) -> Option<f64> {
    let whole = || value.as_u64().map(|v| v as f64).or_else(|| value.as_i64().map(|v| v as f64));
    let only = || value.to_f64s().filter(|all| all.len() == 1).map(|all| all[0]);
    value.as_f64().or_else(whole).or_else(only)
}

/// One text for each column: a list, or one text with commas, semicolons or blanks.
fn for_columns(about: &HashMap<String, AttrValue>, names: &[&str], columns: usize) -> Vec<String> {
    let found = about.iter().find(|(name, _)| names.iter().any(|n| n.eq_ignore_ascii_case(name)));
    let all = found.map(|(_, value)| texts(value)).unwrap_or_default();
    if all.len() == columns {
        return all.iter().map(|t| t.trim().to_string()).collect();
    }
    let [one] = &all[..] else { return Vec::new() };
    let split = |mark: char| one.split(mark).map(|t| t.trim().to_string()).collect::<Vec<_>>();
    [',', ';', '|', ' '].into_iter().map(split).find(|all| all.len() == columns).unwrap_or_default()
}

impl Datasets {
    fn walk(&mut self, group: &Group, around: &str, depth: usize) -> Result<(), Error> {
        let inside =
            |name: &str| if around.is_empty() { name.to_string() } else { format!("{around}/{name}") };
        for name in group.datasets()? {
            let dataset = group.dataset(&name)?;
            match self.array(&dataset, inside(&name)) {
                Ok(None) => {}
                Ok(Some(why)) => self.contents.notes.push(why),
                // One that cannot be read costs no more than itself.
                Err(error) => self.contents.notes.push(format!("{} was passed over: {error}", inside(&name))),
            }
        }
        // What MATLAB refers to from its cells.
        for name in group.groups()?.iter().filter(|name| !name.starts_with('#') && depth < DEPTH) {
            self.walk(&group.group(name)?, &inside(name), depth + 1)?;
        }
        Ok(())
    }

    /// Takes an array; otherwise what it is.
    fn array(&mut self, dataset: &Dataset, name: String) -> Result<Option<String>, Error> {
        let about = dataset.attrs().unwrap_or_default();
        let class = about.get("MATLAB_class").map(texts).unwrap_or_default();
        let class = class.first().map_or("", String::as_str);
        let decoded = about.contains_key("MATLAB_object_decode");
        let numeric = ["", "double", "single", "logical"].contains(&class) || class.contains("int");
        if self.matlab && (decoded || !numeric) {
            let size = dataset.shape()?.iter().rev().map(ToString::to_string).collect::<Vec<_>>().join(" x ");
            let size = if decoded { String::new() } else { size };
            return Ok(Some(match class {
                "char" => format!("{name} is text: passed over"),
                kind => super::mat::unread(&name, kind, &size),
            }));
        }
        let shape: Vec<usize> = dataset.shape()?.iter().map(|n| *n as usize).collect();
        let (rows, columns) = match shape[..] {
            [] => (1, 1),
            [rows] => (rows, 1),
            // MATLAB's first dimension is the last one here.
            [columns, rows] if self.matlab => (rows, columns),
            [rows, columns] => (rows, columns),
            _ => return Ok(Some(format!("{name} has {} dimensions: passed over", shape.len()))),
        };
        let Some(count) = rows.checked_mul(columns).filter(|n| *n <= self.most) else {
            return Ok(Some(format!(
                "{name} ({rows} x {columns}) says more than the file can hold: passed over"
            )));
        };
        let doubles = || Ok::<_, Error>(dataset.read_f64()?.into_iter().map(Cell::number).collect());
        let cells: Vec<Cell> = match dataset.dtype()? {
            DType::F32 => dataset.read_f32()?.into_iter().map(Cell::single).collect(),
            DType::F64 | DType::I8 | DType::I16 | DType::I32 | DType::I64 => doubles()?,
            DType::U8 | DType::U16 | DType::U32 | DType::U64 => doubles()?,
            DType::String if count > 1 => dataset.read_string()?.iter().map(|t| Cell::of(t)).collect(),
            DType::VariableLengthString if count > 1 => {
                let limits = VlenStringReadOptions::new().with_max_elements(count);
                dataset.read_vlen_strings(limits)?.iter().map(|t| Cell::of(t)).collect()
            }
            DType::String | DType::VariableLengthString => return Ok(None),
            DType::Compound(_) => {
                return Ok(Some(format!(
                    "{name} is a compound table, which is not read; in Python: pandas.DataFrame(f['{name}'][:]).to_csv('{name}.csv')"
                )));
            }
            _ => return Ok(Some(format!("{name} is not an array of numbers: passed over"))),
        };
        if cells.is_empty() || cells.len() != count {
            return Ok(Some(format!("{name} is empty: passed over")));
        }
        self.most -= count;
        let mut by_columns = if self.matlab || columns == 1 {
            cells
        } else {
            let column = |c: usize| cells[c..].iter().step_by(columns).cloned();
            (0..columns).flat_map(column).collect()
        };
        scaled(&about, &mut by_columns);
        let units = for_columns(&about, &["units", "unit"], columns);
        let names = ["columns", "column_names", "names", "header", "labels", "channels", "fields"];
        let names = if columns > 1 { for_columns(&about, &names, columns) } else { Vec::new() };
        self.contents.arrays.push(Array { name, rows, columns, cells: by_columns, names, units });
        Ok(None)
    }
}

/// What the conventions of netCDF say of numbers: which one stands for nothing, and how packed ones are unpacked.
fn scaled(about: &HashMap<String, AttrValue>, cells: &mut [Cell]) {
    let of = |name: &str| about.get(name).and_then(value);
    let nothing: Vec<f64> = ["_FillValue", "missing_value"].into_iter().filter_map(of).collect();
    let (factor, offset) = (of("scale_factor"), of("add_offset"));
    if nothing.is_empty() && factor.or(offset).is_none() {
        return;
    }
    for cell in cells {
        let Some(raw) = cell.digits(false).and_then(|d| d.parse::<f64>().ok()) else { continue };
        if nothing.contains(&raw) {
            *cell = Cell::Empty;
        } else if factor.or(offset).is_some() {
            *cell = Cell::Number(raw * factor.unwrap_or(1.0) + offset.unwrap_or(0.0));
        }
    }
}
