//! What the program says, on standard output and on standard error: the one place that writes there.
//!
//! While a rig is driven ([`beside`]) two threads write, one for each output, and everybody else puts lines into their bounded
//! queues: whoever keeps a pass or switches a drive off never waits for a terminal, a pipe or a pager.
//!
//! A reader may go away at any time (`muprime ... | head -1`), and a run must not end with it: what cannot be
//! written is dropped. A disk that is full makes the status 1 in the end ([`lacks`]). Text may come from an
//! instrument or a file: control characters, which could rewrite what a person sees on a terminal, are shown
//! as `\u001b` and the like; colours and line ends stay.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use textwrap::{WordSeparator, WordSplitter, WrapAlgorithm};

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
    put(OUT, Piece::Text(format!("{text}\n")), false);
}

/// Writes a document to standard output: its JSON on one line.
pub fn answer_json(value: &(impl serde::Serialize + ?Sized)) {
    answer(&serde_json::to_string(value).expect("the keys of a document are texts"));
}

/// Writes a line to standard error: the form behind [`say!`].
pub fn remark(text: &str) {
    question(&format!("{text}\n"));
}

/// Writes to standard error without a line end: the form behind [`ask!`]. While that is held, the text waits.
pub fn question(text: &str) {
    on_error(text.into(), false);
}

/// A line on standard error that is written before all that waits there.
pub fn urgent(text: &str) {
    on_error(format!("{text}\n"), true);
}

fn on_error(text: String, first: bool) {
    if let Some(held) = &mut *held() {
        return held.keep(text);
    }
    // Not under that lock: a terminal that takes nothing holds up who writes, and nobody else.
    put(ERR, Piece::Text(text), first);
}

/// Draws something on standard error, such as a bar, where remarks are written; `line` is the line that it
/// writes, empty where it writes none.
pub fn draw(line: &str, drawn: impl FnOnce() + Send + 'static) {
    let line = if line.is_empty() { String::new() } else { format!("{line}\n") };
    put(ERR, Piece::Drawn(line, Box::new(drawn)), false);
}

/// The outputs' places among the outlets.
const OUT: usize = 0;
const ERR: usize = 1;
/// What waits for a reader at most, in pieces and in bytes: more is left out, and counted.
const PIECES: usize = 4096;
const BYTES: usize = 8 << 20;
/// How long the end of the program waits for its readers, for both outputs together.
const LAST_WORDS: Duration = Duration::from_secs(2);

/// What is to be written.
enum Piece {
    Text(String),
    Drawn(String, Box<dyn FnOnce() + Send>),
}

impl Piece {
    /// What a person reads of it.
    fn text(&self) -> &str {
        match self {
            Piece::Text(text) | Piece::Drawn(text, _) => text,
        }
    }

    fn write(self, output: usize) {
        match self {
            Piece::Text(text) if output == OUT => written(whole(&mut io::stdout().lock(), &text)),
            Piece::Text(text) => drop(whole(&mut io::stderr().lock(), &text)),
            Piece::Drawn(_, drawn) => drawn(),
        }
    }
}

/// What waits for the reader of one output.
#[derive(Default)]
struct Outlet {
    waiting: VecDeque<Piece>,
    bytes: usize,
    /// What is being written now.
    taken: Option<String>,
    /// Lines left out since the reader took something.
    lost: u64,
    /// Lines left out in all.
    lost_in_all: u64,
}

impl Outlet {
    fn put(&mut self, output: usize, piece: Piece, first: bool) {
        let bytes = piece.text().len();
        if !first && (self.waiting.len() >= PIECES || self.bytes + bytes > BYTES) {
            let line = u64::from(bytes > 0);
            (self.lost, self.lost_in_all) = (self.lost + line, self.lost_in_all + line);
            return;
        }
        if self.lost > 0 && !first {
            // It stands where the lines that were left out would have stood.
            let marker = left_out(output, std::mem::take(&mut self.lost));
            self.bytes += marker.len();
            self.waiting.push_back(Piece::Text(marker));
        }
        self.bytes += bytes;
        if first { self.waiting.push_front(piece) } else { self.waiting.push_back(piece) }
    }

    /// The next piece; a note takes the place of what was left out.
    fn next(&mut self, output: usize) -> Option<Piece> {
        let piece = match self.waiting.pop_front() {
            Some(piece) => {
                self.bytes -= piece.text().len();
                piece
            }
            None if self.lost > 0 => Piece::Text(left_out(output, std::mem::take(&mut self.lost))),
            None => return None,
        };
        self.taken = Some(piece.text().to_string());
        Some(piece)
    }
}

/// What a reader finds in place of lines that it did not take.
fn left_out(output: usize, lines: u64) -> String {
    if output == OUT {
        format!("{{\"left_out\":{lines}}}\n")
    } else {
        format!("... {lines} lines are left out: nothing was read here for a while ...\n")
    }
}

