//! Records and tables: read without a panic whatever the bytes are.

use super::Chance;
use realtime::recorder::{Entry, Integrity, Reader, Recovery, recover};
use std::io::Cursor;

/// All of them, by name, in the order that the coverage-guided target counts them.
pub const ALL: &[(&str, fn(&[u8], &mut Chance))] = &[("records", records), ("tables", tables)];

/// What is recovered can be read again, and is what could be read before.
pub fn records(input: &[u8], _: &mut Chance) {
    let (before, _) = read(input);
    let mut out = Cursor::new(Vec::new());
    match recover(Cursor::new(input), &mut out).unwrap() {
        Recovery::Rewritten { messages, .. } => {
            let (after, integrity) = read(out.get_ref());
            assert_eq!((messages, after), (before, before));
            assert!(integrity.intact(), "{integrity:?}");
        }
        Recovery::Whole(_) | Recovery::Nothing { .. } => assert!(out.get_ref().is_empty()),
    }
}

/// How many messages a record holds, and what is wrong with it.
fn read(bytes: &[u8]) -> (usize, Integrity) {
    let mut reader = Reader::new(Cursor::new(bytes));
    let messages = reader.by_ref().filter(|entry| matches!(entry, Entry::Message { .. })).count();
    (messages, reader.integrity().clone())
}

/// Tables of passes: whatever is read has finite numbers.
pub fn tables(input: &[u8], _: &mut Chance) {
    for pass in models::pass::read_passes(input).into_iter().flatten() {
        assert!(pass.normal_force_n.is_finite());
    }
}
