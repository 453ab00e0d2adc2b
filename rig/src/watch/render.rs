//! Puts pages onto the terminal, only what has changed of them.

use super::{Look, NOTED_FOR, Page, Shared, draw};
use crate::terminal;
use ratatui_core::buffer::{Buffer, Cell};
use ratatui_core::layout::Rect;
use ratatui_core::style::{Color, Modifier};
use runs::job::unix_ns;
use std::io::Write;
use std::time::Duration;

/// Time between two pages: what changes is a few hundred bytes.
const EVERY: Duration = Duration::from_millis(150);

/// Paints until the view is over or its terminal is gone.
pub(super) fn paint(shared: &Shared) {
    let look = Look::of(|name| std::env::var(name).ok());
    // What the terminal shows; nothing has no area.
    let mut shown = Buffer::default();
    while !shared.is_over() {
        if !put(&mut shown, |area| page(shared, look, area)) {
            return;
        }
        std::thread::sleep(EVERY);
    }
}

/// The page that is to be seen now. What is seen is locked while it is drawn in memory, never while it is written.
fn page(shared: &Shared, look: Look, area: Rect) -> Buffer {
    let mut buffer = Buffer::empty(area);
    let seen = shared.seen();
    let note = seen.note.as_ref().filter(|(_, at)| at.elapsed() < NOTED_FOR);
    let page = Page {
        view: &seen.view,
        source: &seen.source,
        keys: &shared.keys,
        own: shared.own,
        look,
        help: seen.help,
        note: note.map(|(text, _)| text.as_str()),
        silent_s: seen.heard.elapsed().as_secs_f64(),
        unix_s: (unix_ns() / 1_000_000_000) as i64,
    };
    draw(&page, &mut buffer);
    buffer
}

/// Puts a page in place of what is `shown`; says whether the terminal is there and still this view's.
fn put(shown: &mut Buffer, page: impl FnOnce(Rect) -> Buffer) -> bool {
    let (width, height) = terminal::size();
    let area = Rect::new(0, 0, width, height);
    let mut bytes = Vec::new();
    if shown.area != area {
        bytes.extend_from_slice(terminal::ENTER);
        *shown = Buffer::empty(area);
    }
    let page = page(area);
    bytes.extend(sequences(&shown.diff(&page)));
    *shown = page;
    write(&bytes)
}

/// What makes a terminal show these cells: the cursor's moves, the styles and the signs. The style is the
/// terminal's own again at the end.
fn sequences(changed: &[(u16, u16, &Cell)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let (mut next, mut style) = (None, (Color::Reset, Modifier::empty()));
    for &(x, y, cell) in changed {
        // A terminal counts rows and columns from 1. Writing to memory does not fail.
        if next != Some((x, y)) {
            let _ = write!(bytes, "\x1b[{};{}H", y + 1, x + 1);
        }
        // A sign of two columns moves the cursor by two: the next one is placed.
        next = Some((x + 1, y));
        if style != (cell.fg, cell.modifier) {
            style = (cell.fg, cell.modifier);
            let bold = if cell.modifier.contains(Modifier::BOLD) { ";1" } else { "" };
            let reversed = if cell.modifier.contains(Modifier::REVERSED) { ";7" } else { "" };
            let _ = write!(bytes, "\x1b[0{bold}{reversed};{}m", colour(cell.fg));
        }
        bytes.extend_from_slice(cell.symbol().as_bytes());
    }
    if !changed.is_empty() {
        bytes.extend_from_slice(b"\x1b[0m");
    }
    bytes
}

/// A colour of signs as a terminal numbers it; the view uses no other.
fn colour(colour: Color) -> u8 {
    match colour {
        Color::Red => 31,
        Color::Green => 32,
        Color::Yellow => 33,
        _ => 39,
    }
}

/// Writes to the terminal as long as it is this view's.
fn write(mut bytes: &[u8]) -> bool {
    while !bytes.is_empty() {
        if !terminal::is_shown() {
            return false;
        }
        match rustix::io::write(std::io::stdout(), bytes) {
            Ok(count) => bytes = &bytes[count..],
            Err(rustix::io::Errno::INTR) => {}
            Err(_) => return false,
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui_core::style::Style;

    #[test]
    fn only_changed_cells_are_written_with_their_styles() {
        let area = Rect::new(0, 0, 12, 2);
        let (before, mut after) = (Buffer::empty(area), Buffer::empty(area));
        assert!(sequences(&before.diff(&after)).is_empty());
        let alarm = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD | Modifier::REVERSED);
        after.set_string(3, 0, "STOP", alarm);
        after.set_string(7, 0, "!", Style::new());
        after.set_string(0, 1, "手x", Style::new().fg(Color::Green));
        let written = String::from_utf8(sequences(&before.diff(&after))).unwrap();
        let first = "\x1b[1;4H\x1b[0;1;7;31mSTOP\x1b[0;39m!";
        assert_eq!(written, format!("{first}\x1b[2;1H\x1b[0;32m手\x1b[2;3Hx\x1b[0m"));
    }
}
