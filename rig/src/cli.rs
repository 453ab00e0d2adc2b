//! One file a subcommand. Add one: a file here, a line in this list, a variant and a line in `main.rs`.

pub mod blind;
pub mod calibrate;
pub mod check;
pub mod completions;
pub mod diagnose;
pub mod doctor;
pub mod export;
pub mod faults;
pub mod model;
pub mod recover;
pub mod replay;
pub mod report;
pub mod run;
pub mod runs;
pub mod virtual_rig;
pub mod watch;

use std::process::ExitCode;

/// Done, also when the model has left the measurement or the verdict is unknown.
pub const DONE: u8 = 0;
/// Done, but the answer is a failure: a safety trip ended the run, a check fell short.
pub const FAILED: u8 = 1;
/// Refused: nothing was touched.
pub const REFUSED: u8 = 2;
/// A fault of this program.
pub const INTERNAL: u8 = 3;

/// A status as the process's exit code.
pub fn exit(status: u8) -> miette::Result<ExitCode> {
    Ok(ExitCode::from(status))
}
