//! How an instrument is switched off, whatever the wire: send, read back, again, until it shows 'off' or the time is over.
//!
//! An end of the program, a trip that ends a sweep, a signal and a panic all come here, since each of them
//! drops [`crate::Links`]. A link that is down at that moment is reopened for the purpose. The driver does
//! not report 'off' without reading it back.

use super::connection::Connection;
use super::link_error::LinkError;
pub use super::link_error::OFF_WITHIN;
use super::mailbox::Mailbox;
use super::ports::SetPoint;
use realtime::{Clock, Nanos};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// An answer on the way to 'off' may take this long, in ms, where the profile allows less: a slow answer is still one.
pub const OFF_ANSWER_MS: u32 = 600;
/// Longest time that an 'off' waits for the answer to an earlier request, in ms. Then the link connects again and
/// sends the 'off' first. A state comes ten times a second at least: a later answer has no use.
pub const OFF_WAITS_MS: u32 = 100;
/// A link that waits for an answer checks so often whether an 'off' is pending.
pub(crate) const LOOK_EVERY: Duration = Duration::from_millis(10);
/// Pause between two tries.
const AGAIN: Duration = Duration::from_millis(4);

/// Whether an 'off' is pending for an instrument that drives or moves, or due because its command has
/// expired: that shortens the wait for an answer.
#[derive(Clone, Default)]
pub struct PendingOff {
    pub(crate) commands: Mailbox<SetPoint>,
    pub(crate) stop: Arc<AtomicBool>,
    /// By which a command expires.
    pub(crate) clock: Option<Clock>,
}

impl PendingOff {
    /// How long the answer may take, in ms, of the `answer_ms` that it may take otherwise.
    pub fn limit_ms(&self, answer_ms: u32) -> u32 {
        let expired = || self.clock.as_ref().is_some_and(|clock| self.commands.expired(clock.now()));
        let is_due = || self.commands.off_waits() || self.stop.load(Ordering::Acquire) || expired();
        if self.commands.drives() && is_due() { answer_ms.min(OFF_WAITS_MS) } else { answer_ms }
    }

    /// When to check again. A pending 'off' brings `deadline` nearer.
    pub(crate) fn look(&self, deadline: &mut Instant) -> Instant {
        let now = Instant::now();
        *deadline = (*deadline).min(now + Duration::from_millis(self.limit_ms(u32::MAX).into()));
        (*deadline).min(now + LOOK_EVERY)
    }
}

/// What a transport can do for an 'off'. It fails only where the connection carries nothing more.
pub trait OffWay {
    /// Sends every safe set-point, whatever became of the one before. What was refused it tells the endpoint.
    fn send_off(&mut self, connection: &mut Connection) -> Result<(), LinkError>;

    /// From now on answers are waited for as long as [`OFF_ANSWER_MS`], where the profile allows less.
    fn be_patient(&mut self, connection: &Connection);

    /// Gets the next state of the instrument into the endpoint.
    fn read_state(&mut self, connection: &mut Connection) -> Result<(), LinkError>;
}

/// Switches an instrument off and reads it back.
///
/// # Errors
/// The connection carries nothing more, or the time is over and the instrument has not shown 'off'.
pub fn switch_off(connection: &mut Connection, way: &mut dyn OffWay) -> Result<(), LinkError> {
    if !connection.endpoint.is_actuator() {
        return Ok(());
    }
    way.be_patient(connection);
    loop {
        way.send_off(connection)?;
        way.read_state(connection)?;
        if connection.endpoint.reads_off() {
            return Ok(());
        }
        if connection.off_time_over() {
            return Err(LinkError::StillOn);
        }
        connection.sleep_until(Some(connection.now().plus(Nanos(AGAIN.as_nanos() as u64))));
    }
}

/// The end of a conversation whose thread is to stop: off, read back.
pub fn at_the_end(connection: &mut Connection, way: &mut dyn OffWay) -> LinkError {
    switch_off(connection, way).err().unwrap_or(LinkError::Stopped)
}

/// The start of a conversation after a lost one: an owed 'off' leaves before any request.
///
/// # Errors
/// The connection carries nothing more.
pub fn at_the_beginning(connection: &mut Connection, way: &mut dyn OffWay) -> Result<(), LinkError> {
    if connection.is_first() || !connection.endpoint.owes_off() {
        Ok(())
    } else if connection.stopping() {
        switch_off(connection, way)
    } else {
        way.send_off(connection)
    }
}

#[cfg(test)]
mod tests;