/// Both outputs while threads of their own write them; `None` while everybody writes directly.
static BESIDE: Mutex<Option<[Outlet; 2]>> = Mutex::new(None);
static CHANGED: Condvar = Condvar::new();

fn outlets() -> MutexGuard<'static, Option<[Outlet; 2]>> {
    BESIDE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn put(output: usize, piece: Piece, first: bool) {
    if let Some(outlets) = &mut *outlets() {
        outlets[output].put(output, piece, first);
        return CHANGED.notify_all();
    }
    piece.write(output);
}

/// From now on nobody waits for a reader of the output; a panic's message goes the same way. It is an error
/// where the system gives no thread.
pub fn beside() -> io::Result<()> {
    // A second run of this process goes on with the threads of the first.
    let had = outlets().is_some();
    if had {
        return Ok(());
    }
    outlets().get_or_insert_default();
    for (output, name) in [(OUT, "standard output"), (ERR, "standard error")] {
        if let Err(why) = realtime::threads::spawn(name, move || write_on(output)) {
            *outlets() = None;
            return Err(why);
        }
    }
    std::panic::set_hook(Box::new(|panic| {
        let thread = std::thread::current();
        remark(&format!("thread '{}' {panic}", thread.name().unwrap_or_default()));
    }));
    Ok(())
}

/// Writes what is put into one output's queue.
fn write_on(output: usize) {
    let mut all = outlets();
    while let Some(outlets) = &mut *all {
        match outlets[output].next(output) {
            None => all = CHANGED.wait(all).unwrap_or_else(PoisonError::into_inner),
            Some(piece) => {
                drop(all);
                // A bar that fails to draw ends no output.
                let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| piece.write(output)));
                all = self::outlets();
                if let Some(outlets) = &mut *all {
                    outlets[output].taken = None;
                }
                CHANGED.notify_all();
            }
        }
    }
}

/// Waits until all is written, for both outputs two seconds at most, and returns what was not: nothing where all was.
pub fn end() -> String {
    let unwritten = |outlets: &Option<[Outlet; 2]>| {
        outlets.iter().flatten().any(|o| !o.waiting.is_empty() || o.taken.is_some() || o.lost > 0)
    };
    let waited = CHANGED.wait_timeout_while(outlets(), LAST_WORDS, |outlets| unwritten(outlets));
    let (mut all, _) = waited.unwrap_or_else(PoisonError::into_inner);
    let mut rest = String::new();
    for (outlet, name) in all.iter_mut().flatten().zip(["standard output", "standard error"]) {
        let waiting = outlet.waiting.drain(..).map(|piece| piece.text().to_string());
        let unread = outlet.taken.iter().cloned().chain(waiting);
        let lines: Vec<String> = unread.filter(|text| !text.is_empty()).collect();
        if !lines.is_empty() || outlet.lost_in_all > 0 {
            let (count, lost) = (lines.len(), outlet.lost_in_all);
            let _ = writeln!(
                rest,
                "{name}: {count} lines were not read to the end, {lost} were left out before."
            );
            rest.extend(lines);
        }
    }
    rest
}

/// Remarks that are held at most: the first ones, which say what began, and the last ones.
const FIRST: usize = 100;
const LAST: usize = 900;

/// Output to standard error while a picture has the terminal.
static HELD: Mutex<Option<Held>> = Mutex::new(None);

fn held() -> MutexGuard<'static, Option<Held>> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Remarks that wait.
#[derive(Debug, Default)]
struct Held {
    first: Vec<String>,
    last: VecDeque<String>,
    lost: usize,
}

impl Held {
    fn keep(&mut self, text: String) {
        if self.first.len() < FIRST {
            return self.first.push(text);
        }
        if self.last.len() == LAST {
            self.last.pop_front();
            self.lost += 1;
        }
        self.last.push_back(text);
    }

    fn all(self) -> Vec<String> {
        let lost = (self.lost > 0).then(|| format!("... {} remarks are left out ...\n", self.lost));
        self.first.into_iter().chain(lost).chain(self.last).collect()
    }
}

/// Holds the output to standard error from now on: a picture has the terminal.
pub fn hold() {
    held().get_or_insert_default();
}

/// Holds nothing any more; returns what was held.
pub fn release() -> Vec<String> {
    held().take().map(Held::all).unwrap_or_default()
}

fn whole(to: &mut impl Write, text: &str) -> io::Result<()> {
    // One write: lines of two threads do not mix.
    to.write_all(clean(text).as_bytes()).and_then(|()| to.flush())
}

/// Why standard output lacks something, first.
static LACKS: Mutex<Option<io::Error>> = Mutex::new(None);

/// Notes how a write to standard output went. A reader that has gone away lacks nothing.
pub fn written(result: io::Result<()>) {
    if let Some(why) = result.err().filter(|why| why.kind() != io::ErrorKind::BrokenPipe) {
        LACKS.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(why);
    }
}

