//! One file a subcommand. Add one: a file here, a line in this list, a variant and a line in `main.rs`.
#![allow(clippy::disallowed_methods, reason = "people wait in wall-clock time")]

pub mod blind;
pub mod calibrate;
#[cfg(feature = "parquet")]
pub mod case;
#[cfg(feature = "parquet")]
pub mod cases;
pub mod check;
pub mod compare;
pub mod completions;
pub mod dashboard;
pub mod diagnose;
pub mod doc;
pub mod doctor;
pub mod examples;
pub mod export;
pub mod faults;
#[cfg(feature = "parquet")]
pub mod gather;
pub mod import;
pub mod init;
pub mod man;
pub mod model;
pub mod recover;
pub mod replay;
pub mod report;
pub mod run;
pub mod runs;
pub mod schema;
pub mod show;
#[cfg(feature = "parquet")]
pub mod submit;
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

/// The status of an error: refused, unless a run had begun.
pub fn status_of(error: &miette::Report) -> u8 {
    use ::runs::session::Unfinished;
    match error.downcast_ref::<Unfinished>() {
        Some(Unfinished::NotKept | Unfinished::Interrupted | Unfinished::NotOff) => FAILED,
        Some(Unfinished::Internal) => INTERNAL,
        None => REFUSED,
    }
}

/// A status as the process's exit code.
pub fn exit(status: u8) -> miette::Result<ExitCode> {
    Ok(ExitCode::from(status))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::runs::session::Unfinished;

    #[test]
    fn refused_means_that_nothing_was_touched() {
        let full = || miette::miette!("No space left on device");
        assert_eq!(status_of(&full()), REFUSED);
        assert_eq!(status_of(&full().wrap_err(Unfinished::NotKept)), FAILED);
        assert_eq!(status_of(&full().wrap_err(Unfinished::Internal)), INTERNAL);
        assert_eq!(status_of(&full().wrap_err(Unfinished::NotOff)), FAILED);
        assert_eq!(status_of(&Unfinished::Interrupted.into()), FAILED);
        assert_eq!(status_of(&full().wrap_err(Unfinished::NotKept).wrap_err("and more")), FAILED);
    }
}
