//! The amplitudes of the last while, where a target is rendered: a set-point that changes from cycle to
//! cycle is never constant long enough for the rules that wait for it. They judge the range of what was
//! commanded instead.
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

use crate::signals::Nanos;

/// Commands and readings of one stretch of time.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    low: f64,
    high: f64,
    sum: f64,
    cycles: u32,
    shown: Option<f64>,
}

/// Two stretches of half a response time each: the present one and the one before it. Half of it is longer
/// than a state may be old.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Envelope {
    begun: Option<Nanos>,
    since: Option<Nanos>,
    /// A whole response time has passed since the first command.
    ready: bool,
    now: Stretch,
    before: Option<Stretch>,
}

/// What was commanded and shown over half a response time to a whole one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Over {
    /// Smallest and largest amplitude commanded, peak-to-peak in m.
    pub range_pp_m: [f64; 2],
    /// Mean of the amplitude commanded in the earlier stretch, whose effect must show by now.
    pub mean_pp_m: f64,
    /// Greatest amplitude shown; none where no reading came.
    pub shown_pp_m: Option<f64>,
}

impl Envelope {
    /// Begins a cycle. One whose amplitude is not modulated forgets everything.
    pub fn begin(&mut self, modulated: bool, response: Nanos, now: Nanos) {
        if !modulated {
            *self = Envelope::default();
            return;
        }
        let since = *self.since.get_or_insert(now);
        self.ready = now.since(*self.begun.get_or_insert(now)) >= response;
        if now.since(since) >= Nanos(response.0 / 2) && self.now.cycles > 0 {
            (self.since, self.before) = (Some(now), Some(self.now));
            self.now = Stretch::default();
        }
    }

    /// Takes an amplitude that was read back.
    pub fn shown(&mut self, pp_m: f64) {
        if self.since.is_some() {
            self.now.shown = Some(self.now.shown.map_or(pp_m, |before| before.max(pp_m)));
        }
    }

    /// Takes the command of this cycle.
    pub fn commanded(&mut self, pp_m: f64) {
        if self.since.is_none() {
            return;
        }
        let s = &mut self.now;
        s.low = if s.cycles == 0 { pp_m } else { s.low.min(pp_m) };
        s.high = s.high.max(pp_m);
        s.sum += pp_m;
        s.cycles += 1;
    }

    /// The range over the last while; none before a whole response time has passed.
    pub fn over(&self) -> Option<Over> {
        let before = self.before.filter(|_| self.ready)?;
        let low = if self.now.cycles == 0 { before.low } else { before.low.min(self.now.low) };
        let shown = match (before.shown, self.now.shown) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        };
        Some(Over {
            range_pp_m: [low, before.high.max(self.now.high)],
            mean_pp_m: before.sum / f64::from(before.cycles),
            shown_pp_m: shown,
        })
    }
}
