//! Records and tables: read without a panic whatever the bytes are.

use super::Chance;
use realtime::recorder::{Recovery, read, recover};

/// All of them, by name, in the order that the coverage-guided target counts them.
pub const ALL: &[(&str, fn(&[u8], &mut Chance))] = &[("records", records), ("tables", tables)];

/// What is recovered can be read again, and is what could be read before.
pub fn records(input: &[u8], _: &mut Chance) {
    let before = read(input).messages.len();
    let mut out = std::io::Cursor::new(Vec::new());
    match recover(std::io::Cursor::new(input), &mut out).unwrap() {
        Recovery::Rewritten { messages, .. } => {
            let after = read(out.get_ref());
            assert_eq!((messages, after.messages.len()), (before, before));
            assert!(after.integrity.intact(), "{:?}", after.integrity);
        }
        Recovery::Whole(_) | Recovery::Nothing { .. } => assert!(out.get_ref().is_empty()),
    }
}

/// Tables of passes: whatever is read has finite numbers.
pub fn tables(input: &[u8], _: &mut Chance) {
    for pass in models::pass::read_passes(input).into_iter().flatten() {
        assert!(pass.normal_force_n.is_finite());
    }
}
