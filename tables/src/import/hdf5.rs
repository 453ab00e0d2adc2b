//! HDF5 files, MAT files of version 7.3 among them: numeric datasets of one or two dimensions, in groups too.

use super::arrays::{Array, number, single, table};
use super::grid::{Cell, Grid};
use hdf5_pure::{DType, Dataset, Error, File, Group};

/// Groups within groups that are followed.
const DEPTH: usize = 8;

/// Reads a file.
///
/// # Errors
/// A file that is damaged or of a form that is not read, and what [`table`] says.
pub fn read(bytes: &[u8], sheet: Option<&str>) -> miette::Result<Grid> {
    let matlab = bytes.starts_with(b"MATLAB");
    let wrong = |e: Error| {
        miette::miette!(
            help = "in Python: h5py, then numpy.savetxt; in MATLAB: `save -v7`",
            "the HDF5 file: {e}"
        )
    };
    let file = File::from_bytes(bytes.to_vec()).map_err(wrong)?;
    let (mut arrays, mut notes) = (Vec::new(), Vec::new());
    walk(&file.root(), "", matlab, 0, &mut arrays, &mut notes).map_err(wrong)?;
    table(if matlab { "MAT 7.3" } else { "HDF5" }, arrays, sheet, notes)
}

fn walk(
    group: &Group,
    around: &str,
    matlab: bool,
    depth: usize,
    arrays: &mut Vec<Array>,
    notes: &mut Vec<String>,
) -> Result<(), Error> {
    let inside = |name: &str| if around.is_empty() { name.to_string() } else { format!("{around}/{name}") };
    for name in group.datasets()? {
        let dataset = group.dataset(&name)?;
        match array(&dataset, inside(&name), matlab)? {
            Some(array) => arrays.push(array),
            None => {
                notes.push(format!("{} is no array of one or two dimensions: passed over", inside(&name)))
            }
        }
    }
    // What MATLAB refers to from its cells.
    for name in group.groups()?.iter().filter(|name| !name.starts_with('#') && depth < DEPTH) {
        walk(&group.group(name)?, &inside(name), matlab, depth + 1, arrays, notes)?;
    }
    Ok(())
}

fn array(dataset: &Dataset, name: String, matlab: bool) -> Result<Option<Array>, Error> {
    let shape: Vec<usize> = dataset.shape()?.iter().map(|n| *n as usize).collect();
    let (rows, columns) = match shape[..] {
        [] => (1, 1),
        [rows] => (rows, 1),
        // MATLAB's first dimension is the last one here.
        [columns, rows] if matlab => (rows, columns),
        [rows, columns] => (rows, columns),
        _ => return Ok(None),
    };
    let cells: Vec<Cell> = match dataset.dtype()? {
        DType::F32 => dataset.read_f32()?.into_iter().map(single).collect(),
        DType::F64
        | DType::I8
        | DType::I16
        | DType::I32
        | DType::I64
        | DType::U8
        | DType::U16
        | DType::U32
        | DType::U64 => dataset.read_f64()?.into_iter().map(number).collect(),
        _ => return Ok(None),
    };
    if cells.is_empty() || cells.len() != rows * columns {
        return Ok(None);
    }
    let by_columns = if matlab || columns == 1 {
        cells
    } else {
        (0..columns).flat_map(|c| (0..rows).map(move |r| r * columns + c)).map(|i| cells[i].clone()).collect()
    };
    Ok(Some(Array { name, rows, columns, cells: by_columns }))
}
