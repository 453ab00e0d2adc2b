//! How long and how strongly a finger has been vibrated: in one go, and over the last hour.
//!
//! Time is summed while the drive is commanded on or read back on. A go ends only with a rest of its full length. The hour is
//! held in minutes: a minute counts until the whole of it is more than an hour ago, so no pause resets anything early.

use crate::ports::Nanos;

/// Minutes that are remembered, the present one included: 60 whole ones and the one that runs.
const MINUTES: usize = 61;
const MINUTE_NS: u64 = 60_000_000_000;

/// What a minute held.
#[derive(Clone, Copy, Debug)]
struct Minute {
    /// Its number, from the start of the run.
    number: u64,
    /// Time driven.
    driven: Nanos,
    /// Integral of the squared rms velocity of the plate, in m2/s.
    dose_m2_s: f64,
}

/// The exposure so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exposure {
    /// Time driven since the last rest of full length.
    pub in_one_go: Nanos,
    resting: Nanos,
    before: Option<Nanos>,
    minutes: [Minute; MINUTES],
}

impl Exposure {
    pub(super) const fn new() -> Self {
        let none = Minute { number: 0, driven: Nanos(0), dose_m2_s: 0.0 };
        Exposure { in_one_go: Nanos(0), resting: Nanos(0), before: None, minutes: [none; MINUTES] }
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
        let number = now.0 / MINUTE_NS;
        let minute = &mut self.minutes[(number % MINUTES as u64) as usize];
        if minute.number != number {
            *minute = Minute { number, driven: Nanos(0), dose_m2_s: 0.0 };
        }
        if driven {
            minute.driven = minute.driven.plus(dt);
            minute.dose_m2_s += velocity_rms_m_s * velocity_rms_m_s * dt.seconds();
        }
    }

    /// Time driven in the last hour, and its dose in m2/s.
    pub(super) fn in_the_last_hour(&self) -> (Nanos, f64) {
        let this = self.before.unwrap_or_default().0 / MINUTE_NS;
        let recent = self.minutes.iter().filter(|m| m.number + MINUTES as u64 > this && m.number <= this);
        recent.fold((Nanos(0), 0.0), |(time, dose), m| (time.plus(m.driven), dose + m.dose_m2_s))
    }
}
