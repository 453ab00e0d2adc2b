//! In the place of the kernel's CAN, where it was not built in or the system has none.

use instruments::{CanEvent, CanFrame, CanPort};
use std::convert::Infallible;
use std::io;
use std::time::Instant;

/// No bus.
pub struct KernelCan(Infallible);

impl KernelCan {
    /// Refuses.
    pub fn open(interface: &str) -> io::Result<Self> {
        Err(io::Error::other(format!(
            "{interface}: this muprime was built without SocketCAN (feature `can`, Linux alone); use a serial adapter (slcan)"
        )))
    }
}

impl CanPort for KernelCan {
    fn send(&mut self, _: &CanFrame) -> io::Result<bool> {
        match self.0 {}
    }

    fn receive(&mut self, _: Instant) -> io::Result<Option<CanEvent>> {
        match self.0 {}
    }
}
