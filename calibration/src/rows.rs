//! Rows of a CSV table, by the names of its columns.

use serde::de::DeserializeOwned;
use std::io::Read;

/// Rows with their lines, the header being line 1; unknown columns are ignored.
///
/// # Errors
/// The first row that cannot be read: its line, and what is wrong in which column.
pub(crate) fn read<T: DeserializeOwned>(input: impl Read) -> Result<Vec<(u64, T)>, (u64, String)> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(input);
    let headers = reader.headers().map_err(|e| (1, e.to_string()))?.clone();
    let one = |record: csv::Result<csv::StringRecord>| {
        let record = record.map_err(|e| (e.position().map_or(0, csv::Position::line), e.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        let row = record.deserialize(Some(&headers)).map_err(|e| (line, in_words(&e, &headers)))?;
        Ok((line, row))
    };
    reader.records().map(one).collect()
}

fn in_words(error: &csv::Error, headers: &csv::StringRecord) -> String {
    let csv::ErrorKind::Deserialize { err, .. } = error.kind() else { return error.to_string() };
    let column = err.field().and_then(|field| headers.get(field as usize));
    let there = || headers.iter().collect::<Vec<_>>().join(", ");
    column.map_or_else(
        || format!("{} (the table has {})", err.kind(), there()),
        |column| format!("{column}: {}", err.kind()),
    )
}