/// Why standard output could not be written, where it could not: a full disk, say.
pub fn lacks() -> Option<io::Error> {
    LACKS.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// Standard error for logs: never fails, never passes control characters on.
#[derive(Clone, Copy, Debug, Default)]
pub struct LogWriter;

impl Write for LogWriter {
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

/// The lines of a text folded between words at [`COLUMNS`]; what goes on stands so many columns further in
/// than its line began. A word that is longer stays whole: a path can be copied.
pub fn folded(text: &str, hang: usize) -> String {
    let fold = |line: &str| {
        let words = line.trim_start();
        let own = " ".repeat(line.len() - words.len());
        let further = " ".repeat(own.len() + hang);
        let options = textwrap::Options::new(COLUMNS)
            .initial_indent(&own)
            .subsequent_indent(&further)
            .break_words(false)
            .word_separator(WordSeparator::AsciiSpace)
            .word_splitter(WordSplitter::NoHyphenation)
            .wrap_algorithm(WrapAlgorithm::FirstFit);
        textwrap::fill(words, options)
    };
    text.lines().map(fold).collect::<Vec<_>>().join("\n")
}

/// A word of a command as a shell takes it: in quotes where it needs them.
pub fn quoted(word: impl std::fmt::Display) -> String {
    let word = word.to_string();
    let plain = |c: char| c.is_alphanumeric() || "-_./:=@%+,".contains(c);
    let as_it_is = !word.is_empty() && word.chars().all(plain);
    if as_it_is { word } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// Whether a character changes what is read without being seen: a control character, or a mark that turns the
/// direction of text round, breaks a line, or has no width (but for those that join letters).
pub fn is_hidden(c: char) -> bool {
    let mark = matches!(c, '\u{61c}' | '\u{200b}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}'
        | '\u{2060}' | '\u{2066}'..='\u{2069}' | '\u{feff}');
    mark || (c.is_control() && c != '\n' && c != '\t')
}

/// Text that a terminal shows as it is: what is hidden is written out, but for colours (`ESC [` digits and semicolons `m`).
pub fn clean(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_hidden) {
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
        if is_hidden(c) {
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
    fn a_shell_gives_back_what_was_quoted() {
        for word in ["plain", "with space", "it's", "$HOME `x` \"y\" \\", "", "~", "m\u{e4}rz/1.csv"] {
            let script = format!("printf %s {}", quoted(word));
            let output = std::process::Command::new("sh").args(["-c", &script]).output();
            assert_eq!(output.unwrap().stdout, word.as_bytes());
        }
        assert_eq!(quoted("runs/first-2.csv"), "runs/first-2.csv");
    }

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
        // A name that is read backwards, and marks that nobody sees; letters that are joined stay joined.
        assert_eq!(
            clean("a\u{202e}b\u{2066}c\u{200b}d\u{feff}e\u{2028}"),
            "a\\u202eb\\u2066c\\u200bd\\ufeffe\\u2028"
        );
        assert_eq!(clean("a\u{200d}b \u{5d0}"), "a\u{200d}b \u{5d0}");
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
            held.keep(format!("{n}\n"));
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
    fn a_reader_that_takes_nothing_costs_lines_and_hears_how_many() {
        let text = |outlet: &mut Outlet| match outlet.next(OUT) {
            Some(Piece::Text(text)) => Some(text),
            _ => None,
        };
        let mut outlet = Outlet::default();
        for n in 0..PIECES + 7 {
            outlet.put(OUT, Piece::Text(format!("{n}\n")), false);
        }
        outlet.put(OUT, Piece::Text("the output may still be on\n".into()), true);
        assert_eq!(text(&mut outlet).as_deref(), Some("the output may still be on\n"));
        for n in 0..3 {
            assert_eq!(text(&mut outlet), Some(format!("{n}\n")));
        }
        outlet.put(OUT, Piece::Text("later\n".into()), false);
        let rest: Vec<String> = std::iter::from_fn(|| text(&mut outlet)).collect();
        assert_eq!(rest.len(), PIECES - 3 + 2);
        assert_eq!(rest[PIECES - 3..], ["{\"left_out\":7}\n", "later\n"]);
        assert_eq!((outlet.bytes, outlet.lost_in_all), (0, 7));
        // Large lines are bounded by their bytes.
        for _ in 0..100 {
            outlet.put(OUT, Piece::Text("x".repeat(1 << 20)), false);
        }
        assert_eq!((outlet.waiting.len(), outlet.lost), (8, 92));
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
        written(whole(&mut Gone, "nobody hears this\n"));
        assert!(lacks().is_none());
        written(Err(io::ErrorKind::StorageFull.into()));
        assert_eq!(lacks().map(|why| why.kind()), Some(io::ErrorKind::StorageFull));
    }
}
