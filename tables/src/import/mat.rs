//! MAT files of version 5 (the form that MATLAB writes with `-v7` and `-v6`, and scipy.io.savemat): numeric
//! arrays, also within structures. 'MAT-File Format', The MathWorks, chapter 1. Version 7.3 is HDF5.

use super::arrays::{Array, Contents, table};
use super::grid::{Cell, Grid};
use flate2::read::ZlibDecoder;
use std::io::Read;

/// Structures within structures that are followed.
const DEPTH: usize = 4;

/// Numbers of the format: types of data, classes of arrays.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
const STRUCTURE: u8 = 2;
const CHARACTERS: u8 = 4;
const OPAQUE: u8 = 17;
const COMPLEX: u8 = 0x08;

/// Reads a file.
///
/// # Errors
/// A file that is cut or is none, and what [`table`] says.
pub fn read(bytes: &[u8], sheet: Option<&str>, wanted: &[String]) -> miette::Result<Grid> {
    let cut =
        || miette::miette!(help = "save it again with `save -v7`", "the MAT file is cut short or damaged");
    let big = match bytes.get(126..128) {
        Some(b"IM") => false,
        Some(b"MI") => true,
        _ => return Err(cut()),
    };
    let mut found = Contents::default();
    // What all compressed arrays together may unfold to: a number has eight bytes at most.
    let mut most = 8 * super::most_cells(bytes.len());
    let mut rest = &bytes[128..];
    while rest.len() >= 8 {
        let element = Element::next(&mut rest, big).ok_or_else(cut)?;
        let mut unfolded = Vec::new();
        if element.kind == COMPRESSED {
            let read = ZlibDecoder::new(element.data).take(most as u64).read_to_end(&mut unfolded);
            read.map_err(|_| cut())?;
            most -= unfolded.len();
            if most == 0 {
                return Err(super::too_many("the MAT file", unfolded.len() / 8, bytes.len()));
            }
        }
        let mut inside = &unfolded[..];
        let element =
            if unfolded.is_empty() { element } else { Element::next(&mut inside, big).ok_or_else(cut)? };
        if element.kind == MATRIX {
            matrix(element.data, big, "", 0, &mut found).ok_or_else(cut)?;
            let cells: usize = found.arrays.iter().map(|a| a.cells.len()).sum();
            if cells > super::most_cells(bytes.len()) {
                return Err(super::too_many("the MAT file", cells, bytes.len()));
            }
        }
    }
    table("MAT", sheet, wanted, found)
}

/// A piece of data with its type.
struct Element<'a> {
    kind: u32,
    data: &'a [u8],
}

fn word(bytes: &[u8], big: bool) -> Option<u32> {
    let four: [u8; 4] = bytes.get(..4)?.try_into().ok()?;
    Some(if big { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) })
}

impl<'a> Element<'a> {
    /// Takes the next element off.
    fn next(rest: &mut &'a [u8], big: bool) -> Option<Self> {
        let first = word(rest, big)?;
        // Up to four bytes stand within the tag.
        if first >> 16 != 0 {
            let data = rest.get(4..)?.get(..(first >> 16) as usize).filter(|d| d.len() <= 4)?;
            *rest = rest.get(8..)?;
            return Some(Element { kind: first & 0xffff, data });
        }
        let length = word(rest.get(4..)?, big)? as usize;
        let data = rest.get(8..)?.get(..length)?;
        // Everything but what is compressed fills up to eight bytes; the last of a file may not.
        let filled = if first == COMPRESSED { length } else { length.div_ceil(8) * 8 };
        *rest = rest.get(8 + filled..).unwrap_or_default();
        Some(Element { kind: first, data })
    }

    /// Its codes as text: bytes, UTF-16 or UTF-8 by the type.
    fn codes(&self, big: bool) -> Option<String> {
        match self.kind {
            1 | 2 | 16 => Some(self.text()),
            4 | 17 => {
                let read = if big { u16::from_be_bytes } else { u16::from_le_bytes };
                let codes = self.data.as_chunks().0.iter().map(|bytes| read(*bytes));
                Some(String::from_utf16_lossy(&codes.collect::<Vec<_>>()))
            }
            _ => None,
        }
    }

    fn cells(&self, big: bool) -> Option<Vec<Cell>> {
        macro_rules! cells {
            ($type:ty, $cell:expr) => {{
                let read = if big { <$type>::from_be_bytes } else { <$type>::from_le_bytes };
                self.data.as_chunks().0.iter().map(|bytes| $cell(read(*bytes))).collect()
            }};
        }
        Some(match self.kind {
            1 => cells!(i8, |v| Cell::number(f64::from(v))),
            2 => cells!(u8, |v| Cell::number(f64::from(v))),
            3 => cells!(i16, |v| Cell::number(f64::from(v))),
            4 => cells!(u16, |v| Cell::number(f64::from(v))),
            5 => cells!(i32, |v| Cell::number(f64::from(v))),
            6 => cells!(u32, |v| Cell::number(f64::from(v))),
            7 => cells!(f32, Cell::single),
            9 => cells!(f64, Cell::number),
            12 => cells!(i64, |v| Cell::number(v as f64)),
            13 => cells!(u64, |v| Cell::number(v as f64)),
            _ => return None,
        })
    }

