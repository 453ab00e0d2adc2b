//! A bar on standard error: how much of a long computation is done, and how long the rest may take.
#![allow(clippy::disallowed_methods, reason = "people wait in wall-clock time")]

use std::io::{IsTerminal, Write, stderr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Columns of the bar itself.
const WIDTH: u64 = 30;
/// Shortest time from one drawing to the next.
const DRAWN_EVERY: Duration = Duration::from_millis(50);
/// Takes the cursor to the line's beginning and wipes the line.
const WIPED: &str = "\r\u{1b}[2K";

/// A bar; its clones are the same bar.
#[derive(Clone)]
pub struct Bar(Arc<Mutex<State>>);

struct State {
    length: u64,
    position: u64,
    what: String,
    left: Option<String>,
    message: String,
    began: Instant,
    drawn: Option<Instant>,
    shown: bool,
}

impl Bar {
    /// A bar of so many parts, called `what`. Nothing is drawn yet. It is hidden unless it is wanted and
    /// standard error is a terminal: a log holds no bars.
    pub fn new(length: u64, what: &str, wanted: bool) -> Self {
        Bar(Arc::new(Mutex::new(State {
            length,
            position: 0,
            what: what.into(),
            left: None,
            message: String::new(),
            began: Instant::now(),
            drawn: None,
            shown: wanted && stderr().is_terminal(),
        })))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether nothing is drawn.
    pub fn is_hidden(&self) -> bool {
        !self.state().shown
    }

    /// Parts that are done.
    pub fn position(&self) -> u64 {
        self.state().position
    }

    /// So many parts more are done.
    pub fn inc(&self, parts: u64) {
        let mut state = self.state();
        state.position += parts;
        state.draw(false);
    }

    /// So many parts are done.
    pub fn set_position(&self, parts: u64) {
        let mut state = self.state();
        state.position = parts;
        state.draw(false);
    }

    /// What is being done, behind the rest of the line.
    pub fn set_message(&self, message: impl Into<String>) {
        let mut state = self.state();
        state.message = format!(", {}", message.into());
        state.draw(false);
    }

    /// The time that the rest takes, in words, by whoever knows it better than from the parts that are done.
    pub fn set_left(&self, left: String) {
        let mut state = self.state();
        state.left = Some(left);
        state.draw(false);
    }

    /// Takes the bar away while something else is written.
    pub fn suspend<T>(&self, write: impl FnOnce() -> T) -> T {
        let mut state = self.state();
        state.wipe();
        let written = write();
        state.draw(true);
        written
    }

    /// Writes a line above the bar.
    pub fn println(&self, line: impl AsRef<str>) {
        self.suspend(|| {
            let _ = writeln!(stderr(), "{}", line.as_ref());
        });
    }

    /// Takes the bar away for good.
    pub fn finish_and_clear(&self) {
        let mut state = self.state();
        state.wipe();
        state.shown = false;
    }
}

impl State {
    fn wipe(&self) {
        if self.shown && self.drawn.is_some() {
            let _ = stderr().write_all(WIPED.as_bytes());
        }
    }

    fn draw(&mut self, now: bool) {
        let fresh = self.drawn.is_some_and(|drawn| drawn.elapsed() < DRAWN_EVERY);
        if self.shown && (now || !fresh || self.position >= self.length) {
            let _ = stderr().write_all(format!("{WIPED}{}", self.line()).as_bytes());
            self.drawn = Some(Instant::now());
        }
    }

    fn line(&self) -> String {
        let State { length, position, what, message, .. } = self;
        let full = (WIDTH * position.min(length) / length.max(&1)) as usize;
        let left = self.left.clone().unwrap_or_else(|| {
            let left = self.began.elapsed().as_secs_f64() / *position as f64
                * length.saturating_sub(*position) as f64;
            if left.is_finite() { format!("{} to go", duration(left)) } else { "begun".into() }
        });
        let (done, open) = ("#".repeat(full), "-".repeat(WIDTH as usize - full));
        let line = format!("{done}{open} {position}/{length} {what}, {left}{message}");
        // What a terminal breaks into two lines is not wiped as one.
        line.chars().take(super::COLUMNS - 1).collect()
    }
}

/// A span of seconds as people say it.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s:02} s"),
        (h, m, _) => format!("{h} h {m:02} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_how_much_is_done_and_a_log_holds_none() {
        let bar = Bar::new(4, "passes", false);
        assert!(bar.is_hidden());
        assert_eq!(bar.state().line(), format!("{} 0/4 passes, begun", "-".repeat(30)));
        bar.inc(1);
        bar.clone().set_left("7 s to go".into());
        bar.set_message("sliding");
        let line = format!("{}{} 1/4 passes, 7 s to go, sliding", "#".repeat(7), "-".repeat(23));
        assert_eq!(bar.state().line(), line);
        bar.set_position(9);
        assert_eq!((bar.position(), bar.suspend(|| 3)), (9, 3));
        assert!(bar.state().line().starts_with(&"#".repeat(30)));
    }

    #[test]
    fn spans_are_said_as_people_say_them() {
        assert_eq!([59.4, 61.0, 7260.0].map(duration), ["59 s", "1 min 01 s", "2 h 01 min"]);
    }
}
