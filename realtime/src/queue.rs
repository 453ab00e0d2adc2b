//! Commands on their way to the loop, where a stop never waits.
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

use crate::cycle::Command;
use crossbeam_queue::ArrayQueue;
use std::sync::atomic::{AtomicBool, Ordering};

/// Commands to the loop, from any thread. The loop's end neither blocks nor allocates.
///
/// A [`Command::Stop`] goes past the ring: the loop sees it first in its next cycle, and what was queued
/// before it is dropped, a reset included.
#[derive(Debug)]
pub struct CommandQueue {
    ring: ArrayQueue<Command>,
    stop: AtomicBool,
}

impl CommandQueue {
    /// A queue for so many commands.
    ///
    /// # Panics
    /// A capacity of zero.
    pub fn new(capacity: usize) -> Self {
        CommandQueue { ring: ArrayQueue::new(capacity), stop: AtomicBool::new(false) }
    }

    /// Puts a command at the end. A stop always finds room.
    ///
    /// # Errors
    /// The command itself, where the ring is full.
    pub fn push(&self, command: Command) -> Result<(), Command> {
        if command == Command::Stop {
            self.stop();
            return Ok(());
        }
        self.ring.push(command)
    }

    /// Asks for a stop: the loop's next cycle sees it.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Release);
    }

    /// The next command: a stop before any other.
    pub fn pop(&self) -> Option<Command> {
        if self.stop.swap(false, Ordering::AcqRel) {
            // A stop drops the requests before it. Bounded: a writer may write meanwhile.
            for _ in 0..self.ring.capacity() {
                if self.ring.pop().is_none() {
                    break;
                }
            }
            return Some(Command::Stop);
        }
        self.ring.pop()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cycle::Marker;
    use crate::safety::Request;

    #[test]
    fn a_stop_waits_behind_nothing_and_drops_what_was_queued() {
        let queue = CommandQueue::new(64);
        while queue.push(Command::Set(Request::default(), Marker::default())).is_ok() {}
        assert_eq!(queue.push(Command::Reset), Err(Command::Reset), "full");
        assert_eq!(queue.push(Command::Stop), Ok(()));
        assert_eq!((queue.pop(), queue.pop()), (Some(Command::Stop), None));
        queue.push(Command::Reset).unwrap();
        assert_eq!((queue.pop(), queue.pop()), (Some(Command::Reset), None), "one stop is delivered once");
    }
}