    /// Its bytes as text.
    fn text(&self) -> String {
        String::from_utf8_lossy(self.data).into_owned()
    }
}

/// Takes the arrays out of a matrix; `None` where it is cut.
fn matrix(mut rest: &[u8], big: bool, around: &str, depth: usize, found: &mut Contents) -> Option<()> {
    if rest.is_empty() {
        return Some(());
    }
    let flags = word(Element::next(&mut rest, big)?.data, big)?;
    let (class, marks) = (flags as u8, (flags >> 8) as u8);
    if class == OPAQUE {
        let name = Element::next(&mut rest, big)?.text();
        let kind = Element::next(&mut rest, big).and_then(|_| Element::next(&mut rest, big));
        let kind = kind.map(|e| e.text()).unwrap_or_default();
        found.notes.push(unread(&name, &kind, ""));
        return Some(());
    }
    let sizes = Element::next(&mut rest, big)?;
    let sizes: Vec<_> = sizes.data.chunks_exact(4).map(|c| word(c, big).map_or(0, |n| n as usize)).collect();
    let own = Element::next(&mut rest, big)?.text();
    let name = match (around.is_empty(), own.is_empty()) {
        (true, _) => own,
        (false, true) => around.to_string(),
        (false, false) => format!("{around}.{own}"),
    };
    let count = sizes.iter().try_fold(1usize, |all, n| all.checked_mul(*n))?;
    match class {
        STRUCTURE if count == 1 && depth < DEPTH => {
            let width = word(Element::next(&mut rest, big)?.data, big)? as usize;
            let names = Element::next(&mut rest, big)?.data;
            for field in names.chunks_exact(width.max(1)) {
                let field = String::from_utf8_lossy(field.split(|b| *b == 0).next()?).into_owned();
                let element = Element::next(&mut rest, big)?;
                matrix(element.data, big, &format!("{name}.{field}"), depth + 1, found)?;
            }
        }
        6..=15 if sizes.len() == 2 && marks & COMPLEX == 0 => {
            let cells = Element::next(&mut rest, big)?.cells(big)?;
            if cells.len() != count {
                return None;
            }
            let name = name.trim_start_matches('.').to_string();
            // What objects refer to has no name.
            if count > 0 && !name.is_empty() {
                let (rows, columns) = (sizes[0], sizes[1]);
                found.arrays.push(Array { name, rows, columns, cells, ..Array::default() });
            }
        }
        CHARACTERS => {
            let text = Element::next(&mut rest, big)?;
            let short = count <= 64 && sizes.first() == Some(&1);
            if let (true, Some(cells)) = (short, text.codes(big)) {
                found.texts.insert(name.clone(), cells);
            }
            found.notes.push(format!("{name} is text: passed over"));
        }
        _ => {
            let kind = match class {
                1 => "cell",
                STRUCTURE => "struct",
                3 => "object",
                5 => "sparse",
                6..=15 if marks & COMPLEX != 0 => "complex",
                6..=15 => "array",
                16 => "function_handle",
                _ => "unknown",
            };
            let size = sizes.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ");
            found.notes.push(unread(&name, kind, &size));
        }
    }
    Some(())
}

/// What an array that is not read is, and the line of MATLAB that makes it one that is.
pub fn unread(name: &str, kind: &str, size: &str) -> String {
    let size = if size.is_empty() { String::new() } else { format!(" ({size})") };
    let (what, line) = match kind {
        "cell" => ("a cell array", format!("writematrix({name}{{1}}, '{name}1.csv')")),
        "struct" => ("an array of structures", format!("writetable(struct2table({name}), '{name}.csv')")),
        "table" => ("a table object", format!("writetable({name}, '{name}.csv')")),
        "timetable" => ("a timetable object", format!("writetimetable({name}, '{name}.csv')")),
        "categorical" => ("a categorical array", format!("{name} = double({name})")),
        "string" => ("a string array", format!("{name} = char({name})")),
        "datetime" => ("an array of dates", format!("{name} = posixtime({name})")),
        "duration" => ("an array of durations", format!("{name} = seconds({name})")),
        "sparse" => ("a sparse matrix", format!("{name} = full({name})")),
        "complex" => ("an array of complex numbers", format!("{name} = real({name})")),
        "array" => ("an array of more than two dimensions", format!("{name} = {name}(:,:,1)")),
        _ => ("an object", format!("{name} = double({name})")),
    };
    format!("{name} is {what}{size}, which is not read; in MATLAB: {line}")
}
