//! What the program says, on standard output and on standard error: the one place that writes there.
//!
//! A reader may go away at any time (`muprime ... | head -1`), and a run must not end with it: what cannot be written is
//! dropped. Text may hold what an instrument or a file said: control characters, which could rewrite what a person sees on a
//! terminal, are shown as `\u001b` and the like; colours and line ends stay.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::sync::{Mutex, PoisonError};

/// A line on standard output.
#[macro_export]
macro_rules! out {
    ($($text:tt)*) => { $crate::print::answer(&format!($($text)*)) };
}

/// A line on standard error.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => { $crate::print::remark(&format!($($text)*)) };
}

/// A question on standard error, whose answer comes on the same line.
#[macro_export]
macro_rules! ask {
    ($($text:tt)*) => { $crate::print::question(&format!($($text)*)) };
}

/// Writes a line to standard output: the form behind [`out!`].
pub fn answer(text: &str) {
    whole(&mut io::stdout().lock(), text, "\n");
}

/// Writes a line to standard error: the form behind [`say!`].
pub fn remark(text: &str) {
    question(&format!("{text}\n"));
}

/// Writes to standard error without a line end: the form behind [`ask!`]. What is said while it is held is kept.
pub fn question(text: &str) {
    if let Some(held) = &mut *HELD.lock().unwrap_or_else(PoisonError::into_inner) {
        return held.keep(text);
    }
    // Not under that lock: a terminal that takes nothing holds up who writes, and nobody else.
    whole(&mut io::stderr().lock(), text, "");
}

/// Remarks that are held at most: the first ones, which say what began, and the last ones.
const FIRST: usize = 100;
const LAST: usize = 900;

/// What is said on standard error while a picture has the terminal.
static HELD: Mutex<Option<Held>> = Mutex::new(None);

/// Remarks that wait.
#[derive(Debug, Default)]
struct Held {
    first: Vec<String>,
    last: VecDeque<String>,
    lost: usize,
}

impl Held {
    fn keep(&mut self, text: &str) {
        if self.first.len() < FIRST {
            return self.first.push(text.into());
        }
        if self.last.len() == LAST {
            self.last.pop_front();
            self.lost += 1;
        }
        self.last.push_back(text.into());
    }

    fn all(self) -> Vec<String> {
        let lost = (self.lost > 0).then(|| format!("... {} remarks are left out ...\n", self.lost));
        self.first.into_iter().chain(lost).chain(self.last).collect()
    }
}

/// Holds what is said on standard error from now on: a picture has the terminal.
pub fn hold() {
    HELD.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_default();
}

/// Holds nothing any more; returns what was held.
pub fn release() -> Vec<String> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner).take().map(Held::all).unwrap_or_default()
}

fn whole(to: &mut impl Write, text: &str, end: &str) {
    let text = clean(text);
    // One write: lines of two threads do not mix.
    let _ = to.write_all(format!("{text}{end}").as_bytes()).and_then(|()| to.flush());
}

/// Standard error for logs: never fails, never passes control characters on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Remarks;

impl Write for Remarks {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        question(&String::from_utf8_lossy(bytes));
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Columns of a line for people.
pub const COLUMNS: usize = 80;

/// The lines of a text folded between words at [`COLUMNS`]; what goes on stands so many columns further in than its line began. A word
/// that is longer stays whole: a path can be copied.
pub fn folded(text: &str, hang: usize) -> String {
    let mut lines = Vec::new();
    for line in text.lines() {
        let own = line.len() - line.trim_start().len();
        let mut now = " ".repeat(own);
        let mut empty = true;
        for (gap, word) in words(line.trim_start()) {
            if !empty && now.chars().count() + gap + word.chars().count() > COLUMNS {
                lines.push(std::mem::replace(&mut now, " ".repeat(own + hang)));
                empty = true;
            }
            if !empty {
                now.push_str(&" ".repeat(gap));
            }
            now.push_str(word);
            empty = false;
        }
        lines.push(now);
    }
    lines.join("\n")
}

/// The words of a line, each with the blanks before it: columns stay columns.
fn words(line: &str) -> Vec<(usize, &str)> {
    let (mut all, mut gap) = (Vec::new(), 0);
    for part in line.split(' ') {
        if part.is_empty() {
            gap += 1;
        } else {
            all.push((gap, part));
            gap = 1;
        }
    }
    all
}

/// Text that a terminal shows as it is: control characters are written out, but for line ends, tabs and colours (`ESC [` digits
/// and semicolons `m`).
pub fn clean(text: &str) -> Cow<'_, str> {
    if !text.chars().any(|c| c.is_control() && c != '\n' && c != '\t') {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let colour = colour(rest);
        if colour > 0 {
            shown.push_str(&rest[..colour]);
            rest = &rest[colour..];
            continue;
        }
        if c.is_control() && c != '\n' && c != '\t' {
            let _ = write!(shown, "\\u{:04x}", u32::from(c));
        } else {
            shown.push(c);
        }
        rest = &rest[c.len_utf8()..];
    }
    Cow::Owned(shown)
}

/// Length of the colour that a text begins with, 0 for none.
fn colour(text: &str) -> usize {
    let Some(inside) = text.strip_prefix("\u{1b}[") else { return 0 };
    let digits = inside.bytes().take_while(|b| b.is_ascii_digit() || *b == b';').count();
    if inside.as_bytes().get(digits) == Some(&b'm') { 2 + digits + 1 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_and_colours_stay() {
        assert_eq!(clean("plain\ttext\n\u{b5}m"), "plain\ttext\n\u{b5}m");
        assert_eq!(clean("\u{1b}[1;31mred\u{1b}[0m"), "\u{1b}[1;31mred\u{1b}[0m");
        // Clears the screen, sets the title, goes back over the line, deletes; also by the one-character form (C1).
        assert_eq!(
            clean("a\u{1b}[2Jb\u{1b}]0;t\u{7}c\rd\u{8}\u{9b}2J"),
            "a\\u001b[2Jb\\u001b]0;t\\u0007c\\u000dd\\u0008\\u009b2J"
        );
        assert_eq!(clean("\u{1b}[31"), "\\u001b[31");
    }

    #[test]
    fn lines_are_folded_between_words_and_columns_stay() {
        let text = format!("  a    b\n\n  {}", "word ".repeat(40).trim_end());
        let folded = folded(&text, 4);
        assert!(folded.starts_with("  a    b\n\n  word word"), "{folded}");
        assert!(folded.lines().all(|l| l.len() <= COLUMNS), "{folded}");
        assert_eq!(folded.matches("word").count(), 40);
        assert!(folded.lines().skip(3).all(|l| l.starts_with("      word")), "{folded}");
        assert_eq!(super::folded(&"x".repeat(100), 2).len(), 100);
    }

    #[test]
    fn what_is_held_is_bounded_and_says_what_it_lost() {
        let mut held = Held::default();
        for n in 0..FIRST + LAST + 7 {
            held.keep(&format!("{n}\n"));
        }
        let all = held.all();
        assert_eq!(all.len(), FIRST + 1 + LAST);
        assert_eq!(
            [&*all[0], &*all[FIRST], &*all[FIRST + 1]],
            ["0\n", "... 7 remarks are left out ...\n", "107\n"]
        );
        assert_eq!(all.last().unwrap(), "1006\n");
    }

    #[test]
    fn what_cannot_be_written_is_dropped() {
        struct Gone;
        impl Write for Gone {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::BrokenPipe.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Err(io::ErrorKind::BrokenPipe.into())
            }
        }
        whole(&mut Gone, "nobody hears this", "\n");
    }
}
