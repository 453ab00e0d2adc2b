//! A point table from its bytes, CSV or Parquet.

use crate::import::as_csv;
use miette::{Context, IntoDiagnostic};
use models::pass::{Pass, read_passes};
use std::path::Path;

/// The passes of a point table, CSV or Parquet.
///
/// # Errors
/// A table that cannot be read, with its row.
pub fn parse_passes(path: &Path, bytes: &[u8]) -> miette::Result<Vec<Pass>> {
    let read = as_csv(path, bytes).and_then(|csv| read_passes(&csv[..]).into_diagnostic());
    read.wrap_err_with(|| path.display().to_string())
}
