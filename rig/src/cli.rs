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
use std::sync::OnceLock;
use std::sync::mpsc::{Sender, channel};

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
        Some(Unfinished::NotKept | Unfinished::Interrupted | Unfinished::NotOff) => FAILED,
        Some(Unfinished::Internal) => INTERNAL,
        None => REFUSED,
    }
}

/// Where the main thread waits for the end.
static END: OnceLock<Sender<ExitCode>> = OnceLock::new();

/// Runs a subcommand on a thread of its own and waits for its end, or for somebody who asks to leave at once: a subcommand
/// that hangs keeps nobody from leaving. Called once, by the main thread, whose return ends the process.
pub fn until_the_end(subcommand: impl FnOnce() -> ExitCode + Send + 'static) -> ExitCode {
    let (end, ended) = channel();
    let _ = END.set(end.clone());
    let run = move || {
        let _ = end.send(subcommand());
    };
    // As large as a main thread's stack commonly is.
    let thread = std::thread::Builder::new().name("subcommand".into()).stack_size(8 << 20).spawn(run);
    let code = match thread {
        Ok(_) => ended.recv().unwrap_or(ExitCode::from(INTERNAL)),
        Err(_) => ExitCode::from(INTERNAL),
    };
    // Whoever leaves at once leaves others no time for it.
    crate::terminal::give_back();
    let unread = crate::print::end();
    // A folder that was refused stays as it is.
    if let Some(run) = RUN.get().filter(|run| !unread.is_empty() && crate::run_dir::has_begun(run)) {
        let _ = crate::files::write_plain(&run.join(UNREAD), unread);
    }
    code
}

/// Name of the file in a run's folder with what its readers did not take.
pub const UNREAD: &str = "unread.txt";
/// The folder of the run that this process leads.
static RUN: OnceLock<std::path::PathBuf> = OnceLock::new();

/// A rig is driven from now on: nobody waits for a reader of standard output or standard error, and what they do not take stands in
/// the run's folder afterwards.
///
/// # Errors
/// The system gives no thread.
pub fn tell_beside(run: &std::path::Path) -> miette::Result<()> {
    let _ = RUN.set(run.into());
    miette::IntoDiagnostic::into_diagnostic(crate::print::beside())
}

/// Asks the main thread to end the process with that status, whatever the subcommand does.
pub fn leave_now(status: u8) {
    if let Some(end) = END.get() {
        let _ = end.send(ExitCode::from(status));
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
        assert_eq!(status_of(&full().wrap_err(Unfinished::NotOff)), FAILED);
        assert_eq!(status_of(&Unfinished::Interrupted.into()), FAILED);
        assert_eq!(status_of(&full().wrap_err(Unfinished::NotKept).wrap_err("and more")), FAILED);
    }
}
