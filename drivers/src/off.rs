//! How an instrument is switched off, whatever the wire: send, read back, again, until it shows 'off' or the time is over.
//!
//! An end of the program, a trip that ends a sweep, a signal and a panic all come here, since each of them
//! drops [`crate::Links`]. A link that is down at that moment is reopened for the purpose. The driver does
//! not report 'off' without reading it back.

use super::ended::Ended;
pub use super::ended::OFF_WITHIN;
use super::session::Session;
use realtime::ports::Nanos;
use std::time::Duration;

/// An answer on the way to 'off' may take this long, in ms, where the profile allows less: a slow answer is still one.
pub const OFF_ANSWER_MS: u32 = 600;
/// Pause between two tries.
const AGAIN: Duration = Duration::from_millis(4);

/// What a transport can do for an 'off'. It fails only where the connection carries nothing more.
pub trait OffWay {
    /// Sends every safe set-point, whatever became of the one before. What was refused it tells the endpoint.
    fn send_off(&mut self, session: &mut Session) -> Result<(), Ended>;

    /// From now on answers are waited for as long as [`OFF_ANSWER_MS`], where the profile allows less.
    fn be_patient(&mut self, session: &Session);

    /// Gets the next state of the instrument into the endpoint.
    fn read_state(&mut self, session: &mut Session) -> Result<(), Ended>;
}

/// Switches an instrument off and reads it back.
///
/// # Errors
/// The connection carries nothing more, or the time is over and the instrument has not shown 'off'.
pub fn switch_off(session: &mut Session, way: &mut dyn OffWay) -> Result<(), Ended> {
    if !session.endpoint.is_actuator() {
        return Ok(());
    }
    way.be_patient(session);
    loop {
        way.send_off(session)?;
        way.read_state(session)?;
        if session.endpoint.reads_off() {
            return Ok(());
        }
        if session.off_time_over() {
            return Err(Ended::StillOn);
        }
        session.sleep_until(Some(session.now().plus(Nanos(AGAIN.as_nanos() as u64))));
    }
}

/// The end of a conversation whose thread is to stop: off, read back.
pub fn at_the_end(session: &mut Session, way: &mut dyn OffWay) -> Ended {
    switch_off(session, way).err().unwrap_or(Ended::Stopped)
}

/// The start of a conversation after a lost one: an owed 'off' leaves before any request.
///
/// # Errors
/// The connection carries nothing more.
pub fn at_the_beginning(session: &mut Session, way: &mut dyn OffWay) -> Result<(), Ended> {
    if session.is_first() || !session.endpoint.owes_off() {
        Ok(())
    } else if session.stopping() {
        switch_off(session, way)
    } else {
        way.send_off(session)
    }
}

#[cfg(test)]
mod tests;
