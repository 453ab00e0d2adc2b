//! How the process ends: its main thread waits for the subcommand, or for somebody who asks to leave at once.

use std::process::ExitCode;
use std::sync::OnceLock;
use std::sync::mpsc::{Sender, channel};

/// Where the main thread waits for the end.
static END: OnceLock<Sender<ExitCode>> = OnceLock::new();

/// Runs a subcommand on a thread of its own and waits for its end, or for [`exit_now`]: a subcommand that hangs keeps nobody
/// from leaving. `failed` is the status where no thread can be had. Called once, by the main thread, whose return ends the process.
pub fn until_the_end(subcommand: impl FnOnce() -> ExitCode + Send + 'static, failed: u8) -> ExitCode {
    let (end, ended) = channel();
    let _ = END.set(end.clone());
    let run = move || {
        let _ = end.send(subcommand());
    };
    // As large as a main thread's stack commonly is.
    let thread = std::thread::Builder::new().name("subcommand".into()).stack_size(8 << 20).spawn(run);
    match thread {
        Ok(_) => ended.recv().unwrap_or(ExitCode::from(failed)),
        Err(why) => {
            crate::print::remark(&realtime::threads::refused(why).to_string());
            ExitCode::from(failed)
        }
    }
}

/// Asks the main thread to end the process with that status, whatever the subcommand does.
pub fn exit_now(status: u8) {
    if let Some(end) = END.get() {
        let _ = end.send(ExitCode::from(status));
    }
}
