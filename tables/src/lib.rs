//! What comes from other programs and goes to them, and the check of any file.
//!
//! | room | purpose |
//! |---|---|
//! | [`mod@import`] | foreign tables made into point tables |
//! | [`export`] | a run's passes and record in the formats of other programs |
//! | [`law`] | a friction law by name or from a file; a law that was tabulated |
//! | [`passes`] | a point table from its bytes, CSV or Parquet |
//! | [`schemas`] | schemas from the types, the reference of all keys, commented beginnings, what is bundled |
//! | [`check`] | what is wrong with any file, and whether a plan can run on a setup |

#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod check;
pub mod export;
pub mod import;
pub mod law;
pub mod passes;
pub mod schemas;
