//! Foreign tables: every reader of `muprime import` ends with a table or a refusal, whatever the bytes are.

use super::Chance;
use std::path::Path;
use tables::import::guess::guess;
use tables::import::map::Map;
use tables::import::{Marks, Wanted, import, read};

/// All of them, by name, in the order that the coverage-guided target counts them.
pub const ALL: &[(&str, fn(&[u8], &mut Chance))] = &[("texts", texts), ("binaries", binaries)];

fn imported(name: &str, input: &[u8]) {
    let Ok(grid) = read(Path::new(name), input, None, Marks::default(), &[]) else { return };
    assert!(grid.rows.iter().all(|row| row.block <= grid.blocks.len()));
    let mut map = Map { columns: guess(&grid, &Map::default()), ..Map::default() };
    map.set(&["amplitude_pp_m=0,direction=1".into()]).unwrap();
    let wanted = Wanted { map, ..Wanted::default() };
    if let Ok(done) = import(name, input, &grid, &wanted) {
        let passes = models::pass::read_passes(done.table.as_bytes()).unwrap();
        assert!(!passes.is_empty() && passes.iter().all(|p| p.normal_force_n > 0.0 && p.time_s.is_finite()));
    }
}

/// Delimited text.
pub fn texts(input: &[u8], _: &mut Chance) {
    imported("table.txt", input);
}

/// Workbooks, MAT, HDF5, NumPy, Arrow; Parquet is read from a file.
pub fn binaries(input: &[u8], _: &mut Chance) {
    if input.starts_with(b"PAR1") {
        let path = std::env::temp_dir().join(format!("muprime-fuzz-{}.parquet", std::process::id()));
        std::fs::write(&path, input).unwrap();
        imported(path.to_str().unwrap(), input);
        let _ = std::fs::remove_file(path);
    } else {
        imported(if input.starts_with(b"PK") { "book.xlsx" } else { "array.dat" }, input);
    }
}
