//! How long and how strongly a finger has been vibrated: in one go, and over the last hour.
//!
//! Time is summed while the drive is commanded on or read back on. A go ends only with a rest of its full
//! length. The hour is held in minutes: a minute counts until the whole of it is more than an hour ago, so no
//! pause resets anything early. What an earlier run did is carried over from a ledger.

use crate::signals::Nanos;
use serde::{Deserialize, Serialize};

/// Minutes that are remembered, the present one included: 60 whole ones and the one that runs.
pub const MINUTES: usize = 61;
/// ns in a minute.
pub const MINUTE_NS: u64 = 60_000_000_000;

#[derive(Clone, Copy, Debug)]
struct Minute {
    /// Its number.
    number: u64,
    /// Time driven.
    driven: Nanos,
    /// Integral of the squared rms velocity of the plate, in m2/s.
    dose_m2_s: f64,
}

/// Number of the minute of a time. The run begins in the last one of an hour: the ones before it belong to what was carried over.
const fn minute_of(now: Nanos) -> u64 {
    now.0 / MINUTE_NS + MINUTES as u64
}

/// Minutes in a part of [`Exposed`], and parts that make up the hour and what a minute counts beyond it.
pub const PART_MINUTES: usize = 5;
/// Parts of [`Exposed`].
pub const PARTS: usize = 13;

/// The exposure of a finger before the run began, from a ledger. Every part counts as if all of it had been
/// in its newest minute: nothing is forgotten early.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Exposed {
    /// Time driven since the last rest of full length.
    pub in_one_go: Nanos,
    /// Time rested since then.
    pub resting: Nanos,
    /// The hour in parts of five minutes, newest first: time driven, and dose in m2/s.
    pub parts: [(Nanos, f64); PARTS],
}

impl Exposed {
    /// Whether nothing was exposed.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// The exposure so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exposure {
    /// Time driven since the last rest of full length.
    pub in_one_go: Nanos,
    /// Time driven in this run, and its dose in m2/s.
    pub in_all: (Nanos, f64),
    resting: Nanos,
    before: Option<Nanos>,
    minutes: [Minute; MINUTES],
}

impl Default for Exposure {
    fn default() -> Self {
        let none = Minute { number: 0, driven: Nanos(0), dose_m2_s: 0.0 };
        let (in_one_go, resting) = (Nanos(0), Nanos(0));
        Exposure { in_one_go, in_all: (Nanos(0), 0.0), resting, before: None, minutes: [none; MINUTES] }
    }
}

impl Exposure {
    /// Takes over what was before the first cycle.
    pub(super) fn carry(&mut self, past: &Exposed) {
        (self.in_one_go, self.resting) = (past.in_one_go, past.resting);
        for (part, (driven, dose_m2_s)) in past.parts.iter().enumerate() {
            let number = (MINUTES - part * PART_MINUTES) as u64;
            let minute = &mut self.minutes[(number % MINUTES as u64) as usize];
            *minute = Minute { number, driven: *driven, dose_m2_s: *dose_m2_s };
        }
    }

    /// Adds the time since the cycle before, in which the plate was driven or not, at that rms velocity in m/s.
    pub(super) fn add(&mut self, driven: bool, velocity_rms_m_s: f64, rest: Nanos, now: Nanos) {
        let dt = now.since(self.before.unwrap_or(now));
        self.before = Some(now);
        if driven {
            self.resting = Nanos(0);
            self.in_one_go = self.in_one_go.plus(dt);
        } else {
            self.resting = self.resting.plus(dt);
            if self.resting >= rest {
                self.in_one_go = Nanos(0);
            }
        }
        let number = minute_of(now);
        let minute = &mut self.minutes[(number % MINUTES as u64) as usize];
        if minute.number != number {
            *minute = Minute { number, driven: Nanos(0), dose_m2_s: 0.0 };
        }
        if driven {
            let dose_m2_s = velocity_rms_m_s * velocity_rms_m_s * dt.seconds();
            minute.driven = minute.driven.plus(dt);
            minute.dose_m2_s += dose_m2_s;
            self.in_all = (self.in_all.0.plus(dt), self.in_all.1 + dose_m2_s);
        }
    }

    /// Time driven in the last hour, and its dose in m2/s.
    pub(super) fn in_the_last_hour(&self) -> (Nanos, f64) {
        let this = minute_of(self.before.unwrap_or_default());
        let recent = self.minutes.iter().filter(|m| m.number + MINUTES as u64 > this && m.number <= this);
        recent.fold((Nanos(0), 0.0), |(time, dose), m| (time.plus(m.driven), dose + m.dose_m2_s))
    }
}
