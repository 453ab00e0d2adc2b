//! A point table from its bytes, CSV or Parquet.

use miette::{Context, IntoDiagnostic};
use models::pass::{Pass, read_passes};
use std::path::Path;

/// The passes of a point table, CSV or Parquet.
///
/// # Errors
/// A table that cannot be read, with its row.
pub fn parse_passes(path: &Path, bytes: &[u8]) -> miette::Result<Vec<Pass>> {
    if bytes.starts_with(b"PAR1") {
        let csv = crate::import::parquet_as_csv(path).wrap_err_with(|| path.display().to_string())?;
        return read_passes(csv.as_bytes()).into_diagnostic().wrap_err_with(|| path.display().to_string());
    }
    read_passes(bytes).into_diagnostic().wrap_err_with(|| path.display().to_string())
}
