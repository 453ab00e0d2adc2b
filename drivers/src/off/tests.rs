//! Switching off, over a way that a test leads.

use super::*;
use crate::endpoint::Endpoint;
use crate::endpoint::tests::{amplifier, on, show};
use crate::{InstrumentSetup, profile};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// What was done, in its order.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Did {
    Patient,
    Off,
    Read,
}

/// An instrument that shows 'off' from the so manieth 'off' on; its wire breaks at the so manieth.
struct Instrument {
    did: Vec<Did>,
    off_from: usize,
    breaks_at: usize,
    states: u16,
}

impl Instrument {
    fn new(off_from: usize) -> Self {
        Self { did: Vec::new(), off_from, breaks_at: usize::MAX, states: 0 }
    }

    fn offs(&self) -> usize {
        self.did.iter().filter(|did| **did == Did::Off).count()
    }
}

impl OffWay for Instrument {
    fn send_off(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        self.did.push(Did::Off);
        if self.offs() >= self.breaks_at {
            return Err(LinkError::Io("the wire broke".into()));
        }
        let safe = connection.endpoint.hand_out_off(connection.now());
        assert!(!safe.is_empty());
        Ok(())
    }

    fn be_patient(&mut self, _: &Connection) {
        self.did.push(Did::Patient);
    }

    fn read_state(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        self.did.push(Did::Read);
        self.states += 1;
        let on = self.offs() < self.off_from;
        let arrived = connection.now().0;
        show(&mut connection.endpoint, self.states, on, arrived);
        Ok(())
    }
}

fn connection_of(endpoint: Endpoint) -> Connection {
    let (ready, _opened) = std::sync::mpsc::sync_channel(1);
    Connection::new(endpoint, Instant::now(), Arc::default(), ready)
}

/// A connection whose amplifier was driven, after its first connection.
fn driven() -> Connection {
    let (endpoint, mut port) = amplifier();
    let mut connection = connection_of(endpoint);
    connection.tell(Ok(()));
    port.push(on(1, u64::MAX));
    connection.endpoint.due(connection.now());
    assert!(connection.endpoint.owes_off());
    connection
}

#[test]
fn off_is_sent_until_it_is_read_back() {
    let (mut connection, mut instrument) = (driven(), Instrument::new(3));
    switch_off(&mut connection, &mut instrument).unwrap();
    use Did::{Off, Patient, Read};
    assert_eq!(instrument.did, [Patient, Off, Read, Off, Read, Off, Read]);
    assert!(connection.endpoint.reads_off() && !connection.endpoint.owes_off());
}

#[test]
fn an_instrument_that_shows_on_for_good_is_said_to_be_on() {
    let (mut connection, mut instrument) = (driven(), Instrument::new(usize::MAX));
    let began = Instant::now();
    let ended = at_the_end(&mut connection, &mut instrument);
    assert!(matches!(ended, LinkError::StillOn), "{ended}");
    assert!(
        began.elapsed() >= OFF_WITHIN && instrument.offs() >= 3,
        "{} in {:?}",
        instrument.offs(),
        began.elapsed()
    );
}

#[test]
fn a_wire_that_breaks_ends_it_and_off_stays_owed() {
    let (mut connection, mut instrument) = (driven(), Instrument::new(usize::MAX));
    instrument.breaks_at = 2;
    let ended = at_the_end(&mut connection, &mut instrument);
    assert!(matches!(ended, LinkError::Io(_)), "{ended}");
    assert!(instrument.offs() == 2 && connection.endpoint.owes_off());
}

#[test]
fn an_orderly_end_is_off_read_back() {
    let (mut connection, mut instrument) = (driven(), Instrument::new(1));
    assert!(matches!(at_the_end(&mut connection, &mut instrument), LinkError::Stopped));
    assert!(connection.endpoint.reads_off());
}

#[test]
fn a_sensor_is_not_switched() {
    let setup = InstrumentSetup::new("muprime-force2", "");
    let (endpoint, _port) = Endpoint::force(profile("muprime-force2").unwrap(), &setup).unwrap();
    let (mut connection, mut instrument) = (connection_of(endpoint), Instrument::new(1));
    assert!(matches!(at_the_end(&mut connection, &mut instrument), LinkError::Stopped));
    assert_eq!(instrument.did, []);
}

#[test]
fn a_new_connection_begins_with_the_off_that_is_owed() {
    let mut connection = driven();
    let mut instrument = Instrument::new(1);
    at_the_beginning(&mut connection, &mut instrument).unwrap();
    assert_eq!(instrument.did, [Did::Off], "the conversation reads it back");
    // The program ends meanwhile: here is the place to see it through.
    let mut connection = driven();
    connection.stop.store(true, Ordering::Release);
    let mut instrument = Instrument::new(2);
    at_the_beginning(&mut connection, &mut instrument).unwrap();
    assert_eq!(instrument.did, [Did::Patient, Did::Off, Did::Read, Did::Off, Did::Read]);
    assert!(connection.endpoint.reads_off());
    // A broken wire is reported.
    let mut instrument = Instrument { breaks_at: 1, ..Instrument::new(1) };
    assert!(at_the_beginning(&mut driven(), &mut instrument).is_err());
}

#[test]
fn a_connection_that_owes_nothing_begins_with_nothing() {
    // The first: nothing was commanded before it, and nothing may be, before the instrument is known to be the right one.
    let (mut endpoint, _port) = amplifier();
    show(&mut endpoint, 1, true, 1);
    assert!(endpoint.owes_off());
    let mut instrument = Instrument::new(1);
    at_the_beginning(&mut connection_of(endpoint), &mut instrument).unwrap();
    assert_eq!(instrument.did, []);
    // A later one of an instrument that was never on, whether the program ends or not.
    for stopping in [false, true] {
        let mut connection = connection_of(amplifier().0);
        connection.tell(Ok(()));
        connection.stop.store(stopping, Ordering::Release);
        at_the_beginning(&mut connection, &mut instrument).unwrap();
        assert_eq!(instrument.did, []);
    }
}
