//! The way to armed, as a sweep goes it: a reset once nothing stands in the way, the proof of the second
//! channel after it.
//!
//! A machine that is short of time disturbs this in two ways, and nothing is driven in either. A board that
//! is not heard for its age limit is a silent emergency stop: the supply is cut, and stays cut until it is
//! proved. Its amplifier then shows a fault for as long as its supply is open: that is no reason to wait,
//! since the proof is what closes it. And a proof in which the loop was held up is broken off: it is made
//! again, as often as a reset may be requested at all. The sweep reports both. With a human finger no proof
//! is repeated: the hand must release the dead-man device and grip it again, and a person starts again.

use super::events::{Event, Outcome};
use realtime::safety::{Limits, Trip, TripCause, Unit};
use realtime::{Nanos, Row};

/// Time to wait for the rig to arm.
const ARM_WITHIN: Nanos = Nanos(10_000_000_000);
/// Nothing may have stood in the way for this long before a reset is requested.
const CLEAR_FOR: Nanos = Nanos(50_000_000);
/// A reset that found something in its way is requested again, so often in all. Each waits for a clear way.
const ASKS: u32 = 3;
/// Time that the loop has to answer a reset.
const ANSWER_WITHIN: Nanos = Nanos(200_000_000);

/// What a row leads to, before the rig is armed.
#[derive(Debug)]
pub(super) enum Next {
    /// Nothing yet.
    Wait,
    /// A reset is requested, perhaps with an event.
    Ask(Option<Event>),
    /// A proof was disturbed and is to be repeated, with the event of it.
    Again(Event),
    /// The rig is armed.
    Armed,
    /// It does not arm.
    GiveUp(Outcome),
}

/// One arming.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Arming {
    since: Option<Nanos>,
    clear_since: Option<Nanos>,
    requested: Option<Nanos>,
    asks: u32,
    /// What stood in the way last.
    in_the_way: Option<TripCause>,
    /// The trip that disturbed a proof last.
    disturbed: Option<Trip>,
    /// Longest lateness of a cycle since the last request of a reset.
    held_up: Nanos,
    /// Lateness of a cycle from which on it is an overrun by itself.
    overrun: Nanos,
    human_contact: bool,
    /// The cut of the supply was reported already.
    cut_reported: bool,
    /// The last cycle that was seen to prove the second channel.
    proving: Option<u64>,
}

impl Arming {
    pub(super) fn new() -> Self {
        Arming { overrun: Nanos(3_000_000), ..Self::default() }
    }

    /// The same, with the limits of the rig.
    pub(super) fn guarded_by(self, limits: &Limits) -> Self {
        let overrun = Nanos(u64::from(limits.late_in_a_row_max) * limits.timing.cycle.0);
        Arming { overrun, human_contact: limits.human_contact, ..self }
    }

    /// The same rig, to be armed once more. After a person was at it its supply is open on purpose
    /// (`cut_reported`), and is not reported again.
    pub(super) fn afresh(self, cut_reported: bool) -> Self {
        let Arming { overrun, human_contact, .. } = self;
        Arming { overrun, human_contact, cut_reported, ..Arming::default() }
    }

    /// Takes a row.
    pub(super) fn row(&mut self, row: &Row) -> Next {
        let since = *self.since.get_or_insert(row.now);
        self.held_up = self.held_up.max(row.inputs.seen.lateness);
        if row.armed {
            return Next::Armed;
        }
        if let Some(trip) = row.tripped {
            self.clear_since = None;
            // A row that was lost may have armed the rig: then nothing is begun again without a person.
            let broke_off_a_proof = self.proving.is_some_and(|cycle| cycle + 1 == row.cycle);
            if !(broke_off_a_proof && self.is_made_again_after(&trip)) {
                return Next::GiveUp(Outcome::Tripped(trip));
            }
            self.disturbed = Some(trip);
            self.cut_reported = matches!(trip.cause, TripCause::EmergencyStop | TripCause::Suspended);
            return Next::Again(self.disturbed_by(trip.cause));
        }
        self.proving = row.proving.then_some(row.cycle).or(self.proving);
        // The second channel has not yet shown the commanded state.
        let unproved = row.proving.then_some(TripCause::SupplySwitch);
        if row.now.since(since) > ARM_WITHIN {
            let last = self.disturbed.filter(|_| row.waits_for.is_none());
            let blocking = row.waits_for.or(unproved).or(self.in_the_way);
            return Next::GiveUp(last.map_or(Outcome::WouldNotArm { blocking }, Outcome::Tripped));
        }
        self.in_the_way = row.waits_for.or(self.in_the_way);
        self.clear_since = if row.waits_for.is_none() { self.clear_since.or(Some(row.now)) } else { None };
        let clear = self.clear_since.is_some_and(|at| row.now.since(at) >= CLEAR_FOR);
        let unanswered = self.requested.is_none_or(|at| row.now.since(at) > ANSWER_WITHIN) && !row.proving;
        if !(clear && unanswered && self.asks < ASKS) {
            return Next::Wait;
        }
        // What was cut before anything was armed, and needs no person, was cut for a silent emergency stop.
        let event =
            (row.supply_cut && !self.cut_reported).then(|| self.disturbed_by(TripCause::EmergencyStop));
        (self.requested, self.held_up, self.cut_reported) = (Some(row.now), Nanos(0), false);
        self.asks += 1;
        Next::Ask(event)
    }

    fn disturbed_by(&self, cause: TripCause) -> Event {
        Event::ArmingDisturbed { cause, held_up: self.held_up }
    }

    /// Whether the proof is made again after a trip that broke it off: the loop itself was late, or was held
    /// up while something that only grows old grew too old. A relay that does not follow its command is not
    /// among these, nor anything that an instrument reports.
    fn is_made_again_after(&self, trip: &Trip) -> bool {
        let by_itself = matches!(trip.cause, TripCause::Overrun | TripCause::Suspended);
        let grew_old = match trip.cause {
            TripCause::LateralStale
            | TripCause::NormalStale
            | TripCause::LateralInvalid
            | TripCause::NormalInvalid => true,
            TripCause::AmplifierStale | TripCause::StageStale => true,
            // An age: silent. A flag: pressed, or open.
            TripCause::EmergencyStop | TripCause::Interlock => trip.unit == Unit::Second,
            _ => false,
        };
        let held_up = self.held_up >= self.overrun;
        !self.human_contact && self.asks < ASKS && (by_itself || (grew_old && held_up))
    }
}

#[cfg(test)]
mod tests;
