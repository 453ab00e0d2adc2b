//! The `muprime` command.
fn main() {}
