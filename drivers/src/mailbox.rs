//! One place for the newest command, from the loop to a link.
//!
//! Commands are absolute, so only the newest counts: it takes the place of one that the link has not taken
//! yet. One thing must not be overtaken by a newer command: an 'off'. So it is also noted beside the place,
//! and stays noted until the link has seen it. Nothing here blocks, locks or allocates after it was made.

use crossbeam_queue::ArrayQueue;
use realtime::Nanos;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// One end of the place; both ends are alike.
#[derive(Debug)]
pub struct Mailbox<T>(Arc<Inner<T>>);

#[derive(Debug)]
struct Inner<T> {
    newest: ArrayQueue<T>,
    off: AtomicBool,
    /// What the link handed out last drives or moves.
    drives: AtomicBool,
    /// When the newest command that drives or moves expires, in ns.
    expires_ns: AtomicU64,
}

impl<T> Clone for Mailbox<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Default for Mailbox<T> {
    fn default() -> Self {
        Self(Arc::new(Inner {
            newest: ArrayQueue::new(1),
            off: AtomicBool::default(),
            drives: AtomicBool::default(),
            expires_ns: AtomicU64::default(),
        }))
    }
}

impl<T> Mailbox<T> {
    /// Puts a command in the place of whatever waits there. One that drives or moves expires; none: it
    /// switches off or stops.
    pub fn put(&self, command: T, expires_at: Option<Nanos>) {
        match expires_at {
            None => self.0.off.store(true, Ordering::Release),
            Some(at) => self.0.expires_ns.store(at.0, Ordering::Release),
        }
        let _ = self.0.newest.force_push(command);
    }

    /// Takes the newest command.
    pub fn take(&self) -> Option<T> {
        self.0.newest.pop()
    }

    /// Whether an 'off' came since the last call of [`Mailbox::take_off`].
    pub fn off_waits(&self) -> bool {
        self.0.off.load(Ordering::Acquire)
    }

    /// The same, and forgets it: whoever asks sends it.
    pub fn take_off(&self) -> bool {
        self.0.off.swap(false, Ordering::AcqRel)
    }

    /// Notes whether what the link now hands out drives or moves.
    pub fn handed_out(&self, drives: bool) {
        self.0.drives.store(drives, Ordering::Release);
    }

    /// Whether what the link handed out last drives or moves.
    pub fn drives(&self) -> bool {
        self.0.drives.load(Ordering::Acquire)
    }

    /// Whether the newest command that drives or moves has expired.
    pub fn expired(&self, now: Nanos) -> bool {
        now.0 > self.0.expires_ns.load(Ordering::Acquire)
    }

    /// Drops the command that waits. A noted 'off' stays.
    pub fn drop_waiting(&self) {
        while self.0.newest.pop().is_some() {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_takes_the_place_of_older_ones() {
        let mailbox = Mailbox::default();
        (0..1000).for_each(|i| mailbox.put(i, Some(Nanos(i))));
        assert_eq!((mailbox.take(), mailbox.take()), (Some(999), None));
        assert!(!mailbox.off_waits() && mailbox.expired(Nanos(1000)) && !mailbox.expired(Nanos(999)));
    }

    #[test]
    fn an_off_is_not_forgotten_for_newer_commands() {
        let mailbox = Mailbox::default();
        mailbox.put(1, None);
        (2..100).for_each(|i| mailbox.put(i, Some(Nanos(i))));
        mailbox.drop_waiting();
        assert!(mailbox.off_waits() && mailbox.take_off());
        assert!(!mailbox.take_off(), "once it was taken");
    }
}
