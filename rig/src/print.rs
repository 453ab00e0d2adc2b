//! What the program says, on standard output and on standard error: the one place that writes there.
//!
//! A reader may go away at any time (`muprime ... | head -1`), and a run must not end with it: what cannot be written is
//! dropped. Text may hold what an instrument or a file said: control characters, which could rewrite what a person sees on a
//! terminal, are shown as `\u001b` and the like; colours and line ends stay.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::{self, Write};

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
    whole(&mut io::stderr().lock(), text, "\n");
}

/// Writes to standard error without a line end: the form behind [`ask!`].
pub fn question(text: &str) {
    whole(&mut io::stderr().lock(), text, "");
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
