//! A CAN bus as drivers and emulators see it: the seam between both and whatever stands behind it.

use crate::codec::can::CanFrame;
use std::io;
use std::time::{Duration, Instant};

/// What a bus gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CanEvent {
    /// A frame, and how long ago it was received by the adapter or the kernel.
    Frame(CanFrame, Duration),
    /// The controller warns: an error counter is at 96. Frames still pass.
    Warning,
    /// The controller is passive: an error counter is at 128, and it can tell nobody of an error any more.
    Passive,
    /// Something that is not a frame for anybody here was thrown away.
    Other,
    /// The controller has left the bus, and comes back only when a person says so.
    BusOff,
}

/// A CAN bus, whatever stands behind it. It fails only where the bus is gone.
pub trait CanPort: Send {
    /// Sends a frame; `false` where there is no room for it now (back-pressure), and then it is not sent.
    fn send(&mut self, frame: &CanFrame) -> io::Result<bool>;

    /// The next event until `deadline`, which the caller has from its own clock; `None` where none came.
    fn receive(&mut self, deadline: Instant) -> io::Result<Option<CanEvent>>;
}
