//! Types of columns in binary tables.

use super::*;
use arrow_array::{ArrayRef, DurationNanosecondArray, Int64Array, RecordBatch, TimestampNanosecondArray};
use std::sync::Arc;

#[test]
fn times_of_parquet_have_the_unit_of_their_type() {
    let columns: [(&str, ArrayRef); 3] = [
        ("at", Arc::new(TimestampNanosecondArray::from(vec![1_700_000_000_500_000_000]))),
        ("span", Arc::new(DurationNanosecondArray::from(vec![2_500_000_001]))),
        ("n", Arc::new(Int64Array::from(vec![7]))),
    ];
    let batch = RecordBatch::try_from_iter(columns).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let file = std::fs::File::create(&path).unwrap();
    let mut writer = ::parquet::arrow::ArrowWriter::try_new(file, batch.schema(), None).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    let grid = super::parquet(&path).unwrap();
    assert_eq!(grid.rows[0].cells[0], Cell::Clock(1_700_000_000.5));
    assert_eq!(grid.rows[0].cells[1].digits(false).as_deref(), Some("2500000001e-9"));
    assert_eq!(grid.units, ["", "s", ""]);
    assert_eq!(grid.rows[0].cells[2].shown(), "7");
}
