//! Puts pages onto the terminal, only what has changed of them.

use super::{Look, NOTED_FOR, Page, Shared, draw};
use crate::terminal;
use ratatui::backend::{Backend, CrosstermBackend};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use runs::session::unix_ns;
use std::time::Duration;

/// Time between two pages: what changes is a few hundred bytes.
const EVERY: Duration = Duration::from_millis(150);

/// Paints until the view is over or its terminal is gone.
pub(super) fn paint(shared: &Shared) {
    let look = Look::of_environment();
    let mut screen = Screen::default();
    while !shared.is_over() {
        if !screen.put(|area| page(shared, look, area)) {
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

/// What the terminal shows.
#[derive(Default)]
struct Screen {
    shown: Option<Buffer>,
}

impl Screen {
    /// Puts a page; says whether the terminal is there and still this view's.
    fn put(&mut self, page: impl FnOnce(Rect) -> Buffer) -> bool {
        let (width, height) = terminal::size();
        let area = Rect::new(0, 0, width, height);
        let mut bytes = Vec::new();
        if self.shown.as_ref().is_none_or(|shown| shown.area != area) {
            bytes.extend_from_slice(terminal::beginning());
            self.shown = Some(Buffer::empty(area));
        }
        let page = page(area);
        let shown = self.shown.replace(page);
        if let (Some(shown), Some(page)) = (&shown, &self.shown) {
            let changed = shown.diff(page);
            if !changed.is_empty() && CrosstermBackend::new(&mut bytes).draw(changed.into_iter()).is_err() {
                return false;
            }
        }
        write(&bytes)
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
