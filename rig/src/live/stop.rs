//! A stop that comes from outside a run's process, and is answered as done only where the run shows it.
#![allow(clippy::disallowed_methods, reason = "somebody waits for a run to stop")]

use super::{Ask, Message, Received, Viewer};
use runs::{Event, run_dir};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How long a run may take to show that it stops, first after a request by its feed, then after a signal.
const BY_FEED: Duration = Duration::from_secs(3);
const BY_SIGNAL: Duration = Duration::from_secs(15);
/// Time between two polls.
const POLL_EVERY: Duration = Duration::from_millis(50);

/// Processes that were sent a SIGINT from here, each for a run: a second one would end them before their drive is read back off.
static SIGNALLED: Mutex<BTreeSet<(u32, PathBuf)>> = Mutex::new(BTreeSet::new());

/// Stops the run in a folder: by its feed, and by SIGINT to the process that holds its lock where the run
/// does not show it. Returns what shows it.
///
/// # Errors
/// It is not shown that the run stops; with what was tried.
pub fn stop(folder: &Path) -> Result<String, String> {
    if !run_dir::is_held(folder) {
        return Err("nothing to stop: no process leads this run".into());
    }
    let mut viewer = Viewer::connect(folder).ok();
    if viewer.as_mut().is_some_and(|viewer| by_feed(viewer, folder)) {
        return Ok("it stops: the rig goes to its safe state first".into());
    }
    let Some(number) = run_dir::holder(folder) else {
        return Err("NOT STOPPED: another machine or user leads this run; stop it there".into());
    };
    let again = !SIGNALLED.lock().unwrap_or_else(PoisonError::into_inner).insert((number, folder.into()));
    let process = i32::try_from(number).ok().and_then(Pid::from_raw).ok_or(rustix::io::Errno::SRCH);
    if !again && let Err(why) = process.and_then(|process| kill_process(process, Signal::INT)) {
        return Err(format!("NOT STOPPED: process {number}: {why}"));
    }
    if shows(viewer.as_mut(), folder, BY_SIGNAL) {
        return Ok(format!("it stops: SIGINT to process {number}"));
    }
    Err(format!(
        "SIGINT was sent to process {number}, and the run does not show a stop: use the emergency stop if the rig does not obey"
    ))
}

fn by_feed(viewer: &mut Viewer, folder: &Path) -> bool {
    viewer.asking().is_ok_and(|mut ask| ask(Ask::Stop).is_ok()) && shows(Some(viewer), folder, BY_FEED)
}

/// Whether a run shows within some time that it stops or has ended: by its feed, or because nobody holds its lock.
fn shows(mut viewer: Option<&mut Viewer>, folder: &Path, within: Duration) -> bool {
    let until = Instant::now() + within;
    while Instant::now() < until {
        match viewer.as_mut().map(|viewer| viewer.hear(POLL_EVERY)) {
            Some(Received::Message(message)) => match *message {
                Message::Ended(_) => return true,
                Message::Event(event) if matches!(event.event, Event::StopRequested | Event::Tripped(_)) => {
                    return true;
                }
                _ => {}
            },
            Some(Received::Gone) => viewer = None,
            _ if !run_dir::is_held(folder) => return true,
            Some(Received::Nothing) => {}
            None => std::thread::sleep(POLL_EVERY),
        }
    }
    false
}
