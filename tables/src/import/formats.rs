//! The reader of each format, by what a file begins with.

use super::{Grid, Marks, binary, head, text};
use miette::WrapErr;
use std::borrow::Cow;
use std::path::Path;

#[cfg(feature = "excel")]
use super::workbook;
#[cfg(feature = "matlab")]
use super::{hdf5, mat};
#[cfg(not(feature = "matlab"))]
use mat as hdf5;

/// Refuses: built without MAT and HDF5.
#[cfg(not(feature = "matlab"))]
mod mat {
    pub fn read(_: &[u8], _: Option<&str>, _: &[String]) -> miette::Result<super::Grid> {
        Err(crate::built_without("matlab", "take CSV"))
    }
}

/// Refuses: built without workbooks.
#[cfg(not(feature = "excel"))]
mod workbook {
    pub fn read(_: &[u8], _: Option<&str>) -> miette::Result<super::Grid> {
        Err(crate::built_without("excel", "save the sheet as CSV"))
    }
}

/// The bytes of a table that may be Parquet, as CSV: one reader judges both formats.
///
/// # Errors
/// A damaged Parquet table.
pub fn as_csv<'a>(path: &Path, bytes: &'a [u8]) -> miette::Result<Cow<'a, [u8]>> {
    if !is_parquet(bytes) {
        return Ok(bytes.into());
    }
    let grid = unharmed(&format!("{}: ", path.display()), || binary::parquet(path))?;
    grid.csv().map(|csv| csv.into_bytes().into())
}

/// Whether a file is Parquet.
pub fn is_parquet(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PAR1")
}

/// Reads a source of any known format; `wanted` are the columns that will be taken, where they are known.
///
/// # Errors
/// A format that is not read, with the remedy; what its reader says.
pub fn read(
    path: &Path,
    bytes: &[u8],
    sheet: Option<&str>,
    marks: Marks,
    wanted: &[String],
) -> miette::Result<Grid> {
    let shown = path.display();
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let workbook = ["xlsx", "xlsm", "xlsb", "xls", "ods"].contains(&ending.as_str());
    let grid = unharmed("", || {
        if is_parquet(bytes) {
            binary::parquet(path)
        } else if bytes.starts_with(b"ARROW1") {
            binary::arrow(bytes)
        } else if bytes.starts_with(b"\x93NUMPY") {
            binary::npy(bytes)
        } else if bytes.starts_with(b"MATLAB 5.0 MAT-file") {
            mat::read(bytes, sheet, wanted)
        } else if bytes.starts_with(b"\x89HDF\r\n") || bytes.starts_with(b"MATLAB 7.3 MAT-file") {
            hdf5::read(bytes, sheet, wanted)
        } else if workbook && bytes.starts_with(b"PK") || bytes.starts_with(b"\xd0\xcf\x11\xe0") {
            workbook::read(bytes, sheet)
        } else if bytes.trim_ascii_start().starts_with(b"<") {
            miette::bail!(
                help = "open it in a spreadsheet program and save it as .xlsx or CSV",
                "{shown} is HTML or XML"
            )
        } else if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"\x1f\x8b") {
            miette::bail!(help = "unpack it first; of .npz, save one array as .npy", "{shown} is packed")
        } else {
            text::read(bytes, marks)
        }
    });
    let grid = grid.wrap_err_with(|| shown.to_string())?;
    if grid.rows.is_empty() {
        let notes = grid.notes.join("\n");
        miette::bail!(help = head::NO_ROWS_HELP, "{shown}: no rows of numbers\n{notes}");
    }
    Ok(grid)
}

thread_local! {
    /// Whether this thread reads a foreign file.
    static READS: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// Runs a library's reader. Damaged files can drive those of binary formats into a panic, of which nothing is printed: that is a
/// refusal of the file, whose name is `of`.
fn unharmed(of: &str, reads: impl FnOnce() -> miette::Result<Grid>) -> miette::Result<Grid> {
    static QUIET: std::sync::Once = std::sync::Once::new();
    QUIET.call_once(|| {
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !READS.get() {
                usual(panic);
            }
        }));
    });
    READS.set(true);
    let read = std::panic::catch_unwind(std::panic::AssertUnwindSafe(reads));
    READS.set(false);
    let damaged = |_| miette::miette!(help = "export it again, or as CSV", "{of}the file is damaged");
    read.map_err(damaged)?
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Many instruments call their text or HTML `.xls`.
    #[test]
    fn a_workbook_is_known_by_its_content() {
        let read = |text: &str| read(Path::new("a.xls"), text.as_bytes(), None, Marks::default(), &[]);
        assert_eq!(read("a\tb\n1.5\t2\n3\t4\n").unwrap().header, ["a", "b"]);
        let refused = read("\n<html><table><tr><td>1</td></tr></table></html>").unwrap_err();
        let help = format!("{refused:?}");
        assert!(help.contains("save it as .xlsx or CSV"), "{help}");
    }
}
