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

/// The status of an error: refused, unless a run had begun.
pub fn status_of(error: &miette::Report) -> u8 {
    use crate::session::Unfinished;
    match error.downcast_ref::<Unfinished>() {
        Some(Unfinished::NotKept) => FAILED,
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
    use crate::session::Unfinished;

    #[test]
    fn refused_means_that_nothing_was_touched() {
        let full = || miette::miette!("No space left on device");
        assert_eq!(status_of(&full()), REFUSED);
        assert_eq!(status_of(&full().wrap_err(Unfinished::NotKept)), FAILED);
        assert_eq!(status_of(&full().wrap_err(Unfinished::Internal)), INTERNAL);
        assert_eq!(status_of(&full().wrap_err(Unfinished::NotKept).wrap_err("and more")), FAILED);
    }
}
